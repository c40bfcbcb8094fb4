"""The whole suite as processes over DDS: rates, faults, recovery."""

import math
import time

import numpy as np
import pytest

from traction_bringup.system import system
from traction_node.probe import NodeProcess, executable
from traction_node.running_system import RunningSystem
from traction_node.topics import topics

TOPICS = topics()
# Publishers in a running simulation, which has no satellite receiver.
SPEAKERS = {'plant', 'all', *(node.name for node in system(simulated=True))}
# Their topics, except those of faults and operators.
RATES = {
    name: row.rate
    for name, row in TOPICS.items()
    if row.rate > 0 and SPEAKERS & set(row.source.split(', '))
}


@pytest.fixture(scope='module')
def running():
    """Driving simulated tractor with a light draft, for a fast start."""
    nodes = system(
        simulated=True,
        parameters={
            'plant_node': {'drawbar_pull': 2000.0, 'soil_starts': [0.0, 1e6]},
            'drive_cycle': {'ramp': 1.0},
            'slip_controller': {'slip_target': 0.12},
        },
    )
    with RunningSystem(nodes) as system_under_test:
        truth = system_under_test.probe.subscribe('ground_truth/odometry')
        system_under_test.probe.wait_for(
            lambda: truth and truth[-1].twist.twist.linear.x > 0.5, 'motion'
        )
        yield system_under_test


def test_every_topic_comes_at_its_rate(running):
    sent = {name: [] for name in RATES}
    for name, times in sent.items():
        running.probe.subscribe(name, sent=times)
    # Every subscription is matched once each topic has spoken; only then is counted.
    running.probe.wait_for(lambda: all(sent.values()), 'message on every topic')
    begin = {name: times[-1] for name, times in sent.items()}
    # 4 s by the times at which messages were published, however late they are heard.
    running.probe.wait_for(
        lambda: all(times[-1] >= begin[name] + 4.0 for name, times in sent.items()), '4 s'
    )
    for name, times in sent.items():
        # /diagnostics: one message a second from each of the running nodes.
        nodes = len(running.processes) if name == '/diagnostics' else 1
        # radar: the plant's parameter file sets 20 Hz, within the 10 to 50 Hz of the table.
        expected = 20.0 if name == 'radar' else RATES[name] * nodes
        end = begin[name] + 4.0
        count = sum(begin[name] < time <= end for time in times)
        # One message of each node more or less, and 15 %.
        least, most = (f * 4.0 * expected for f in (0.85, 1.15))
        assert count >= least - nodes - 1, name
        # A new diagnostic is published at once, besides.
        assert count <= most + nodes + 1 or name == '/diagnostics', name


def test_what_each_node_says_fits_together(running):
    probe = running.probe
    estimates = probe.subscribe('slip_estimate')
    truths = probe.subscribe('ground_truth/slip_estimate')
    states = probe.subscribe('controller_state')
    torques = probe.subscribe('wheel_torque')
    probe.wait_for(lambda: len(estimates) > 100, 'a hundred estimates')
    by_stamp = {(m.header.stamp.sec, m.header.stamp.nanosec): m for m in truths}
    pairs = [
        (m, by_stamp[key])
        for m in estimates
        if (key := (m.header.stamp.sec, m.header.stamp.nanosec)) in by_stamp
    ]
    assert len(pairs) > 50
    # Estimates carry the stamp of the reading they answer, so they compare one to one. The
    # noise of the radar, 0.05 m/s at about 2 m/s, alone would be 0.025 of slip.
    errors = [abs(a - b) for m, t in pairs for a, b in zip(m.slip, t.slip, strict=True)]
    assert sum(errors) / len(errors) < 0.025
    assert all(m.valid == [True] * 4 for m, _ in pairs)
    state = states[-1]
    assert state.mode == state.MODE_LIMIT
    for command, request in zip(state.torque_command, state.torque_request, strict=True):
        assert 0.0 <= command <= request
    # What the gate lets through is what the controller sent: nothing here is out of bounds. Only
    # where two commands arrive closer than they were sent may its rate cut some of a quick change,
    # which on a busy machine happens more often.
    sent = {(s.header.stamp.sec, s.header.stamp.nanosec): s for s in states}
    passed = [
        (t, sent[key])
        for t in torques
        if (key := (t.header.stamp.sec, t.header.stamp.nanosec)) in sent
    ]
    off = [np.abs(np.subtract(t.effort, state.torque_command)).max() for t, state in passed]
    assert np.median(off) < 1e-6
    said = {value.key: value.value for value in probe.diagnostics('torque_gate')[-1].values}
    assert said['limited_magnitude'] == '0'
    # One period at the fastest change of any wheel, 40 kN·m/s; more after a gap of 0.1 s between
    # commands, where the gate takes the torque away.
    assert np.percentile(off, 95) < 400.0


