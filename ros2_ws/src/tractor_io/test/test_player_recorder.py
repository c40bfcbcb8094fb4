"""Player and recorder as processes: every played message is recorded."""

import itertools
import resource
import subprocess
import time
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
import yaml
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from traction_node.probe import NodeProcess, Probe, executable
from traction_node.quality_of_service import QOS
from traction_node.stamp import seconds
from tractor_io.bags.bag_error import BagError
from tractor_io.bags.message_types import typestore
from tractor_io.bags.reader import BagReader
from tractor_io.bags.repair import repair_bag
from tractor_io.bags.writer import BagWriter

BAGS = Path(__file__).resolve().parents[4] / 'bags'
DRAWBAR = BAGS / 'wheel_drawbar'
SOFT_PATCH = BAGS / 'tractor_soft_patch'
PLAYER = executable('tractor_io', 'bag_player')
RECORDER = executable('tractor_io', 'bag_recorder')


def by_topic(path):
    found = defaultdict(list)
    with BagReader(path) as bag:
        for m in bag.messages(raw=True):
            if m.topic != '/diagnostics':
                # The wire protocol pads messages to four bytes.
                found[m.topic].append(m.message + bytes(-len(m.message) % 4))
    return dict(found)


def recorded_count(probe):
    statuses = probe.diagnostics('bag_recorder')
    values = {v.key: v.value for v in statuses[-1].values} if statuses else {}
    return sum(int(n) for key, n in values.items() if key[0] == '/' and key != '/diagnostics')


def test_recorded_is_played_message_for_message(tmp_path):
    """At 5 times real time, through reliable and best-effort topics of a namespace.

    The queue of 1000 messages covers 2 s in which a recorder has no core.
    """
    output = tmp_path / 'copy'
    played = by_topic(DRAWBAR)
    with (
        Probe(namespace='/one') as probe,
        NodeProcess(
            RECORDER, params={'output': output, 'topics': list(played)}, namespace='one'
        ) as recorder,
    ):
        probe.wait_for(
            lambda: probe.diagnostics('one/bag_recorder'), 'sign of life of the recorder'
        )
        parameters = {
            'bag': DRAWBAR,
            'rate': 5.0,
            'topics': ['all', 'wheel_torque'],
            'wait_for_subscribers': 60.0,
        }
        with NodeProcess(PLAYER, params=parameters, namespace='one') as player:
            assert player.wait() == 0
        total = sum(map(len, played.values()))

        def complete():
            status = probe.diagnostics('one/bag_recorder')[-1]
            return {v.key: v.value for v in status.values}['messages'] == str(total)

        probe.wait_for(complete, f'{total} messages recorded')
        assert recorder.interrupt() == 0
    assert by_topic(output) == {f'/one{topic}': found for topic, found in played.items()}


def test_killed_recorder_loses_less_than_a_second(tmp_path):
    """All but 1 % of what was published until 1 s before the kill is in the repaired bag."""
    output = tmp_path / 'killed'
    with (
        Probe() as probe,
        NodeProcess(RECORDER, params={'output': output}) as recorder,
    ):
        probe.wait_for(lambda: probe.diagnostics('bag_recorder'), 'sign of life')
        sent = {name: [] for name in by_topic(SOFT_PATCH)}
        for name, times in sent.items():
            probe.subscribe(name.lstrip('/'), sent=times)
        parameters = {
            'bag': SOFT_PATCH, 'topics': ['all', 'wheel_torque'], 'wait_for_subscribers': 60.0,
        }  # fmt: skip
        with NodeProcess(PLAYER, params=parameters):
            probe.wait_for(lambda: recorded_count(probe) > 1000, '1000 messages recorded')
            killed = time.time()
            recorder.kill()
    with pytest.raises(BagError, match=r'not a bag, it has no metadata\.yaml'):
        BagReader(output)
    repaired = repair_bag(output)
    published = {name: sum(t <= killed - 1.0 for t in times) for name, times in sent.items()}
    assert sum(published.values()) > 500
    for topic, count in published.items():
        assert repaired.counts[topic] >= 0.99 * count


