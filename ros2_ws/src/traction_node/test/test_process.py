"""Nodes as real processes: start, parameters, lifecycle, diagnostics, end."""

import itertools
import os
import signal
import statistics
import sys
from pathlib import Path

import pytest
from geometry_msgs.msg import TwistWithCovarianceStamped
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock

from traction_node import diagnostic
from traction_node.probe import NodeProcess, Probe, executable
from traction_node.stamp import seconds, to_stamp

SAMPLE_NODES = Path(__file__).with_name('sample_nodes.py')


def sample(**ros):
    return NodeProcess(sys.executable, str(SAMPLE_NODES), 'Sample', **ros)


def ticker(**ros):
    return NodeProcess(sys.executable, str(SAMPLE_NODES), 'Ticker', **ros)


@pytest.fixture
def probe():
    with Probe() as probe:
        yield probe


@pytest.mark.parametrize('end', [NodeProcess.interrupt, NodeProcess.terminate])
def test_signal_ends_an_active_node_cleanly(probe, end):
    targets = probe.subscribe('slip_target')
    with sample(params={'autostart': True}) as node:
        probe.wait_for(lambda: targets, 'slip_target')
        assert targets[0].data == 0.2
        assert end(node) == 0
        # Deactivated on the way out, while the topic still carried its last word.
        probe.wait_for(lambda: targets[-1].data == 0.0, 'last slip_target')
        assert node.output.count('cleaned up') == 1
        assert 'Traceback' not in node.output


def test_no_shared_memory_in_which_a_killed_node_could_stall_others(probe):
    with sample() as node:
        assert probe.state('sample') == 'unconfigured'
        for process in (node.pid, os.getpid()):
            threads = {path.read_text() for path in Path(f'/proc/{process}/task').glob('*/comm')}
            assert any(name.startswith('dds.udp') for name in threads)
            assert not any(name.startswith('dds.shm') for name in threads)


def test_signal_ends_an_unconfigured_node_cleanly(probe):
    with sample() as node:
        assert probe.state('sample') == 'unconfigured'
        assert node.interrupt() == 0
        # The middleware may log a response that it could not deliver.
        assert 'Traceback' not in node.output


@pytest.mark.parametrize(
    ('params', 'reason'),
    [
        ({'slp': 0.1}, 'there is no parameter "slp"; did you mean "slip"?'),
        ({'slip': 'a'}, 'parameter "slip" = \'a\' should be a number'),
        ({'slip': 1.5}, 'parameter "slip" = 1.5 is out of range: 0 .. 1'),
        ({'slip': 0.6}, 'slip = 0.6 exceeds slip_max = 0.5'),
        ({'mode': 'hodl'}, 'parameter "mode" = \'hodl\' is not one of limit, hold'),
        (
            {'radius': [0.5, 3.0]},
            'parameter "radius" = [0.5, 3.0] m is out of range: 0.1 .. 2 m',
        ),
    ],
)
def test_bad_parameter_ends_the_start_with_one_line(params, reason):
    with sample(params=params) as node:
        assert node.wait() == 2
        assert node.output == f'sample: {reason}\n'


def test_parameter_file_is_checked_like_the_command_line(tmp_path):
    path = tmp_path / 'sample.yaml'
    path.write_text('sample:\n  ros__parameters:\n    slip: 2\n')
    with sample(params_files=[path]) as node:
        assert node.wait() == 2
        assert node.output == (
            f'sample: {path}: /sample: parameter "slip" = 2 is out of range: 0 .. 1\n'
        )
    with sample(params_files=[tmp_path / 'absent.yaml']) as node:
        assert node.wait() == 2
        assert node.output == f'sample: {tmp_path}/absent.yaml: No such file or directory\n'


def test_parameter_file_of_a_whole_robot(tmp_path):
    shared, own = tmp_path / 'shared.yaml', tmp_path / 'own.yaml'
    shared.write_text(
        '/**:\n  ros__parameters: {use_sim_time: true, machine_id: blue, slip: 3e-1}\n'
        'ekf_filter_node:\n  ros__parameters: {frequency: 30.0}\n'
    )
    own.write_text(
        'field:\n  sample:\n    ros__parameters: {slip_max: 4e-1, radius: [6e-1, 1]}\n'
        'yard:\n  sample:\n    ros__parameters: {slip_max: 0.9}\n'
    )
    files = [shared, own]
    with sample(params_files=files, params={'mode': 'hold'}, namespace='field') as node:
        with Probe('field') as probe:
            request = GetParameters.Request(
                names=['slip', 'slip_max', 'radius', 'mode', 'use_sim_time']
            )
            values = probe.call(GetParameters, 'sample/get_parameters', request).values
        slip, slip_max, radius, mode, simulated = map(parameter_value_to_python, values)
        assert (slip, slip_max, mode, simulated) == (0.3, 0.4, 'hold', True)
        assert list(radius) == [0.6, 1.0]
        assert node.interrupt() == 0


