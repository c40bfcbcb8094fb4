"""What the node `torque_gate` does: `wheel_torque_command` in, limited `wheel_torque` out.

A behaviour runs in a ROS 2 process or in lock step, see `traction_evaluation.replay.lockstep`.
"""

from torque_gate.gate import WATCHDOG_PERIOD, State, StopSource, TorqueGate
from traction_node.behaviour import Behaviour
from traction_node.diagnostic import ERROR, OK, WARN
from traction_node.parameter import NodeParameter
from traction_node.stamp import seconds

TELL_PERIOD = 1.0
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
    """Last node before the hardware; see `torque_gate.gate` for what it checks."""

    NAME = 'torque_gate'
    LIFECYCLE = True
    PARAMETERS = (
        NodeParameter(
            'wheel_names',
            default=['fl', 'fr', 'rl', 'rr'],
            description='wheels that every command must name, and the order of the lists below',
            read_only=True,
        ),
        NodeParameter(
            'min_torque',
            default=[-3000.0],
            description='least torque per wheel, or one for all',
            unit='N·m',
            read_only=True,
        ),
        NodeParameter(
            'max_torque',
            default=[8000.0],
            description='most torque per wheel, or one for all',
            unit='N·m',
            read_only=True,
        ),
        NodeParameter(
            'max_rate',
            default=[30000.0],
            description='fastest change of torque per wheel, or one for all',
            unit='N·m/s',
            minimum=1.0,
            read_only=True,
        ),
        NodeParameter(
            'timeout',
            default=0.1,
            description='time that the last good command holds',
            unit='s',
            minimum=0.01,
            maximum=0.19,
            read_only=True,
        ),
        NodeParameter(
            'release_time',
            default=0.06,
            description='time to go from there to the safe torque',
            unit='s',
            minimum=0.0,
            maximum=0.18,
            read_only=True,
        ),
        NodeParameter(
            'max_age',
            default=0.2,
            description=(
                'a command this much older by its stamp than the newest wheel states is stale'
            ),
            unit='s',
            minimum=0.01,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'safe_torque',
            default=0.0,
            description='torque of every wheel without command',
            unit='N·m',
            read_only=True,
        ),
    )

    # Who holds an emergency stop outlives the gate that is built anew.
    _stopped_by = frozenset()

    def check_parameters(self, p):
        """Refuse limits that do not fit the wheels or each other."""
        _make_gate(p)

    def configure(self):
        """Build the gate; measured torques are followed from here on."""
        self._gate = _make_gate(self.host.p)
        for source in self._stopped_by:
            self._gate.emergency_stop(source, True)
        self._output = self.host.message('wheel_torque')
        self._output.name = list(self.host.p.wheel_names)
        self._output.header.frame_id = 'base_link'
        self._output.effort = self._gate.output
        self._efforts = self._output.effort
        # None has come: zero.
        self._newest_stamp = self.host.message('wheel_torque').header.stamp
        self._publisher = self.host.publisher('wheel_torque')
        self.host.subscription('wheel_states', self._measured)
        self.host.subscription('wheel_torque_command', self._command)
        self.host.subscription('emergency_stop', self._stop_by_topic)
        self.host.service('emergency_stop', 'std_srvs/srv/SetBool', self._stop_by_service)
        self._told_state = None
        self._told_level = OK
        self._told_at = 0.0

    def activate(self):
        """Begin to pass commands, and to put out the safe torque without them."""
        self._told_state = None
        self.host.steady_timer(WATCHDOG_PERIOD, self._watch)

    def deactivate(self):
        """Leave the wheels at the safe torque."""
        self._gate.release()
        self._publish(self._newest_stamp)

    def _measured(self, message):
        self._newest_stamp = message.header.stamp
        self._gate.measured(
            self.host.steady_time(), seconds(message.header.stamp), message.name, message.effort
        )

    def _command(self, message):
        if not self.host.active:
            return
        stamp = message.header.stamp
        now = self.host.steady_time()
        if self._gate.command(now, seconds(stamp), message.name, message.effort):
            self._newest_stamp = stamp
            self._publish(stamp)
        self._tell(now)

    def _stop_by_topic(self, message):
        self._stop(StopSource.TOPIC, message.data)

    def _stop_by_service(self, request, response):
        self._stop(StopSource.SERVICE, request.data)
        response.success = True
        response.message = self._gate.reason
        return response

    def _stop(self, source, stop):
        self._gate.emergency_stop(source, stop)
        self._stopped_by = frozenset(self._gate.stopped_by)
        if self.host.active:
            self._watch()

    def _watch(self):
        now = self.host.steady_time()
        if self._gate.step(now):
            self._publish(self._newest_stamp)
        self._tell(now)

    def _publish(self, stamp):
        efforts = self._efforts
        for j, torque in enumerate(self._gate.output):
            efforts[j] = torque
        self._output.header.stamp = stamp
        self._publisher.publish(self._output)

    def _tell(self, now):
        """Report what is new and bad, or good again, at once; the rest once a second.

        Limits and single bad commands may come and go with every message, which would
        flood /diagnostics.
        """
        gate = self._gate
        level = WARN if gate.limiting else LEVELS[gate.state]
        worse = level > self._told_level or (
            gate.state is State.HOLDING and self._told_state is State.PASSING
        )
        recovered = gate.state is State.PASSING and self._told_state not in (
            State.PASSING,
            State.HOLDING,
        )
        if worse or recovered or now - self._told_at >= TELL_PERIOD:
            self._told_state, self._told_level, self._told_at = gate.state, level, now
            self.host.set_diagnostic(
                level,
                gate.reason,
                gate=gate.state.value,
                torque=[round(torque, 1) for torque in gate.output],
                timeouts=gate.timeouts,
                **{f'limited_{cause}': count for cause, count in gate.limited.items()},
                **{f'rejected_{cause}': count for cause, count in gate.rejected.items()},
            )


def _make_gate(p):
    n = len(p.wheel_names)
    limits = [
        values * n if len(values) == 1 else values
        for values in (p.min_torque, p.max_torque, p.max_rate)
    ]
    return TorqueGate(p.wheel_names, *limits, p.timeout, p.release_time, p.safe_torque, p.max_age)


def main():
    """Run the node."""
    from traction_node.run import run

    return run(TorqueGateBehaviour)
