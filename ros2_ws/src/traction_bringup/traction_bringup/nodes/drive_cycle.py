"""Node `drive_cycle`: simulated driver with a torque ramp, in place of autonomy."""

import copy
from types import SimpleNamespace
from typing import Any

from traction_node import diagnostic
from traction_node.behaviour import Behaviour
from traction_node.parameter import NodeParameter
from traction_node.stamp import Stamp, between


class DriveCycleBehaviour(Behaviour):
    """Torque request that rises to a constant, published for every reading of the wheels.

    Its time is that of the stamps of `wheel_states`, so the drive does not depend on the speed of
    the simulation. Without a controller, remap `torque_request` to `wheel_torque_command`.
    """

    NAME = 'drive_cycle'
    PARAMETERS = (
        NodeParameter(
            'wheel_names',
            default=['fl', 'fr', 'rl', 'rr'],
            description='names of the wheels',
            read_only=True,
        ),
        NodeParameter(
            'torque',
            default=[1000.0],
            description='torque of each wheel, or one for all',
            unit='N·m',
        ),
        NodeParameter(
            'ramp',
            default=3.0,
            description='time of the rise of torque from zero',
            unit='s',
            minimum=0.0,
        ),
        NodeParameter(
            'listeners',
            default=1,
            description='number of subscribers of torque_request to wait for',
            minimum=0,
            maximum=10,
            read_only=True,
        ),
        NodeParameter(
            'duration',
            default=0.0,
            description='time after which the node ends; 0: never',
            unit='s',
            minimum=0.0,
        ),
        NodeParameter(
            'slip_target',
            default=0.2,
            description='slip target, published once',
            minimum=0.01,
            maximum=0.9,
            read_only=True,
        ),
    )

    def check_parameters(self, p: SimpleNamespace) -> None:
        """Check that torques suit the wheels."""
        if len(p.torque) not in (1, len(p.wheel_names)):
            raise ValueError(
                f'{len(p.wheel_names)} wheels need as many entries of torque or one for all, '
                f'got {len(p.torque)}'
            )

    def configure(self) -> None:
        """Publish the target and wait for wheel states."""
        self._begin: Stamp | None = None
        self._request_publisher = self.host.publisher('torque_request')
        self._request = self.host.message('torque_request')
        self._request.name = list(self.host.p.wheel_names)
        self._request.header.frame_id = 'base_link'
        target = self.host.message('slip_target')
        target.data = self.host.p.slip_target
        self.host.publisher('slip_target').publish(target)
        self.host.subscription('wheel_states', self._on_wheel_states)
        self.host.set_diagnostic(diagnostic.WARN, 'waiting for wheel_states')

    def _on_wheel_states(self, message: Any) -> None:
        p, stamp = self.host.p, message.header.stamp
        begin = self._begin
        if begin is None:
            there = self._request_publisher.get_subscription_count()
            if there < p.listeners:
                self.host.set_diagnostic(
                    diagnostic.WARN,
                    f'waiting for {p.listeners} subscribers of torque_request, has {there}',
                )
                return
            # Copied, since the message may be reused.
            begin = self._begin = copy.copy(stamp)
            self.host.set_diagnostic(diagnostic.OK, 'driving')
        elapsed = max(0.0, between(begin, stamp))
        if p.duration and elapsed >= p.duration:
            self.host.finish()
            return
        share = min(1.0, elapsed / p.ramp) if p.ramp else 1.0
        torque = p.torque
        if len(torque) == 1:
            torque *= len(p.wheel_names)
        self._request.header.stamp = stamp
        self._request.effort = [share * value for value in torque]
        self._request_publisher.publish(self._request)


def main() -> int:
    """Run the node."""
    from traction_node.run import run

    return run(DriveCycleBehaviour)