def test_bag_tells_versions_and_parameters_of_the_nodes(tmp_path):
    output = tmp_path / 'told'
    gate = executable('torque_gate', 'torque_gate')
    with (
        Probe(namespace='/one') as probe,
        NodeProcess(gate, params={'timeout': 0.07}, namespace='one'),
        NodeProcess(executable('tractor_io', 'can_bridge'), namespace='one'),
        NodeProcess(RECORDER, params={'output': output}, namespace='one') as recorder,
    ):

        def told():
            # Written at the start, so that the bag of a killed recorder has it.
            files = list(output.glob('*.mcap'))
            return files and b'parameters /one/torque_gate' in files[0].read_bytes()

        probe.wait_for(told, 'parameters of the gate in the bag')
        # The latest case: written when the bag is closed.
        changed = probe.set_parameter('can_bridge', 'front_engaged', False)
        assert changed == ''
        probe.run_for(0.2)
        assert recorder.interrupt() == 0
    with BagReader(output) as bag:
        said = yaml.safe_load(bag.custom_data['parameters /one/torque_gate'])
        assert said['timeout'] == 0.07
        assert said['wheel_names'] == ['fl', 'fr', 'rl', 'rr']
        [change] = yaml.safe_load(bag.custom_data['changed /one/can_bridge'])
        assert change.pop('time') == pytest.approx(time.time(), abs=60.0)
        assert change == {'front_engaged': False}
        assert bag.custom_data['version tractor_io'] == '0.1.0'
        assert {'version python', 'ros_distro'} <= set(bag.custom_data)


COMMANDS = ('torque_request', 'wheel_torque_command', 'wheel_torque')


def torque_bag(path, topics):
    """Write a bag with 20 messages on each of some topics of a tractor in a namespace."""
    state = typestore().types['sensor_msgs/msg/JointState']
    header = typestore().types['std_msgs/msg/Header']
    stamp = typestore().types['builtin_interfaces/msg/Time']
    none = np.empty(0)
    with BagWriter(path) as bag:
        for topic in topics:
            bag.add_topic(f'/tractor1/{topic}', state.__msgtype__, QOS['command'])
        for i in range(20):
            message = state(header(stamp(1, i), ''), ['fl'], none, none, np.array([9e3]))
            for topic in topics:
                bag.write(f'/tractor1/{topic}', 10**9 + i, message)
    return path


@pytest.mark.parametrize(
    ('topics', 'left_out'),
    [(['all'], COMMANDS), (['all', '/tractor1/wheel_torque'], COMMANDS[:2])],
)
def test_torques_play_only_when_named(tmp_path, topics, left_out):
    bag = torque_bag(tmp_path / 'bag', ('wheel_states', *COMMANDS))
    parameters = {'bag': bag, 'topics': topics, 'wait_for_subscribers': 60.0}
    with Probe(namespace='tractor1') as probe:
        received = {topic: probe.subscribe(topic) for topic in ('wheel_states', *COMMANDS)}
        with NodeProcess(PLAYER, params=parameters) as player:
            probe.wait_for(lambda: not player.running, 'end of the player')
            assert player.wait() == 0
    (line,) = player.output.splitlines()
    names = ', '.join(sorted(f'/tractor1/{topic}' for topic in left_out))
    assert line.endswith(f'not played unless named in "topics": {names}')
    assert {topic for topic, messages in received.items() if not messages} == set(left_out)


def test_a_bag_of_nothing_but_torques_says_what_to_name(tmp_path):
    bag = torque_bag(tmp_path / 'bag', ['wheel_torque'])
    with NodeProcess(PLAYER, params={'bag': bag}) as player:
        assert player.wait() == 2
    (line,) = player.output.splitlines()
    assert line.endswith(
        'nothing to play; not played unless named in "topics": /tractor1/wheel_torque'
    )


def test_player_keeps_time_and_publishes_the_clock():
    """0.5 s of bag at half the rate take 1 s, and /clock goes through the same 0.5 s."""
    parameters = {
        'bag': DRAWBAR,
        'rate': 0.5,
        'start_offset': 14.5,
        'clock': True,
        'topics': ['wheel_states'],
        'wait_for_subscribers': 60.0,
    }
    with Probe() as probe:
        sent, clock = [], []
        received = probe.subscribe('wheel_states', sent=sent)
        probe.node.create_subscription(Clock, '/clock', clock.append, 100)
        with NodeProcess(PLAYER, params=parameters) as player:
            probe.wait_for(lambda: len(received) == 51, 'the last message')
            assert player.wait() == 0
        probe.wait_for(lambda: clock and seconds(clock[-1].clock) == 16.0, 'the last clock')
    # Bags start at 1 s: 15.5 s to 16 s.
    stamps = [seconds(m.header.stamp) for m in received]
    assert stamps == pytest.approx([15.5 + 0.01 * i for i in range(51)])
    # One that is late does not shift the others.
    slope, _ = np.polyfit(stamps, np.subtract(sent, sent[0]), 1)
    # Slower only by what the player waits for a core.
    assert 1.8 < slope < 3.5
    times = [seconds(c.clock) for c in clock]
    assert times == sorted(times)


