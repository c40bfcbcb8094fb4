"""Torque gate as a process: commands, torques and diagnostics."""

import math
import time

import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from traction_node.probe import NodeProcess, Probe, executable
from traction_node.stamp import seconds

WHEELS = ['fl', 'fr']
PARAMETERS = {
    'wheel_names': WHEELS,
    'min_torque': [-1000.0],
    'max_torque': [2000.0],
    'max_rate': [20000.0],
    'autostart': True,
}


class Gate:
    """Gate with a publisher of commands and a subscriber of torques."""

    def __init__(self, probe):
        self.probe = probe
        # When each torque was published, s of the system's clock.
        self.sent = []
        self.torques = probe.subscribe('wheel_torque', sent=self.sent)
        self.stamp = 100.0
        self.publisher = probe.publisher('wheel_torque_command')
        probe.wait_for(lambda: self.torques, 'safe torque at start')

    def command(self, efforts, names=WHEELS, stamp=None):
        self.stamp += 0.01
        message = JointState(name=names, effort=efforts)
        message.header.stamp.sec = int(self.stamp if stamp is None else stamp)
        message.header.stamp.nanosec = round(self.stamp % 1 * 1e9) if stamp is None else 0
        self.publisher.publish(message)

    def drive(self, efforts, until, what):
        """Command every 10 ms until a condition holds."""
        timer = self.probe.node.create_timer(0.01, lambda: self.command(efforts))
        try:
            return self.probe.wait_for(until, what)
        finally:
            self.probe.node.destroy_timer(timer)

    @property
    def efforts(self):
        return list(self.torques[-1].effort)


@pytest.fixture
def gate():
    with (
        NodeProcess(executable('torque_gate', 'torque_gate'), params=PARAMETERS) as process,
        Probe() as probe,
    ):
        probe.diagnostics('torque_gate')
        found = Gate(probe)
        found.process = process
        yield found


def test_passes_commands_then_goes_to_the_safe_torque_and_recovers(gate):
    assert gate.efforts == [0.0, 0.0]
    gate.drive([500.0, -400.0], lambda: gate.efforts == [500.0, -400.0], 'the commanded torques')
    assert gate.torques[-1].name == WHEELS
    assert 100.0 < seconds(gate.torques[-1].header.stamp) <= gate.stamp
    stopped = time.time()
    first = len(gate.torques)
    gate.probe.wait_for(lambda: gate.efforts == [0.0, 0.0], 'the safe torque')
    safe = next(
        k for k in range(first, len(gate.torques)) if list(gate.torques[k].effort) == [0.0, 0.0]
    )
    # The limit is 0.2 s; the rest is the time that a process waits for a core.
    assert gate.sent[safe] - stopped < 0.3
    status = gate.probe.wait_for_diagnostic('torque_gate', 'no good command for 0.1 s')
    assert status.level == b'\x02'
    gate.drive([500.0, -400.0], lambda: gate.efforts == [500.0, -400.0], 'recovery')
    gate.drive(
        [500.0, -400.0],
        lambda: gate.probe.diagnostics('torque_gate')[-1].message == 'passing commands',
        'recovery in /diagnostics',
    )


def test_bad_commands_are_told_and_not_passed(gate):
    gate.drive([500.0, 500.0], lambda: gate.efforts == [500.0, 500.0], 'the commanded torques')
    gate.command([math.nan, 0.0])
    gate.probe.wait_for_diagnostic('torque_gate', "torque of joint 'fl' is nan")
    status = gate.probe.diagnostics('torque_gate')[-1]
    assert {v.key: v.value for v in status.values}['rejected_not_finite'] == '1'
    for torque in gate.torques:
        assert all(0.0 <= effort <= 500.0 for effort in torque.effort)


def test_limits_are_told(gate):
    gate.drive([9000.0, 100.0], lambda: gate.efforts == [2000.0, 100.0], 'the most torque')
    gate.drive(
        [9000.0, 100.0],
        lambda: any(
            s.message == 'limited: fl 9000.0 N·m to 2000.0 N·m, most allowed'
            for s in gate.probe.diagnostics('torque_gate')
        ),
        'the limit in /diagnostics',
    )


def test_starts_from_the_measured_torque(gate):
    states = gate.probe.publisher('wheel_states')

    def drive():
        states.publish(JointState(name=WHEELS, velocity=[1.0, 1.0], effort=[700.0, 0.0]))
        gate.command([1500.0, 0.0])

    timer = gate.probe.node.create_timer(0.01, drive)
    gate.probe.wait_for(lambda: gate.efforts == [1500.0, 0.0], 'the commanded torque')
    gate.probe.node.destroy_timer(timer)
    # From the measured torque on by at most 20 000 N·m/s; without it, it would start at 0.
    first = next(t.effort[0] for t in gate.torques if t.effort[0] > 0.0)
    assert first >= 700.0


def test_the_last_torque_is_safe_on_deactivation_and_on_ctrl_c(gate):
    gate.drive([500.0, 500.0], lambda: gate.efforts == [500.0, 500.0], 'the commanded torques')
    assert gate.probe.change_state('torque_gate', 'deactivate')
    gate.probe.wait_for(lambda: gate.efforts == [0.0, 0.0], 'the safe torque')
    assert gate.probe.change_state('torque_gate', 'activate')
    gate.drive([500.0, 500.0], lambda: gate.efforts == [500.0, 500.0], 'the commanded torques')
    assert gate.process.interrupt() == 0
    gate.probe.wait_for(lambda: gate.efforts == [0.0, 0.0], 'the safe torque')


def test_emergency_stop_by_service_and_by_topic(gate):
    gate.drive([500.0, 500.0], lambda: gate.efforts == [500.0, 500.0], 'the commanded torques')
    service = 'torque_gate/emergency_stop'
    answer = gate.probe.call(SetBool, service, SetBool.Request(data=True))
    assert answer.success
    assert answer.message == 'emergency stop: at 0 N·m until released by service'
    gate.probe.wait_for(lambda: gate.efforts == [0.0, 0.0], 'the safe torque')
    # A new configuration keeps the stop: no command passes.
    for transition in ('deactivate', 'cleanup', 'configure', 'activate'):
        assert gate.probe.change_state('torque_gate', transition)
    heard = len(gate.torques)
    gate.drive([500.0, 500.0], lambda: len(gate.torques) > heard + 20, 'torques')
    assert all(list(t.effort) == [0.0, 0.0] for t in gate.torques[heard:])
    topic = gate.probe.publisher('emergency_stop')
    topic.publish(Bool(data=True))
    gate.probe.wait_for_diagnostic('torque_gate', 'until released by service and topic')
    gate.probe.call(SetBool, service, SetBool.Request(data=False))
    heard = len(gate.torques)
    gate.drive([500.0, 500.0], lambda: len(gate.torques) > heard + 20, 'torques')
    assert all(list(t.effort) == [0.0, 0.0] for t in gate.torques[heard:])
    topic.publish(Bool(data=False))
    gate.drive([500.0, 500.0], lambda: gate.efforts == [500.0, 500.0], 'torque after release')


def test_inconsistent_parameters_are_refused():
    parameters = PARAMETERS | {'max_torque': [1000.0, 2000.0, 3000.0]}
    with NodeProcess(executable('torque_gate', 'torque_gate'), params=parameters) as process:
        assert process.wait() == 2
    assert 'torque_gate: max_torque has 3 entries for 2 wheels' in process.output
