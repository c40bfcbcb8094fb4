"""Node `torque_gate`: from `wheel_torque_command` to checked and limited `wheel_torque`."""

from types import SimpleNamespace
from typing import Any

from torque_gate.gate import WATCHDOG_PERIOD, State, StopSource, TorqueGate
from traction_node.behaviour import Behaviour
from traction_node.diagnostic import ERROR, OK, WARN
from traction_node.host import Host
from traction_node.parameter import NodeParameter
from traction_node.stamp import seconds

REPORT_PERIOD = 1.0
"""Time between two regular reports on what is limited, s."""

LEVELS = {
    State.WAITING: WARN,
    State.PASSING: OK,
    State.HOLDING: WARN,
    State.RELEASING: ERROR,
    State.SAFE: ERROR,
    State.STOPPED: ERROR,
}


class TorqueGateBehaviour(Behaviour):
    """Messages to and from `torque_gate.gate.TorqueGate`, with a watchdog on the steady clock."""

    NAME = 'torque_gate'
    LIFECYCLE = True
    PARAMETERS = (
        NodeParameter(
            'wheel_names',
            default=['fl', 'fr', 'rl', 'rr'],
            description='names of the wheels in every command, and order of the lists below',
            read_only=True,
        ),
        NodeParameter(
            'min_torque',
            default=[-3000.0],
            description='minimum torque of each wheel, or one for all; forward positive',
            unit='N·m',
            read_only=True,
        ),
        NodeParameter(
            'max_torque',
            default=[8000.0],
            description='maximum torque of each wheel, or one for all; forward positive',
            unit='N·m',
            read_only=True,
        ),
        NodeParameter(
            'max_rate',
            default=[30000.0],
            description='maximum rate of torque of each wheel, or one for all',
            unit='N·m/s',
            minimum=1.0,
            read_only=True,
        ),
        NodeParameter(
            'timeout',
            default=0.1,
            description='time for which the last good command holds',
            unit='s',
            minimum=0.01,
            maximum=0.19,
            read_only=True,
        ),
        NodeParameter(
            'release_time',
            default=0.06,
            description='time of the linear change to the safe torque after that',
            unit='s',
            minimum=0.0,
            maximum=0.18,
            read_only=True,
        ),
        NodeParameter(
            'max_age',
            default=0.2,
            description=(
                'largest difference between the stamps of a command and of the newest wheel states'
            ),
            unit='s',
            minimum=0.01,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'safe_torque',
            default=0.0,
            description='torque of every wheel without a command',
            unit='N·m',
            read_only=True,
        ),
    )

    def __init__(self, host: Host):
        super().__init__(host)
        # Kept here because a new configuration constructs a new gate.
        self._stopped_by: frozenset[StopSource] = frozenset()

    def check_parameters(self, p: SimpleNamespace) -> None:
        """Check that limits suit the wheels and each other."""
        TorqueGate.from_parameters(p)

    def configure(self) -> None:
        """Construct the gate; it receives measured torques from now on."""
        self._gate = TorqueGate.from_parameters(self.host.p)
        for source in self._stopped_by:
            self._gate.emergency_stop(source, True)
        self._output = self.host.message('wheel_torque')
        self._output.name = list(self.host.p.wheel_names)
        self._output.header.frame_id = 'base_link'
        self._output.effort = self._gate.output
        self._efforts = self._output.effort
        # Zero until a stamp arrives.
        self._newest_stamp = self.host.message('wheel_torque').header.stamp
        self._publisher = self.host.publisher('wheel_torque')
        self.host.subscription('wheel_states', self._measured)
        self.host.subscription('wheel_torque_command', self._command)
        self.host.subscription('emergency_stop', self._stop_by_topic)
        self.host.service('emergency_stop', 'std_srvs/srv/SetBool', self._stop_by_service)
        self._reported_state: State | None = None
        self._reported_level = OK
        self._reported_at = 0.0

    def activate(self) -> None:
        """Start to pass commands, and to send the safe torque without them."""
        self._reported_state = None
        self.host.steady_timer(WATCHDOG_PERIOD, self._watch)

    def deactivate(self) -> None:
        """Send the safe torque."""
        self._gate.release()
        self._publish(self._newest_stamp)

    def _measured(self, message: Any) -> None:
        self._newest_stamp = message.header.stamp
        self._gate.measured(
            self.host.steady_time(), seconds(message.header.stamp), message.name, message.effort
        )

    def _command(self, message: Any) -> None:
        if not self.host.active:
            return
        stamp = message.header.stamp
        now = self.host.steady_time()
        if self._gate.command(now, seconds(stamp), message.name, message.effort):
            self._newest_stamp = stamp
            self._publish(stamp)
        self._report(now)

    def _stop_by_topic(self, message: Any) -> None:
        self._stop(StopSource.TOPIC, message.data)

    def _stop_by_service(self, request: Any, response: Any) -> Any:
        self._stop(StopSource.SERVICE, request.data)
        response.success = True
        response.message = self._gate.reason
        return response

    def _stop(self, source: StopSource, stop: bool) -> None:
        self._gate.emergency_stop(source, stop)
        self._stopped_by = frozenset(self._gate.stopped_by)
        if self.host.active:
            self._watch()

    def _watch(self) -> None:
        now = self.host.steady_time()
        if self._gate.step(now):
            self._publish(self._newest_stamp)
        self._report(now)

    def _publish(self, stamp: Any) -> None:
        efforts = self._efforts
        for j, torque in enumerate(self._gate.output):
            efforts[j] = torque
        self._output.header.stamp = stamp
        self._publisher.publish(self._output)

    def _report(self, now: float) -> None:
        """Report a worse state or a recovery at once, other changes once a second.

        Limits and single invalid commands may change with every message, too often for
        /diagnostics.
        """
        gate = self._gate
        level = WARN if gate.limiting else LEVELS[gate.state]
        worse = level > self._reported_level or (
            gate.state is State.HOLDING and self._reported_state is State.PASSING
        )
        recovered = gate.state is State.PASSING and self._reported_state not in (
            State.PASSING,
            State.HOLDING,
        )
        if worse or recovered or now - self._reported_at >= REPORT_PERIOD:
            self._reported_state, self._reported_level, self._reported_at = gate.state, level, now
            self.host.set_diagnostic(
                level,
                gate.reason,
                gate=gate.state.value,
                torque=[round(torque, 1) for torque in gate.output],
                timeouts=gate.timeouts,
                **{f'limited_{cause}': count for cause, count in gate.limited.items()},
                **{f'rejected_{cause}': count for cause, count in gate.rejected.items()},
            )


def main() -> int:
    """Run the node."""
    from traction_node.run import run

    return run(TorqueGateBehaviour)
