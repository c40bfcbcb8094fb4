"""Replay in lock step: reproducible bytes, equal to the golden files."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from recorded_bags import BAGS, NAMES
from rosbags.rosbag2 import StoragePlugin, Writer

from traction_controller.nodes.slip_estimator import SlipEstimatorBehaviour
from traction_evaluation.replay.golden import compare, read_golden, write_golden
from traction_evaluation.replay.lockstep import LockStep
from traction_evaluation.replay.replay import chosen_parameters
from traction_evaluation.replay.replay import replay as run_replay
from traction_node.quality_of_service import QOS
from traction_node.stamp import nanoseconds
from tractor_io.bags.bag_error import BagError
from tractor_io.bags.message_types import typestore
from tractor_io.bags.reader import BagReader
from tractor_io.bags.writer import BagWriter

GOLDEN = Path(__file__).parent / 'golden'


def sha256(said):
    return re.search(r'SHA-256 +([0-9a-f]{64})', said).group(1)


def as_sqlite3(source, folder):
    """The same messages in the other storage of rosbag2."""
    store = typestore()
    with BagReader(source) as bag:
        writer = Writer(folder, version=9, storage_plugin=StoragePlugin.SQLITE3)
        for key, value in bag.custom_data.items():
            writer.set_custom_data(key, value)
        with writer:
            there = {
                name: writer.add_connection(name, row.type, typestore=store)
                for name, row in bag.topics.items()
            }
            for message in bag.messages(raw=True):
                writer.write(there[message.topic], message.time, message.message)
    return folder


@pytest.mark.parametrize('name', NAMES)
def test_a_bag_gives_what_its_golden_file_says(name):
    assert compare(run_replay(BAGS / name), GOLDEN / f'{name}.golden') == []


def test_there_is_a_golden_file_of_every_bag():
    assert sorted(path.stem for path in GOLDEN.iterdir()) == NAMES


def test_three_processes_and_two_storages_give_the_same_bytes(tmp_path, traction):
    bag = BAGS / 'tractor_soft_patch'
    sqlite3 = as_sqlite3(bag, tmp_path / 'sqlite3')
    said = [traction('replay', source) for source in (bag, bag, sqlite3)]
    assert [status for status, _ in said] == [0, 0, 0], said
    here = run_replay(bag)
    assert {sha256(text) for _, text in said} == {here.sha256}
    assert re.search(r': \d+ times real time', said[0][1])
    written = [tmp_path / folder / 'outputs' for folder in ('first', 'second')]
    here.write(written[0])
    run_replay(sqlite3).write(written[1])
    for file in ('outputs.mcap', 'metadata.yaml'):
        assert (written[0] / file).read_bytes() == (written[1] / file).read_bytes()


def test_a_changed_gain_is_told_with_topic_time_and_field(traction):
    name = 'wheel_drawbar'
    status, said = traction(
        'replay', BAGS / name, '--against', GOLDEN / f'{name}.golden',
        '-p', 'slip_controller.weight_slip=0.05',
    )  # fmt: skip
    assert status == 1
    told = re.findall(
        r'differs from .*: (/\S+) at ([0-9.]+) s, ([\w.\[\]]+): expected .*, found .*', said
    )
    # What depends on the gain, from when it acts; the estimate does not.
    assert {'/controller_state', '/wheel_torque_command', '/wheel_torque'} <= {
        topic for topic, _, _ in told
    }, said
    assert '/slip_estimate' not in said.split('SHA-256')[1]
    assert all(0.0 < float(time) < 15.0 for _, time, _ in told)
    fields = {topic: field for topic, _, field in told}
    assert fields['/wheel_torque_command'] == 'effort[0]'


def test_an_earlier_replay_serves_as_golden_file_too(tmp_path, traction):
    bag = BAGS / 'wheel_low_slip'
    first = run_replay(bag)
    first.write(tmp_path / 'before')
    assert compare(first, tmp_path / 'before', tolerance=0.0) == []
    status, said = traction('replay', bag, '--against', tmp_path / 'before', '--tolerance', 0)
    assert status == 0, said
    changed = run_replay(bag, parameters={'slip_estimator': {'radar_variance': 0.0026}})
    # The bag's radar states its variance: this parameter must change nothing.
    assert compare(changed, tmp_path / 'before', tolerance=0.0) == []


def test_a_message_too_few_is_told(tmp_path):
    bag = BAGS / 'wheel_low_slip'
    result = run_replay(bag)
    write_golden(result, tmp_path / 'golden')
    result.messages = [m for m in result.messages if m[0] != '/odometry']
    (found,) = compare(result, tmp_path / 'golden')
    assert (found.topic, found.field, found.found) == ('/odometry', '', None)
    assert 'message is missing' in str(found)


def test_golden_files_hold_nine_digits(tmp_path):
    result = run_replay(BAGS / 'wheel_low_slip')
    write_golden(result, tmp_path / 'golden')
    estimates = [s for s in read_golden(tmp_path / 'golden') if s.topic == '/slip_estimate']
    exact = {
        message.header.stamp.sec * 10**9 + message.header.stamp.nanosec: message
        for message in result.values('slip_estimate')
    }
    # 10 s, one each half second, both ends.
    assert len(estimates) == 21
    for sample in estimates:
        stamp = sample.fields['header.stamp.sec'] * 10**9 + sample.fields['header.stamp.nanosec']
        np.testing.assert_allclose(sample.fields['slip'], exact[stamp].slip, rtol=1e-8)


@pytest.mark.parametrize(
    ('arguments', 'named'),
    [
        (['-p', 'slip_controler.mode=hold'], "did you mean 'slip_controller'"),
        (['-p', 'slip_controller.weight_slipp=1.0'], 'did you mean "weight_slip"'),
        (['-p', 'slip_controller.weight_slip'], 'NODE.NAME=VALUE'),
        (['-p', 'slip_controller.weight_slip=-1'], 'weight_slip'),
        (['--params-file', BAGS / 'README.md'], 'README.md'),
        (['--against', BAGS / 'README.md'], 'not a golden file'),
    ],
)
def test_what_is_wrong_with_the_input_is_named(arguments, named, traction):
    status, said = traction('replay', BAGS / 'wheel_low_slip', *arguments)
    assert status == 2
    assert named in said
    assert 'Traceback' not in said


def altered(path, change, name='tractor_soft_patch'):
    """Write a bag whose messages and times are changed; `change` gives both, or None."""
    with BagReader(BAGS / name) as bag, BagWriter(path, bag.custom_data) as writer:
        for topic, row in bag.topics.items():
            writer.add_topic(topic, row.type, row.qos)
        for message in bag.messages():
            changed = change(message.topic, message.message, message.time)
            if changed is not None:
                writer.write(message.topic, changed[1], changed[0])
    return path


def test_wheels_are_judged_by_name(tmp_path):
    def turned(topic, message, time):
        if topic == '/ground_truth/slip_estimate':
            lists = {
                name: value[::-1].copy()
                for name, value in vars(message).items()
                if isinstance(value, list | np.ndarray) and len(value) == 4
            }
            message = replace(message, **lists)
        return message, time

    expected = run_replay(BAGS / 'tractor_soft_patch').errors
    found = run_replay(altered(tmp_path / 'bag', turned)).errors
    assert found.slip_rmse.tobytes() == expected.slip_rmse.tobytes()


def test_stamps_may_be_far_from_the_times_of_the_bag(tmp_path):
    later = altered(tmp_path / 'bag', lambda _, message, time: (message, time + 10**18))
    expected = run_replay(BAGS / 'tractor_soft_patch').errors
    assert run_replay(later).errors.samples == expected.samples


def test_a_bag_with_a_pause_of_hours_is_refused(tmp_path):
    def late(_, message, time):
        return message, time + (4_000_000_000_000 if time > 10**9 * 8 + start else 0)

    with BagReader(BAGS / 'tractor_soft_patch') as bag:
        start = bag.start
    with pytest.raises(BagError, match=r'nothing from 8\.\d+ s on for 4000 s'):
        run_replay(altered(tmp_path / 'bag', late))


def test_a_request_without_messages_is_none(tmp_path):
    path = BAGS / 'wheel_drawbar'
    with BagReader(path) as bag, BagWriter(tmp_path / 'more', bag.custom_data) as more:
        for topic, row in bag.topics.items():
            more.add_topic(topic, row.type, row.qos)
        more.add_topic('/torque_request', 'sensor_msgs/msg/JointState', QOS['command'])
        for message in bag.messages(raw=True):
            more.write(message.topic, message.time, message.message)
    assert run_replay(tmp_path / 'more').sha256 == run_replay(path).sha256


def test_a_golden_file_is_compared_before_it_is_replaced(tmp_path, traction):
    bag, golden = BAGS / 'wheel_low_slip', tmp_path / 'golden'
    write_golden(run_replay(bag, parameters={'slip_controller': {'slip_target': 0.1}}), golden)
    status, said = traction('replay', bag, '--golden', golden, '--against', golden)
    assert status == 1
    assert 'differs from' in said
    status, said = traction('replay', bag, '--against', golden)
    assert status == 0, said


def test_a_parameter_file_of_the_whole_suite_will_do(tmp_path):
    path = tmp_path / 'own.yaml'
    path.write_text(
        '/**:\n  ros__parameters: {vehicle: a, use_sim_time: true, machine_id: blue}\n'
        '/**/slip_controller:\n'
        '  ros__parameters: {autostart: true, law: lqi, torque_rate: [1e6]}\n'
        'can_bridge:\n  ros__parameters: {port: 5}\n'
        'ekf_filter_node:\n  ros__parameters: {frequency: 30.0}\n'
    )
    assert chosen_parameters(path, ['slip_estimator.soil=b']) == {
        'slip_estimator': {'vehicle': 'a', 'soil': 'b'},
        'slip_controller': {'vehicle': 'a', 'law': 'lqi', 'torque_rate': [1e6]},
        # It has no vehicle.
        'torque_gate': {},
    }


def test_a_clock_that_is_set_back_does_not_hide_a_stuck_wheel():
    with BagReader(BAGS / 'tractor_sandy_loam') as bag:
        start, entries = bag.start, list(bag.messages(['wheel_states', 'radar']))
    lockstep = LockStep(typestore(), lambda *_: None, start)
    estimator = lockstep.add(SlipEstimatorBehaviour, {})
    said, stuck = {}, 0.0
    for entry in entries:
        t = (entry.time - start) * 1e-9
        message = SimpleNamespace(**vars(entry.message))
        ns = nanoseconds(message.header.stamp) - (4_000_000_000 if t > 7.0 else 0)
        message.header = SimpleNamespace(
            stamp=SimpleNamespace(sec=ns // 10**9, nanosec=ns % 10**9)
        )
        if entry.topic == '/wheel_states':
            message.name = list(message.name)
            message.velocity = message.velocity.copy()
            if t > 6.0:
                message.velocity[2] = stuck
            stuck = message.velocity[2]
        lockstep.put(entry.topic[1:], entry.time, message)
        said[t] = estimator.said
    assert all('stuck' not in text for t, text in said.items() if t < 6.0)
    assert all('stuck' in text for t, text in said.items() if 6.5 < t < 7.0)
    # It began anew after a tenth of a second, and found the same.
    assert all('stuck' in text for t, text in said.items() if t > 7.6)


def test_timers_run_between_messages_in_order_of_time():
    seen = []
    lockstep = LockStep(typestore(), lambda *_: None, start=1_000_000_000)
    lockstep.timer(0.01, lambda: seen.append(('timer', lockstep.now)))
    lockstep.subscribe('wheel_states', lambda _: seen.append(('message', lockstep.now)))
    lockstep.put('wheel_states', 1_025_000_000, None)
    lockstep.advance(1_030_000_000)
    assert seen == [
        ('timer', 1_010_000_000),
        ('timer', 1_020_000_000),
        ('message', 1_025_000_000),
        ('timer', 1_030_000_000),
    ]


def test_the_fixture_replays_and_compares(replay):
    result = replay('../bags/wheel_low_slip', against='golden/wheel_low_slip.golden')
    assert result.errors.total_slip_rmse < 0.01
    assert len(result.values('wheel_torque')) == 1001
    with pytest.raises(pytest.fail.Exception, match=r'/controller_state at [0-9.]+ s, \w+'):
        replay(
            '../bags/wheel_low_slip',
            against='golden/wheel_low_slip.golden',
            parameters={'slip_controller': {'weight_slip': 0.05}},
        )


def test_commands_stop_where_wheel_states_stop(tmp_path):
    """The gate's watchdog runs on the time of the bag."""

    def with_a_gap(topic, message, time):
        kept = topic in ('/wheel_states', '/wheel_torque')
        return (message, time) if kept and not 5.0 <= (time - start) * 1e-9 < 6.0 else None

    with BagReader(BAGS / 'wheel_drawbar') as bag:
        start = bag.start
    result = run_replay(altered(tmp_path / 'gap', with_a_gap, 'wheel_drawbar'))
    times = [ns for name, _, ns, _ in result.messages if name == '/wheel_torque']
    efforts = [message.effort[0] for message in result.values('wheel_torque')]
    at = {(ns - start) * 1e-9: effort for ns, effort in zip(times, efforts, strict=True)}
    assert min(effort for t, effort in at.items() if 3.0 < t < 4.99) > 100.0
    # The last command at 4.99 s holds 0.1 s and is gone 0.06 s later, by the watchdog of 10 ms.
    zero = [t for t, effort in at.items() if 5.0 <= t < 6.0 and effort == 0.0]
    assert 5.15 <= min(zero) <= 5.17