def test_player_loops_until_told_to_end():
    parameters = {'bag': DRAWBAR, 'loop': True, 'start_offset': 14.9, 'topics': ['wheel_states']}
    with Probe() as probe, NodeProcess(PLAYER, params=parameters) as player:
        received = probe.subscribe('wheel_states')
        probe.wait_for(lambda: len(received) > 30, 'third pass')  # 11 messages a pass
        assert player.terminate() == 0


@pytest.mark.parametrize(
    ('parameters', 'text'),
    [
        ({}, 'parameter "bag" must name a bag'),
        ({'bag': '/nowhere'}, '/nowhere: no such file or folder'),
        ({'bag': DRAWBAR, 'topics': ['sonar']}, 'no topic /sonar; it holds: /ground_truth/'),
        ({'bag': DRAWBAR, 'start_offset': 60.0}, 'is beyond the end'),
        ({'bag': DRAWBAR, 'start_offset': 15.0, 'loop': True}, 'nothing to loop from 15.0 s on'),
        ({'bag': DRAWBAR, 'rate': 0.0}, 'parameter "rate" = 0.0 is out of range'),
    ],
)
def test_player_refuses_bad_input_in_one_line(parameters, text):
    with NodeProcess(PLAYER, params=parameters) as player:
        assert player.wait() == 2
    (line,) = player.output.splitlines()
    assert line.startswith('bag_player: ')
    assert text in line


def test_recorder_refuses_bad_input_in_one_line(tmp_path):
    (tmp_path / 'there').mkdir()
    for parameters, text in (
        ({'output': tmp_path / 'there'}, 'there: exists already, not overwritten'),
        ({'output': tmp_path / 'new', 'topics': ['sonar']}, 'the suite has no topic sonar'),
    ):
        with NodeProcess(RECORDER, params=parameters) as recorder:
            assert recorder.wait() == 2
        (line,) = recorder.output.splitlines()
        assert text in line
    assert not (tmp_path / 'new').exists()


@pytest.mark.parametrize('reliability', list(ReliabilityPolicy)[1:3])
def test_recorder_takes_what_publishers_offer(tmp_path, reliability):
    """A best-effort publisher of a topic, and a reliable one."""
    output = tmp_path / 'bag'
    with (
        Probe() as probe,
        NodeProcess(RECORDER, params={'output': output, 'topics': ['/radar', 'wheel_torque']}),
    ):
        publisher = probe.node.create_publisher(
            JointState, 'wheel_torque', QoSProfile(depth=10, reliability=reliability)
        )
        numbers = itertools.count()
        probe.node.create_timer(
            0.01, lambda: publisher.publish(JointState(effort=[float(next(numbers))]))
        )
        probe.wait_for(lambda: recorded_count(probe) >= 20, '20 messages recorded')
    with BagReader(output) as bag:
        assert list(bag.topics) == ['/wheel_torque']
        assert bag.topics['/wheel_torque'].qos.reliable == (
            reliability == ReliabilityPolicy.RELIABLE
        )
        recorded = [m.message.effort[0] for m in bag.messages()]
    # None is missing after publisher and subscription are matched.
    assert recorded == [recorded[0] + i for i in range(len(recorded))]


def test_recorder_says_that_the_disk_is_full(tmp_path):
    """A limit on file size stands for the full disk: the write fails in the same way."""
    command = [
        str(RECORDER),
        '--ros-args',
        *('-p', f'output:={tmp_path / "bag"}', '-p', 'topics:=[wheel_torque]'),
    ]
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000)),
    )
    with Probe() as probe, process:
        publisher = probe.publisher('wheel_torque')
        message = JointState(name=[f'wheel {i}' for i in range(2000)])
        probe.node.create_timer(0.01, lambda: publisher.publish(message))
        probe.wait_for(lambda: process.poll() is not None, 'end of the recorder')
        output = process.stdout.read()
    assert process.returncode == 1
    assert 'bag: cannot write: File too large; the bag ends without index' in output
