"""Repair and cuts of bags: messages recovered from files cut at any byte."""

import math

import numpy as np
import pytest

from traction_node.quality_of_service import Qos
from tractor_io.bags.bag_error import BagError
from tractor_io.bags.message_types import typestore
from tractor_io.bags.reader import BagReader
from tractor_io.bags.repair import cut_bag, repair_bag
from tractor_io.bags.writer import BagWriter

JOINT_STATE = 'sensor_msgs/msg/JointState'
MS = 1_000_000


def joint_state(time, velocity):
    types = typestore().types
    stamp = types['builtin_interfaces/msg/Time'](sec=time // 10**9, nanosec=time % 10**9)
    return types[JOINT_STATE](
        header=types['std_msgs/msg/Header'](stamp=stamp, frame_id='base_link'),
        name=['fl'], position=np.zeros(0), velocity=np.array([velocity]), effort=np.zeros(1),
    )  # fmt: skip


def write(path, count=100, flush_every=0, closed=True):
    """A message every 10 ms on one topic, every 100 ms on another one."""
    bag = BagWriter(path, {'vehicle': 'tractor_4wd'})
    bag.add_topic('/wheel_states', JOINT_STATE, Qos(reliable=False, depth=5))
    bag.add_topic('/wheel_torque', JOINT_STATE)
    for i in range(count):
        time = 1000 * MS + i * 10 * MS
        bag.write('/wheel_states', time, joint_state(time, float(i)))
        if i % 10 == 0:
            bag.write('/wheel_torque', time, joint_state(time, -float(i)))
        if flush_every and (i + 1) % flush_every == 0:
            bag.flush()
    if closed:
        bag.close()
    return bag


def velocities(path):
    with BagReader(path) as bag:
        return [m.message.velocity[0] for m in bag.messages(['/wheel_states'])]


def test_all_that_was_flushed_is_got_back(tmp_path):
    bag = write(tmp_path / 'bag', count=95, flush_every=20, closed=False)
    # Like a killed process: the content of its buffers is lost.
    with pytest.raises(BagError):
        BagReader(tmp_path / 'bag')
    found = repair_bag(tmp_path / 'bag')
    bag.abort()
    assert found.path == tmp_path / 'bag_repaired'
    assert found.counts == {'/wheel_states': 80, '/wheel_torque': 8}
    assert (found.start, found.end) == (1000 * MS, 1790 * MS)
    assert 'cut short' in found.reason
    assert velocities(found.path) == [float(i) for i in range(80)]
    with BagReader(found.path) as repaired:
        assert repaired.custom_data == {'vehicle': 'tractor_4wd'}
        assert repaired.topics['/wheel_states'].qos == Qos(reliable=False, depth=5)
        assert repaired.topics['/wheel_states'].type == JOINT_STATE


@pytest.mark.parametrize('share', [0.3, 0.5, 0.8, 0.95])
def test_file_that_breaks_off_anywhere(tmp_path, share):
    write(tmp_path / 'bag', flush_every=10)
    path = tmp_path / 'bag' / 'bag.mcap'
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    found = repair_bag(path, tmp_path / 'new')
    got = velocities(tmp_path / 'new')
    assert len(got) == found.counts['/wheel_states']
    assert got == [float(i) for i in range(len(got))]
    # Whole chunks of ten messages, less the part of the file that the index takes.
    assert len(got) % 10 == 0
    assert len(got) >= 100 * (share - 0.2)


def test_flipped_bytes_end_the_repair_there(tmp_path):
    write(tmp_path / 'bag', flush_every=10)
    path = tmp_path / 'bag' / 'bag.mcap'
    data = bytearray(path.read_bytes())
    for i in range(len(data) // 4, len(data) // 4 + 64):
        data[i] ^= 0xFF
    path.write_bytes(bytes(data))
    found = repair_bag(path)
    assert 0 < found.counts['/wheel_states'] < 100
    assert found.reason


def test_whole_bag_is_copied_whole(tmp_path):
    write(tmp_path / 'bag')
    found = repair_bag(tmp_path / 'bag')
    assert found.reason == ''
    assert velocities(found.path) == velocities(tmp_path / 'bag')


def test_repair_refuses_in_words(tmp_path):
    with pytest.raises(BagError, match='nowhere: no such file or folder'):
        repair_bag(tmp_path / 'nowhere')
    with pytest.raises(BagError, match='expected one MCAP file, found 0'):
        repair_bag(tmp_path)
    (tmp_path / 'x.mcap').write_bytes(b'\x89MCAP0\r\n')
    with pytest.raises(BagError, match=r'x\.mcap: nothing to repair: damaged or cut short'):
        repair_bag(tmp_path / 'x.mcap')
    write(tmp_path / 'bag')
    (tmp_path / 'bag_repaired').mkdir()
    with pytest.raises(BagError, match='bag_repaired: exists already'):
        repair_bag(tmp_path / 'bag')


def test_cut_takes_what_lies_in_between(tmp_path):
    write(tmp_path / 'bag')
    counts = cut_bag(tmp_path / 'bag', tmp_path / 'part', 0.2, 0.5, ['wheel_states'])
    # From 0.20 to 0.50 s, both included.
    assert counts == {'/wheel_states': 31}
    assert velocities(tmp_path / 'part') == [float(i) for i in range(20, 51)]
    with BagReader(tmp_path / 'part') as bag:
        assert bag.custom_data == {'vehicle': 'tractor_4wd'}
        assert bag.topics['/wheel_states'].qos == Qos(reliable=False, depth=5)


@pytest.mark.parametrize(
    ('arguments', 'text'),
    [
        ((0.5, 0.5), r'the end, 0\.5 s, must be after the start, 0\.5 s'),
        ((math.nan,), 'start and end must be finite'),
        ((0.0, math.inf), 'start and end must be finite'),
        ((5.0,), r'nothing to cut, it is 0\.990 s long'),
        ((0.0, None, ['radar']), 'no topic /radar; it holds: /wheel_states, /wheel_torque'),
    ],
)
def test_cut_refuses_in_words(tmp_path, arguments, text):
    write(tmp_path / 'bag')
    with pytest.raises(BagError, match=text):
        cut_bag(tmp_path / 'bag', tmp_path / 'part', *arguments)
    assert not (tmp_path / 'part').exists()


def test_what_is_said_later_is_kept_whether_closed_or_killed(tmp_path):
    said = {'vehicle': 'tractor_4wd', 'parameters /torque_gate': 'timeout: 0.1\n'}
    for name in ('closed', 'killed'):
        bag = write(tmp_path / name, closed=False)
        bag.say({'parameters /torque_gate': 'timeout: 0.1\n'})
        bag.flush()
        if name == 'closed':
            bag.close()
            path = tmp_path / name
        else:
            path = repair_bag(tmp_path / name).path
            bag.abort()
        with BagReader(path) as reader:
            assert reader.custom_data == said
            assert reader.topics['/wheel_states'].count == 100
