"""Nodes for test_process.py, run as `python sample_nodes.py CLASS --ros-args ...`."""

import sys
import threading

from std_msgs.msg import Float64

from traction_node import diagnostic
from traction_node.behaviour import Behaviour
from traction_node.parameter import NodeParameter
from traction_node.run import run

# As numerical libraries do on import: a thread that may be the one to receive a signal.
threading.Thread(target=threading.Event().wait, daemon=True).start()


class Sample(Behaviour):
    """Publishes `slip_target` at 50 Hz while active, and 0 as its last word."""

    NAME = 'sample'
    LIFECYCLE = True
    PARAMETERS = (
        NodeParameter(
            'slip',
            default=0.2,
            description='slip to publish',
            minimum=0.0,
            maximum=1.0,
        ),
        NodeParameter(
            'slip_max',
            default=0.5,
            description='largest slip',
            minimum=0.0,
            maximum=1.0,
        ),
        NodeParameter(
            'mode',
            default='limit',
            description='what to do',
            choices=('limit', 'hold'),
        ),
        NodeParameter(
            'wheel_names',
            default=['left', 'right'],
            description='wheels',
            read_only=True,
        ),
        NodeParameter(
            'radius',
            default=[0.5, 0.5],
            description='rolling radii',
            unit='m',
            minimum=0.1,
            maximum=2.0,
        ),
        NodeParameter(
            'fail_in',
            default='',
            description='hook that shall fail',
        ),
    )

    def check_parameters(self, p):
        if p.slip > p.slip_max:
            raise ValueError(f'slip = {p.slip:g} exceeds slip_max = {p.slip_max:g}')

    def parameters_changed(self, p, names):
        self.host.get_logger().info(f'slip is now {p.slip:g}')

    def configure(self):
        if self.host.p.fail_in == 'configure':
            raise OSError('no such calibration')
        if self.host.p.fail_in == 'configure with a defect':
            raise RuntimeError('a defect')
        self.target = self.host.publisher('slip_target')
        self.host.subscription('radar', self.on_radar)

    def activate(self):
        if self.host.p.fail_in == 'activate':
            raise ValueError('no radar')
        self.host.steady_timer(0.02, lambda: self.target.publish(Float64(data=self.host.p.slip)))

    def deactivate(self):
        self.target.publish(Float64(data=0.0))

    def cleanup(self):
        print('cleaned up', flush=True)

    def on_radar(self, message):
        speed = message.twist.twist.linear.x
        if speed < 0.0:
            raise RuntimeError('a defect in a callback')
        self.host.set_diagnostic(diagnostic.WARN, 'radar heard', speed=speed)


class Ticker(Behaviour):
    """Counts ticks of ROS time and ends after a number of them."""

    NAME = 'ticker'
    PARAMETERS = (
        NodeParameter(
            'ticks',
            default=3,
            description='ticks to count',
            minimum=1,
        ),
        NodeParameter(
            'complaint',
            default='',
            description='reason to end with',
        ),
    )

    def configure(self):
        if self.host.p.ticks == 13:
            raise ValueError('13 brings bad luck')
        self.count = 0
        self.host.node.create_timer(0.1, self.tick)
        print('started', flush=True)

    def tick(self):
        self.count += 1
        print(f'tick {self.count} at {self.host.now() * 1e-9:.1f}', flush=True)
        if self.count == self.host.p.ticks:
            self.host.finish(self.host.p.complaint)

    def deactivate(self):
        print('stopped', flush=True)


if __name__ == '__main__':
    name = sys.argv.pop(1)
    sys.exit(run({'Sample': Sample, 'Ticker': Ticker}[name]))
