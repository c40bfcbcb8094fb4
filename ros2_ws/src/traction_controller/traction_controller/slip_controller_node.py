"""The node `slip_controller`: limits or holds slip by the torque it sends to the gate."""

import time

from traction_controller.gain_schedule import ControlWeights
from traction_controller.slip_control import Mode, SlipControl
from traction_interfaces.msg import ControllerState
from traction_model.vehicle import load_vehicle
from traction_node import diagnostic
from traction_node.joints import JointOrder
from traction_node.node import TractionLifecycleNode
from traction_node.parameter import Parameter
from traction_node.run import run
from traction_node.stamp import between

_WEIGHTS = ControlWeights()


class SlipControllerNode(TractionLifecycleNode):
    """Answers every slip estimate with a torque command for every wheel."""

    NAME = 'slip_controller'
    PARAMETERS = (
        Parameter('vehicle', 'tractor_4wd', 'preset or path of a vehicle YAML', read_only=True),
        Parameter(
            'mode',
            'limit',
            'limit: only ever reduce the requested torque; hold: regulate slip to the target',
            choices=('limit', 'hold'),
        ),
        Parameter(
            'slip_target', 0.2, 'slip to limit or hold, until one comes on the topic slip_target',
            '', SlipControl.LEAST_TARGET, SlipControl.MOST_TARGET,
        ),
        Parameter(
            'request_timeout', 0.5, 'silence of torque_request after which it counts as zero',
            's', 0.05, 10.0,
        ),
        Parameter('hold_torque', [10000.0], 'largest torque in hold of each wheel, or of all: '
                  'what the gate lets through', 'N·m', 1.0, read_only=True),
        Parameter('rate', 100.0, 'nominal rate of slip_estimate', 'Hz', 10.0, 1000.0,
                  read_only=True),
        Parameter('torque_time_constant', 0.1, 'lag of shaft behind commanded torque', 's', 0.005,
                  2.0, read_only=True),
        Parameter('least_speed', 0.3, 'speed of rim and vehicle below which slip is not acted on',
                  'm/s', 0.05, 2.0, read_only=True),
        Parameter('weight_slip', _WEIGHTS.slip, 'slip error that weighs as much as weight_torque',
                  '', 1e-3, 1.0, read_only=True),
        Parameter('weight_integral_time', _WEIGHTS.integral_time, 'time after which a lasting '
                  'slip error weighs as much again', 's', 0.01, 100.0, read_only=True),
        Parameter('weight_torque', _WEIGHTS.torque, 'torque that weighs as much as weight_slip, '
                  'as share of static load times radius', '', 1e-3, 100.0, read_only=True),
    )  # fmt: skip

    def check_parameters(self, p):
        """Refuse a vehicle that cannot be loaded, or torques that do not fit it."""
        wheels = len(load_vehicle(p.vehicle).wheels)
        if len(p.hold_torque) not in (1, wheels):
            raise ValueError(f'hold_torque has {len(p.hold_torque)} entries for {wheels} wheels')

    def parameters_changed(self, p, names):
        """Take over mode and target; the command goes on from where it is."""
        if self._control is None:
            return
        self._control.mode = Mode[p.mode.upper()]
        # A target that came by topic stands until the parameter is set.
        if 'slip_target' in names:
            self._control.set_target(p.slip_target)

    def __init__(self, **kwargs):
        self._control = None
        super().__init__(**kwargs)

    def configure(self):
        """Compute the gain schedule and build the messages."""
        p = self.p
        vehicle = load_vehicle(p.vehicle)
        self._control = SlipControl(
            vehicle,
            p.slip_target,
            Mode[p.mode.upper()],
            lag=p.torque_time_constant,
            dt=1.0 / p.rate,
            weights=ControlWeights(p.weight_slip, p.weight_integral_time, p.weight_torque),
            hold_torque=p.hold_torque,
            least_speed=p.least_speed,
        )
        names = list(vehicle.wheel_names)
        self._orders = {
            what: JointOrder(names, what)
            for what in (
                'wheel_states effort',
                'terrain_estimate slip_stiffness',
                'torque_request effort',
                'slip_estimate slip',
                'slip_estimate wheel_based_speed',
                'slip_estimate valid',
            )
        }
        self._command_publisher = self.publisher('wheel_torque_command')
        self._command = self._command_publisher.msg_type(name=names)
        self._command.header.frame_id = 'base_link'
        self._publish_state = self.publisher('controller_state').publish
        self._state = ControllerState(wheel_names=names)
        self._state.header.frame_id = 'base_link'
        self._start_over()
        self.subscription('slip_estimate', self._on_slip)
        self.subscription('terrain_estimate', self._on_terrain)
        self.subscription('wheel_states', self._on_wheel_states)
        self.subscription('torque_request', self._on_request)
        self.subscription('slip_target', self._on_target)

    def cleanup(self):
        """Forget the control law."""
        self._control = None

    def _start_over(self):
        self._control.reset()
        # Until the terrain is known: soil stiff enough to be careful with.
        self._stiffness = [5.0 * float(load) for load in self._control.vehicle.static_loads()]
        self._shaft_torque = [0.0] * self._control.n_wheels
        self._request = None
        self._request_steady = 0.0
        self._stamp = None
        self._refused = {}

    def activate(self):
        """Begin without memory of an earlier drive."""
        self._start_over()
        self.set_diagnostic(diagnostic.WARN, 'waiting for slip_estimate')

    def _take(self, what, names, values):
        """Values in wheel order, or None with the reason in the diagnostics."""
        try:
            ordered = self._orders[what].values(names, values)
        except ValueError as error:
            self._refuse(what, error)
            return None
        self._refused.pop(what, None)
        return ordered

    def _refuse(self, what, error):
        self._refused[what] = str(error)
        self.set_diagnostic(diagnostic.ERROR, 'refused: ' + '; '.join(self._refused.values()))

    def _on_wheel_states(self, message):
        torque = self._take('wheel_states effort', message.name, message.effort)
        if torque is not None:
            self._shaft_torque = torque

    def _on_terrain(self, message):
        stiffness = self._take(
            'terrain_estimate slip_stiffness', message.wheel_names, message.slip_stiffness
        )
        if stiffness is not None:
            self._stiffness = stiffness

    def _on_request(self, message):
        names, efforts = message.name, message.effort
        if len(efforts) == 1 and not names:
            # One entry without a name: for all wheels.
            names, efforts = self._command.name, list(efforts) * self._control.n_wheels
        request = self._take('torque_request effort', names, efforts)
        if request is not None:
            self._request = request
            self._request_steady = time.monotonic()

    def _on_target(self, message):
        try:
            self._control.set_target(message.data)
        except ValueError as error:
            self._refuse('slip_target', error)
        else:
            self._refused.pop('slip_target', None)

    def _on_slip(self, message):
        if not self.active:
            return
        control = self._control
        names = message.wheel_names
        slips = self._take('slip_estimate slip', names, message.slip)
        rims = self._take('slip_estimate wheel_based_speed', names, message.wheel_based_speed)
        valid = self._take('slip_estimate valid', names, message.valid)
        if slips is None or rims is None or valid is None:
            return
        stamp = message.header.stamp
        dt = 0.0 if self._stamp is None else between(self._stamp, stamp)
        # After a gap no more than a few periods of integral action at once, and none where the
        # clock was set back.
        dt = min(max(dt, 0.0), 5.0 / self.p.rate)
        silent = time.monotonic() - self._request_steady > self.p.request_timeout
        request = None if silent else self._request
        outcomes = control.step(
            dt,
            slips,
            valid,
            rims,
            message.ground_based_speed,
            self._stiffness,
            self._shaft_torque,
            request,
        )
        self._stamp = stamp

        command = self._command
        command.header.stamp = stamp
        command.effort = [outcome.torque for outcome in outcomes]
        self._command_publisher.publish(command)

        state = self._state
        state.header.stamp = stamp
        state.mode = int(control.mode)
        state.limit_status = [int(outcome.limit_status) for outcome in outcomes]
        state.exit_reason = [int(outcome.exit_reason) for outcome in outcomes]
        state.slip_target = control.slip_target
        state.slip = slips
        state.torque_request = request or [0.0] * control.n_wheels
        state.torque_command = command.effort
        state.slip_gain = [outcome.gains[0] for outcome in outcomes]
        state.torque_gain = [outcome.gains[1] for outcome in outcomes]
        state.integral_gain = [outcome.gains[2] for outcome in outcomes]
        self._publish_state(state)
        if not self._refused:
            if request is None:
                self.set_diagnostic(
                    diagnostic.WARN, 'no torque_request: commanding no torque', mode=self.p.mode
                )
            else:
                self.set_diagnostic(
                    diagnostic.OK, 'controlling', mode=self.p.mode, target=control.slip_target
                )


def main():
    """Run the node."""
    return run(SlipControllerNode)
