"""Node `slip_controller`: wheel torque commands that limit or hold slip.

A behaviour runs in a ROS 2 process or in lock step, see `traction_evaluation.replay.lockstep`.
"""

import math
from collections.abc import Collection, Sequence
from enum import Enum
from types import SimpleNamespace
from typing import Any

from traction_controller.control.driveline import DRIVEN_AXLES, Differential, Grouping
from traction_controller.control.exit_reason import ExitReason
from traction_controller.control.laws.registry import LAWS
from traction_controller.control.slip_control import SlipControl
from traction_controller.control.slip_controller import SlipController
from traction_controller.control.slip_state import SlipState
from traction_controller.control.wheel_outcome import Degraded, WheelOutcome
from traction_controller.estimation.slip_filter import Source
from traction_controller.synthesis.gain_schedule import ControlWeights
from traction_node import diagnostic
from traction_node.behaviour import Behaviour
from traction_node.host import Host
from traction_node.joints import JointOrder, Number
from traction_node.parameter import NodeParameter
from traction_node.stamp import Stamp, between

_WEIGHTS = ControlWeights()


def _names(kind: type[Enum]) -> tuple[str, ...]:
    """Names of the members of an enumeration, as values of a parameter."""
    return tuple(member.name.lower() for member in kind)


class SlipControllerBehaviour(Behaviour):
    """Torque command for every wheel, published for each slip estimate."""

    NAME = 'slip_controller'
    LIFECYCLE = True
    PARAMETERS = (
        NodeParameter(
            'vehicle',
            default='tractor_4wd',
            description='preset or path of a vehicle YAML',
            read_only=True,
        ),
        NodeParameter(
            'mode',
            default='limit',
            description=(
                'limit: only reduce the requested torque; hold: regulate slip to the target'
            ),
            choices=('limit', 'hold'),
        ),
        NodeParameter(
            'slip_target',
            default=0.2,
            description='slip target until a message on the topic slip_target',
            minimum=SlipControl.MIN_TARGET,
            maximum=SlipControl.MAX_TARGET,
        ),
        NodeParameter(
            'law',
            default='lpv',
            description='control law',
            choices=tuple(LAWS),
        ),
        NodeParameter(
            'gain_table',
            default='',
            description=(
                'gain table of the law lpv: name of a shipped one, or path of a YAML '
                'file; empty: the shipped one of the vehicle'
            ),
            read_only=True,
        ),
        NodeParameter(
            'grouping',
            default='wheel',
            description='wheels that form a control group; vehicle: one engine drives all wheels',
            choices=_names(Grouping),
        ),
        NodeParameter(
            'differential',
            default='open',
            description='locked: the wheels of a group have the same speed',
            choices=_names(Differential),
        ),
        NodeParameter(
            'driven_axles',
            default='all',
            description='driven axles; front: the first, rear: all others',
            choices=DRIVEN_AXLES,
        ),
        NodeParameter(
            'request_timeout',
            default=0.5,
            description='time without torque_request after which the request is zero',
            unit='s',
            minimum=0.05,
            maximum=10.0,
        ),
        NodeParameter(
            'hold_torque',
            default=[10000.0],
            description=(
                'largest torque in mode hold, for each wheel or all, at most the limit of the gate'
            ),
            unit='N·m',
            minimum=1.0,
            read_only=True,
        ),
        NodeParameter(
            'torque_rate',
            default=[1e6],
            description=(
                'limit of the rate of torque, for each wheel or all, at most that of the gate'
            ),
            unit='N·m/s',
            minimum=1.0,
            read_only=True,
        ),
        NodeParameter(
            'torque_timeout',
            default=0.1,
            description=(
                'age of wheel_states relative to slip_estimate from which shaft torque is missing'
            ),
            unit='s',
            minimum=0.02,
            maximum=10.0,
        ),
        NodeParameter(
            'rate',
            default=100.0,
            description='nominal rate of slip_estimate',
            unit='Hz',
            minimum=10.0,
            maximum=1000.0,
            read_only=True,
        ),
        NodeParameter(
            'torque_time_constant',
            default=0.1,
            description='time constant from commanded to shaft torque',
            unit='s',
            minimum=0.005,
            maximum=2.0,
            read_only=True,
        ),
        NodeParameter(
            'min_speed',
            default=0.3,
            description='speed of rim and vehicle below which slip is not controlled',
            unit='m/s',
            minimum=0.05,
            maximum=2.0,
            read_only=True,
        ),
        NodeParameter(
            'set_point',
            default='none',
            description=(
                'none: target from slip_target; efficiency: target from the estimated soil'
            ),
            choices=('none', 'efficiency'),
            read_only=True,
        ),
        NodeParameter(
            'set_point_weight',
            default=0.0,
            description='weight in the set-point: 0 tractive efficiency, 1 drawbar pull',
            minimum=0.0,
            maximum=1.0,
        ),
        NodeParameter(
            'set_point_low',
            default=0.05,
            description='lower bound of the set-point',
            minimum=0.01,
            maximum=0.6,
            read_only=True,
        ),
        NodeParameter(
            'set_point_high',
            default=0.3,
            description='upper bound of the set-point',
            minimum=0.01,
            maximum=0.6,
            read_only=True,
        ),
        NodeParameter(
            'set_point_rate',
            default=0.01,
            description='limit of the rate of the set-point',
            unit='1/s',
            minimum=1e-4,
            maximum=1.0,
            read_only=True,
        ),
        NodeParameter(
            'set_point_time_constant',
            default=5.0,
            description='time constant of the set-point',
            unit='s',
            minimum=0.1,
            maximum=1000.0,
            read_only=True,
        ),
        NodeParameter(
            'soil',
            default='sandy_loam_chrono',
            description=(
                'nominal soil of the set-point, as in slip_estimator: preset or file.yaml:name'
            ),
            read_only=True,
        ),
        NodeParameter(
            'weight_slip',
            default=_WEIGHTS.slip,
            description='law lqi: slip error with the same weight as weight_torque',
            minimum=1e-3,
            maximum=1.0,
            read_only=True,
        ),
        NodeParameter(
            'weight_integral_time',
            default=_WEIGHTS.integral_time,
            description='law lqi: time after which a constant slip error has twice the weight',
            unit='s',
            minimum=0.01,
            maximum=100.0,
            read_only=True,
        ),
        NodeParameter(
            'weight_torque',
            default=_WEIGHTS.torque,
            description=(
                'law lqi: torque with the same weight as weight_slip, as share of static '
                'load times radius'
            ),
            minimum=1e-3,
            maximum=100.0,
            read_only=True,
        ),
        NodeParameter(
            'pi_proportional',
            default=0.0,
            description=(
                'law pi: gain on slip as share of static load times radius; 0: by the SIMC rules'
            ),
            minimum=0.0,
            maximum=1000.0,
            read_only=True,
        ),
        NodeParameter(
            'pi_integral',
            default=0.0,
            description=(
                'law pi: gain on the integral of the slip error as share of static load '
                'times radius; 0: by the SIMC rules'
            ),
            unit='1/s',
            minimum=0.0,
            maximum=10000.0,
            read_only=True,
        ),
        NodeParameter(
            'pi_response_time',
            default=0.15,
            description='law pi: response time for the SIMC rules',
            unit='s',
            minimum=0.01,
            maximum=10.0,
            read_only=True,
        ),
    )

    def __init__(self, host: Host):
        super().__init__(host)
        self._configured = False

    def check_parameters(self, p: SimpleNamespace) -> None:
        """Check that the vehicle can be loaded and the parameters suit it."""
        SlipController.check_parameters(p)
        if self._configured:
            self._controller.control.prepare(p.law)

    def parameters_changed(self, p: SimpleNamespace, names: Collection[str]) -> None:
        """Apply changed parameters; the command continues without a jump."""
        if self._configured:
            self._controller.set_parameters(p, names)

    def configure(self) -> None:
        """Construct the controller and the messages."""
        self._controller = SlipController.from_parameters(self.host.p)
        self._configured = True
        if self._controller.lpv_refused:
            self.host.get_logger().info(
                f'law lpv cannot be chosen: {self._controller.lpv_refused}'
            )
        names = list(self._controller.control.vehicle.wheel_names)
        self._orders = {
            what: JointOrder(names, what, one_for_all=what == 'torque_request effort')
            for what in (
                'wheel_states effort',
                'terrain_estimate max_shear_stress',
                'terrain_estimate valid',
                'torque_request effort',
                'slip_estimate slip',
                'slip_estimate wheel_based_speed',
                'slip_estimate valid',
                'slip_estimate slip_variance',
                'slip_estimate slip_stiffness',
                'slip_estimate gross_traction',
            )
        }
        self._publish_command = self.host.publisher('wheel_torque_command').publish
        self._command = self.host.message('wheel_torque_command')
        self._command.name = names
        self._command.header.frame_id = 'base_link'
        self._publish_state = self.host.publisher('controller_state').publish
        self._state = self.host.message('controller_state')
        self._state.wheel_names = names
        self._state.header.frame_id = 'base_link'
        self._start_over()
        self.host.subscription('slip_estimate', self._on_slip)
        if self._controller.set_point is not None:
            self.host.subscription('terrain_estimate', self._on_terrain)
        self.host.subscription('wheel_states', self._on_wheel_states)
        self.host.subscription('torque_request', self._on_request)
        self.host.subscription('slip_target', self._on_target)

    def cleanup(self) -> None:
        """Delete the controller."""
        self._configured = False
        del self._controller

    def _start_over(self) -> None:
        self._controller.reset()
        # Times relative to the first stamp, since differences of small numbers are exact.
        self._epoch: Stamp | None = None
        self._refused: dict[str, str] = {}

    def _time(self, stamp: Stamp) -> float:
        """Time from the first stamp, s."""
        if self._epoch is None:
            self._epoch = stamp
        return between(self._epoch, stamp)

    def activate(self) -> None:
        """Start from the initial state."""
        self._start_over()
        self.host.set_diagnostic(diagnostic.WARN, 'waiting for slip_estimate')

    def _take(
        self, what: str, names: Sequence[str], values: Sequence[Number]
    ) -> list[Number] | None:
        """Values in wheel order; None with the reason in the diagnostics."""
        try:
            ordered = self._orders[what].values(names, values)
        except ValueError as error:
            self._refuse(what, error)
            return None
        self._refused.pop(what, None)
        return ordered

    def _refuse(self, what: str, error: ValueError | str) -> None:
        self._refused[what] = str(error)
        self.host.set_diagnostic(diagnostic.ERROR, 'refused: ' + '; '.join(self._refused.values()))

    def _on_wheel_states(self, message: Any) -> None:
        # Empty effort: the vehicle does not measure torque, which is no fault.
        torque = None
        if len(message.effort):
            torque = self._take('wheel_states effort', message.name, message.effort)
        self._controller.wheel_states(self._time(message.header.stamp), torque)

    def _on_terrain(self, message: Any) -> None:
        names = message.wheel_names
        valid = self._take('terrain_estimate valid', names, message.valid)
        stress = self._take('terrain_estimate max_shear_stress', names, message.max_shear_stress)
        if valid is None or stress is None:
            return
        # NaN if unknown, which JointOrder rejects; so it is reordered separately.
        modulus = dict(zip(names, message.shear_deformation_modulus, strict=False))
        moduli = [modulus.get(name, math.nan) for name in self._command.name]
        self._controller.terrain_estimate(self._time(message.header.stamp), stress, valid, moduli)

    def _on_request(self, message: Any) -> None:
        request = self._take('torque_request effort', message.name, message.effort)
        if request is not None:
            self._controller.torque_request(self.host.steady_time(), request)

    def _on_target(self, message: Any) -> None:
        try:
            self._controller.slip_target(message.data)
        except ValueError as error:
            self._refuse('slip_target', error)
        else:
            self._refused.pop('slip_target', None)

    def _slip_state(self, message: Any) -> SlipState | None:
        """Slip state of a message; None with the reason in the diagnostics."""
        names = message.wheel_names
        slips = self._take('slip_estimate slip', names, message.slip)
        rims = self._take('slip_estimate wheel_based_speed', names, message.wheel_based_speed)
        valid = self._take('slip_estimate valid', names, message.valid)
        if slips is None or rims is None or valid is None:
            return None
        speed = message.ground_based_speed
        if not math.isfinite(speed):
            self._refuse('speed', f'slip_estimate ground_based_speed is {speed}')
            return None
        self._refused.pop('speed', None)
        state = SlipState(slips, valid, rims, speed)
        # Estimators without soil leave these empty.
        if len(message.gross_traction):
            state.gross_traction = self._take(
                'slip_estimate gross_traction', names, message.gross_traction
            )
        if len(message.slip_stiffness):
            state.slip_stiffness = self._take(
                'slip_estimate slip_stiffness', names, message.slip_stiffness
            )
        state.speed_measured = message.source != Source.WHEEL
        if not state.speed_measured:
            variances = self._take('slip_estimate slip_variance', names, message.slip_variance)
            if variances is not None:
                state.slip_deviation = [math.sqrt(max(variance, 0.0)) for variance in variances]
        return state

    def _on_slip(self, message: Any) -> None:
        if not self.host.active:
            return
        slip_state = self._slip_state(message)
        if slip_state is None:
            return
        stamp = message.header.stamp
        controller, control = self._controller, self._controller.control
        outcomes = controller.slip_estimate(self._time(stamp), self.host.steady_time(), slip_state)
        request = controller.request

        command = self._command
        command.header.stamp = stamp
        command.effort = [outcome.torque for outcome in outcomes]
        self._publish_command(command)

        state = self._state
        state.header.stamp = stamp
        state.mode = int(control.mode)
        state.law = control.law
        state.grouping = int(control.grouping)
        state.differential = int(control.differential)
        state.target_source = int(control.target_source)
        state.limit_status = [int(outcome.limit_status) for outcome in outcomes]
        state.exit_reason = [int(outcome.exit_reason) for outcome in outcomes]
        state.degraded = [int(outcome.degraded) for outcome in outcomes]
        state.changes = control.changes
        state.change_count = control.change_count
        state.slip_target = control.slip_target
        state.wheel_slip_target = [outcome.slip_target for outcome in outcomes]
        state.slip = slip_state.slip
        state.torque_request = request or [0.0] * control.n_wheels
        state.torque_command = command.effort
        state.slip_gain = [outcome.gains[0] for outcome in outcomes]
        state.torque_gain = [outcome.gains[1] for outcome in outcomes]
        state.integral_gain = [outcome.gains[2] for outcome in outcomes]
        self._publish_state(state)
        if not self._refused:
            self._report_control(request, outcomes)

    def _report_control(
        self, request: Sequence[float] | None, outcomes: Sequence[WheelOutcome]
    ) -> None:
        mode = self.host.p.mode
        if any(outcome.exit_reason is ExitReason.FUNCTION_FAULT for outcome in outcomes):
            said = 'control law failed: no torque until activated anew'
            self.host.set_diagnostic(diagnostic.ERROR, said, mode=mode)
        elif request is None:
            said = 'no torque_request: commanding no torque'
            self.host.set_diagnostic(diagnostic.WARN, said, mode=mode)
        else:
            missing = Degraded.NONE
            for outcome in outcomes:
                missing |= outcome.degraded
            level, said = diagnostic.OK, 'controlling'
            if missing:
                level, said = diagnostic.WARN, f'controlling {missing.words}'
            self.host.set_diagnostic(
                level, said, mode=mode, target=self._controller.control.slip_target
            )


def main() -> int:
    """Run the node."""
    from traction_node.run import run

    return run(SlipControllerBehaviour)