def test_unknown_argument_is_refused():
    with NodeProcess(sys.executable, str(SAMPLE_NODES), 'Sample', '--slip=0.1') as node:
        assert node.wait() == 2
        assert node.output.startswith('sample: unknown argument "--slip=0.1"')


def test_lifecycle_by_service_calls(probe):
    targets = probe.subscribe('slip_target')
    with sample() as node:
        assert probe.state('sample') == 'unconfigured'
        assert probe.change_state('sample', 'configure')
        assert probe.state('sample') == 'inactive'
        assert probe.change_state('sample', 'activate')
        probe.wait_for(lambda: targets, 'slip_target while active')
        assert probe.change_state('sample', 'deactivate')
        probe.wait_for(lambda: targets[-1].data == 0.0, 'last slip_target')
        count = len(targets)
        probe.run_for(0.2)  # ten periods of the timer
        assert len(targets) == count
        assert probe.change_state('sample', 'activate')
        probe.wait_for(lambda: len(targets) > count, 'slip_target after reactivation')
        assert probe.change_state('sample', 'deactivate')
        assert probe.change_state('sample', 'cleanup')
        assert probe.state('sample') == 'unconfigured'
        probe.wait_for(
            lambda: not probe.node.count_publishers('slip_target'), 'end of the publisher'
        )
        assert probe.change_state('sample', 'configure')
        assert probe.change_state('sample', 'shutdown')
        assert probe.state('sample') == 'finalized'
        # Once it has ended, all that it printed has come.
        assert node.interrupt() == 0
        assert node.output.count('cleaned up') == 2


def test_impossible_transition_is_refused_and_the_node_lives_on(probe):
    with sample() as node:
        assert not probe.change_state('sample', 'activate')
        request = ChangeState.Request()
        request.transition.id = 3  # activate, by number
        assert not probe.call(ChangeState, 'sample/change_state', request).success
        node.wait_for_output('refused: not possible when unconfigured')
        assert probe.change_state('sample', 'configure')


@pytest.mark.parametrize(
    ('fail_in', 'states', 'message'),
    [
        ('configure', 'unconfigured', 'configure refused: no such calibration'),
        (
            'configure with a defect',
            'unconfigured',
            "configure failed: RuntimeError('a defect')",
        ),
        ('activate', 'inactive', 'activate refused: no radar'),
    ],
)
def test_refused_start_shows_its_reason_and_can_be_mended(probe, fail_in, states, message):
    probe.diagnostics('sample')
    with sample(params={'autostart': True, 'fail_in': fail_in}) as node:
        status = probe.wait_for_diagnostic('sample', message)
        assert status.level == bytes([diagnostic.ERROR])
        assert probe.state('sample') == states
        node.wait_for_output('RuntimeError: a defect' if 'defect' in fail_in else message)
        assert probe.set_parameter('sample', 'fail_in', '') == ''
        if states == 'unconfigured':
            assert probe.change_state('sample', 'configure')
        assert probe.change_state('sample', 'activate')
        probe.wait_for_diagnostic('sample', 'active')


def test_diagnostics_come_once_a_second_and_at_once_when_new(probe):
    arrays = probe.subscribe('/diagnostics')
    with sample(namespace='field', params={'autostart': True}), Probe('field') as field:

        def first(message):
            """Number of the first report with a message."""
            found = [k for k, a in enumerate(arrays) if a.status[0].message == message]
            return found[:1]

        [begin] = probe.wait_for(lambda: first('active'), 'report of the activation')
        radar = TwistWithCovarianceStamped()
        radar.twist.twist.linear.x = 2.5
        publisher = field.publisher('radar')
        probe.wait_for(lambda: len(arrays) > begin + 3, 'three reports')
        publisher.publish(radar)
        [new] = probe.wait_for(lambda: first('radar heard'), 'report of the radar')
        [status] = arrays[new].status
        assert status.level == bytes([diagnostic.WARN])
        values = {pair.key: pair.value for pair in status.values}
        assert values == {'state': 'active', 'speed': '2.5'}
        probe.wait_for(lambda: len(arrays) > new + 2, 'further reports')
    times = [seconds(array.header.stamp) for array in arrays]
    by_timer = [t for k, t in enumerate(times) if begin < k != new]
    periods = [after - before for before, after in itertools.pairwise(by_timer)]
    # All others are 1 s apart, as if there had not been the new one: it came besides, at once. One
    # that is late does not shift the next.
    assert sum(periods) == pytest.approx(len(periods), abs=0.5)
    assert statistics.median(periods) == pytest.approx(1.0, abs=0.1)