def test_parameters_change_at_run_time_or_are_refused_with_a_reason(running):
    probe = running.probe
    assert probe.set_parameter('slip_controller', 'slip_target', 0.15) == ''
    assert 'slip_target' in probe.set_parameter('slip_controller', 'slip_target', 1.5)
    assert 'limit, hold' in probe.set_parameter('slip_controller', 'mode', 'race')
    assert 'vehicle' in probe.set_parameter('slip_estimator', 'vehicle', 'bicycle')
    states = probe.subscribe('controller_state')
    probe.wait_for(lambda: any(s.slip_target == 0.15 for s in states), 'state with the new target')


def test_lifecycle_by_service_stops_and_restarts_the_drive(running):
    probe = running.probe
    torques = probe.subscribe('wheel_torque')
    probe.wait_for(lambda: torques and max(torques[-1].effort) > 100.0, 'torque')
    assert probe.change_state('slip_controller', 'deactivate')
    assert probe.state('slip_controller') == 'inactive'
    probe.wait_for(lambda: list(torques[-1].effort) == [0.0] * 4, 'safe torque')
    assert not probe.change_state('slip_controller', 'deactivate')
    assert probe.change_state('slip_controller', 'cleanup')
    assert probe.change_state('slip_controller', 'configure')
    assert probe.change_state('slip_controller', 'activate')
    probe.wait_for(lambda: max(torques[-1].effort) > 100.0, 'torque again')


def test_a_killed_estimator_stops_the_tractor_and_a_new_one_lets_it_drive_on(running):
    probe = running.probe
    torques, sent = [], []
    probe.subscribe('wheel_torque', lambda m: torques.append((sent.pop(), list(m.effort))), sent)
    probe.wait_for(lambda: torques and max(torques[-1][1]) > 100.0, 'torque')

    running.processes.pop('slip_estimator').kill()
    killed = time.time()
    torques.clear()
    probe.wait_for(lambda: torques and torques[-1][1] == [0.0] * 4, 'safe torque')
    # The gate promises 0.2 s after the last good command, by the time at which it published. The
    # rest is what nodes wait for a core.
    reached = next(t for t, effort in torques if effort == [0.0] * 4)
    assert reached - killed < 0.2 + 0.2
    said = probe.wait_for_diagnostic('torque_gate', 'no good command')
    assert int.from_bytes(said.level) > 0
    # Nothing but zero from here on.
    probe.run_for(0.5)
    zero_from = next(k for k, (_, effort) in enumerate(torques) if effort == [0.0] * 4)
    assert all(effort == [0.0] * 4 for _, effort in torques[zero_from:])

    spec = next(n for n in system(simulated=True) if n.name == 'slip_estimator')
    with NodeProcess(
        executable(spec.package, spec.executable),
        params=dict(spec.parameters),
        params_files=spec.parameter_files,
    ):
        probe.wait_for(lambda: max(torques[-1][1]) > 100.0, 'torque again')
        probe.wait_for(
            lambda: (
                'passing' in probe.diagnostics('torque_gate')[-1].message
                or 'limited' in probe.diagnostics('torque_gate')[-1].message
            ),
            'recovery in the diagnostics of the gate',
        )


def test_a_request_that_stops_takes_the_torque_away(running):
    """Last: it ends the drive cycle. The estimator of the test before is gone by then."""
    probe = running.probe
    torques = probe.subscribe('wheel_torque')
    spec = next(n for n in system(simulated=True) if n.name == 'slip_estimator')
    with NodeProcess(
        executable(spec.package, spec.executable),
        params=dict(spec.parameters),
        params_files=spec.parameter_files,
    ):
        probe.wait_for(lambda: torques and max(torques[-1].effort) > 100.0, 'torque')
        assert running.processes['drive_cycle'].interrupt() == 0
        probe.wait_for(lambda: list(torques[-1].effort) == [0.0] * 4, 'no torque')
        probe.wait_for_diagnostic('slip_controller', 'no torque_request')
        assert all(math.isfinite(v) for v in torques[-1].effort)