def test_parameters_at_run_time(probe):
    with sample() as node:
        assert probe.set_parameter('sample', 'slip', 0.4) == ''
        node.wait_for_output('slip is now 0.4')
        assert probe.set_parameter('sample', 'slip', 0) == ''  # an integer will do
        node.wait_for_output('slip is now 0\n')
        reason = probe.set_parameter('sample', 'slip', 1.5)
        assert reason == 'parameter "slip" = 1.5 is out of range: 0 .. 1'
        reason = probe.set_parameter('sample', 'slip_max', -0.5)
        assert reason == 'parameter "slip_max" = -0.5 is out of range: 0 .. 1'
        assert probe.set_parameter('sample', 'slip', 0.5) == ''
        reason = probe.set_parameter('sample', 'slip_max', 0.1)
        assert reason == 'slip = 0.5 exceeds slip_max = 0.1'
        reason = probe.set_parameter('sample', 'slip', 'fast')
        assert reason == 'parameter "slip" = \'fast\' should be a number'
        reason = probe.set_parameter('sample', 'wheel_names', ['a'])
        assert reason == 'parameter "wheel_names" cannot change while the node runs'
        assert 'slp' in probe.set_parameter('sample', 'slp', 0.1)
        assert node.interrupt() == 0


def test_defect_in_a_callback_ends_the_node_with_its_traceback(probe):
    targets = probe.subscribe('slip_target')
    with sample(params={'autostart': True}) as node:
        probe.wait_for(lambda: targets, 'slip_target')
        radar = TwistWithCovarianceStamped()
        radar.twist.twist.linear.x = -1.0
        # Best effort, and yet the first message is heard: the publisher has met its subscriber.
        probe.publisher('radar').publish(radar)
        probe.wait_for(lambda: not node.running, 'end of the node')
        assert node.wait() == 1
        assert 'RuntimeError: a defect in a callback' in node.output
        # Even so, its last word was the safe one.
        probe.wait_for(lambda: targets[-1].data == 0.0, 'last slip_target')


def test_kill_leaves_nothing_that_hinders_a_restart(probe):
    targets = probe.subscribe('slip_target')
    for _ in range(2):
        targets.clear()
        with sample(params={'autostart': True}) as node:
            probe.wait_for(lambda: targets, 'slip_target')
            assert node.kill() == -signal.SIGKILL


def test_plain_node_ends_by_itself():
    with ticker(params={'ticks': 2}) as node:
        assert node.wait() == 0
        assert node.output.split('\n')[0] == 'started'
        assert node.output.count('tick') == 2
        assert node.output.endswith('stopped\n')
    with ticker(params={'ticks': 1, 'complaint': 'the bag ends early'}) as node:
        assert node.wait() == 1
        assert node.output.endswith('stopped\nticker: the bag ends early\n')


def test_plain_node_that_refuses_to_start():
    with ticker(params={'ticks': 13}) as node:
        assert node.wait() == 2
        assert node.output == 'ticker: 13 brings bad luck\n'


def test_timers_of_ros_time_follow_the_simulated_clock(probe):
    with ticker(params={'ticks': 3, 'use_sim_time': True}) as node:
        node.wait_for_output('started')
        publisher = probe.node.create_publisher(Clock, '/clock', QoSProfile(depth=1))
        probe.wait_for(publisher.get_subscription_count, 'subscriber of /clock')
        probe.run_for(0.3)  # three periods
        assert 'tick' not in node.output
        clock = Clock()
        # From 0, which stands for "no time yet", the first message is already a period later.
        for step in range(1, 4):
            to_stamp(clock.clock, 100.0 + 0.1 * step)
            tick = f'tick {step} at {100.0 + 0.1 * step:.1f}'

            def told_and_ticked(tick=tick):
                # The same time again makes no further tick; a lost message makes none at all.
                publisher.publish(clock)
                return tick in node.output

            probe.wait_for(told_and_ticked, tick)
        assert node.wait() == 0


def test_executable_that_is_not_there_is_named():
    with pytest.raises(FileNotFoundError, match='traction_node has no executable drive'):
        executable('traction_node', 'drive')
