"""Bag reader and writer: round trips, order, and errors for files that are no bags."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from traction_node.quality_of_service import Qos
from tractor_io.bags.bag_error import BagError
from tractor_io.bags.message_types import typestore
from tractor_io.bags.reader import BagReader, BagTopic
from tractor_io.bags.writer import BagWriter

JOINT_STATE = 'sensor_msgs/msg/JointState'
SLIP = 'traction_interfaces/msg/SlipEstimate'
MS = 1_000_000


def joint_state(time: int, velocity: float):
    types = typestore().types
    stamp = types['builtin_interfaces/msg/Time'](sec=time // 10**9, nanosec=time % 10**9)
    return types[JOINT_STATE](
        header=types['std_msgs/msg/Header'](stamp=stamp, frame_id='base_link'),
        name=['fl', 'fr'],
        position=np.zeros(0),
        velocity=np.array([velocity, -velocity]),
        effort=np.zeros(2),
    )


def slip_estimate(time: int, slip: float):
    types = typestore().types
    stamp = types['builtin_interfaces/msg/Time'](sec=time // 10**9, nanosec=time % 10**9)
    return types[SLIP](
        header=types['std_msgs/msg/Header'](stamp=stamp, frame_id='base_link'),
        wheel_names=['fl'],
        slip=np.array([slip]),
        slip_variance=np.array([0.01]),
        valid=np.array([True]),
        wheel_based_speed=np.array([2.0]),
        ground_based_speed=1.8,
        ground_based_speed_variance=0.0025,
        ground_based_speed_valid=True,
        source=4,
        gross_traction=np.array([1e3, 2e3]),
        slip_stiffness=np.array([1e4, 2e4]),
        rolling_radius=np.array([0.5, 0.6]),
        rolling_radius_variance=np.zeros(2),
        immobilisation=0,
        immobilisation_reason='',
        time_to_immobilisation=np.inf,
    )


def write_bag(path: Path, count: int = 50) -> Path:
    """Two topics at 10 ms; on equal stamps slip_estimate comes first in the file."""
    with BagWriter(path, {'vehicle': 'tractor_4wd'}) as bag:
        bag.add_topic('/wheel_states', JOINT_STATE, Qos(reliable=False, depth=5))
        bag.add_topic('/slip_estimate', SLIP, Qos(latched=True, depth=1))
        for i in range(count):
            time = 1_000 * MS + i * 10 * MS
            bag.write('/slip_estimate', time, slip_estimate(time, i * 0.001))
            bag.write('/wheel_states', time, joint_state(time, float(i)))
    return path


def write_sqlite3(path: Path, count: int = 50) -> Path:
    """Write the messages of `write_bag` in rosbag2's sqlite3 format."""
    store = typestore()
    with RosbagsWriter(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as bag:
        wheel = bag.add_connection('/wheel_states', JOINT_STATE, typestore=store)
        slip = bag.add_connection('/slip_estimate', SLIP, typestore=store)
        for i in range(count):
            time = 1_000 * MS + i * 10 * MS
            bag.write(slip, time, store.serialize_cdr(slip_estimate(time, i * 0.001), SLIP))
            message = joint_state(time, float(i))
            bag.write(wheel, time, store.serialize_cdr(message, JOINT_STATE))
    return path


def test_what_is_written_is_read(tmp_path):
    with BagReader(write_bag(tmp_path / 'bag')) as bag:
        assert bag.custom_data == {'vehicle': 'tractor_4wd'}
        assert bag.start == 1_000 * MS
        assert bag.duration == pytest.approx(0.49)  # 50 messages, 49 steps of 10 ms
        assert list(bag.topics) == ['/slip_estimate', '/wheel_states']
        assert bag.topics['/wheel_states'] == BagTopic(
            JOINT_STATE, 50, Qos(reliable=False, depth=5)
        )
        assert bag.topics['/slip_estimate'] == BagTopic(SLIP, 50, Qos(latched=True, depth=1))
        messages = list(bag.messages())
    assert len(messages) == 100
    seventh = messages[13]
    assert (seventh.topic, seventh.time) == ('/wheel_states', 1_060 * MS)
    assert seventh.message.name == ['fl', 'fr']
    np.testing.assert_array_equal(seventh.message.velocity, [6.0, -6.0])


@pytest.mark.parametrize('write', [write_bag, write_sqlite3], ids=['mcap', 'sqlite3'])
def test_order_is_by_time_then_file(tmp_path, write):
    with BagReader(write(tmp_path / 'bag')) as bag:
        messages = list(bag.messages(raw=True))
    assert [m.time for m in messages] == sorted(m.time for m in messages)
    assert [m.topic for m in messages] == ['/slip_estimate', '/wheel_states'] * 50


def test_late_messages_are_sorted_across_chunks(tmp_path):
    # 6000 messages of about 100 bytes fill two chunks; the last is stamped before all others.
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic('/wheel_states', JOINT_STATE)
        for i in range(1, 6001):
            bag.write('/wheel_states', i * MS, joint_state(i * MS, float(i)))
        bag.write('/wheel_states', 0, joint_state(0, -1.0))
    with BagReader(tmp_path / 'bag') as bag:
        times = [m.time for m in bag.messages(raw=True)]
    assert times == [i * MS for i in range(6001)]


def test_sqlite3_holds_the_same_as_mcap(tmp_path):
    with (
        BagReader(write_bag(tmp_path / 'mcap')) as mcap,
        BagReader(write_sqlite3(tmp_path / 'sqlite3')) as sqlite3,
    ):
        assert list(mcap.messages(raw=True)) == list(sqlite3.messages(raw=True))


@pytest.mark.parametrize('write', [write_bag, write_sqlite3], ids=['mcap', 'sqlite3'])
def test_a_lone_file_is_a_bag(tmp_path, write):
    folder = write(tmp_path / 'bag')
    (file,) = [p for p in folder.iterdir() if p.suffix in ('.mcap', '.db3')]
    with BagReader(file) as bag:
        assert sum(1 for _ in bag.messages()) == 100
        if file.suffix == '.mcap':
            assert bag.custom_data == {'vehicle': 'tractor_4wd'}


def test_types_of_others_come_with_the_bag(tmp_path):
    name = 'field_msgs/msg/Moisture'
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg('float64 percent', name))
    message = store.types[name](percent=22.0)
    with RosbagsWriter(tmp_path / 'bag', version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        connection = bag.add_connection('/moisture', name, typestore=store)
        bag.write(connection, 0, store.serialize_cdr(message, name))
    with BagReader(tmp_path / 'bag') as bag:
        assert [m.message.percent for m in bag.messages()] == [22.0]
    assert name not in typestore().fielddefs


def test_topics_and_start_offset_select(tmp_path):
    with BagReader(write_bag(tmp_path / 'bag')) as bag:
        messages = list(bag.messages(topics=['wheel_states'], start_offset=0.4))
    # From 0.40 s to 0.49 s in steps of 0.01 s.
    assert [m.message.velocity[0] for m in messages] == list(range(40, 50))
    assert {m.topic for m in messages} == {'/wheel_states'}


def test_missing_topic_names_it_and_those_there(tmp_path):
    with (
        BagReader(write_bag(tmp_path / 'bag')) as bag,
        pytest.raises(BagError, match=r'no topic /radar; it holds: /slip_estimate, /wheel_states'),
    ):
        list(bag.messages(topics=['/radar']))


def test_same_calls_give_same_bytes(tmp_path):
    first, second = write_bag(tmp_path / 'a' / 'bag'), write_bag(tmp_path / 'b' / 'bag')
    for name in ('bag.mcap', 'metadata.yaml'):
        assert (first / name).read_bytes() == (second / name).read_bytes()


def test_metadata_is_what_rosbag2_of_jazzy_writes(tmp_path):
    text = (write_bag(tmp_path / 'bag') / 'metadata.yaml').read_text()
    metadata = yaml.safe_load(text)['rosbag2_bagfile_information']
    assert metadata['version'] == 9
    assert metadata['storage_identifier'] == 'mcap'
    assert metadata['relative_file_paths'] == ['bag.mcap']
    assert metadata['ros_distro'] == 'jazzy'
    assert metadata['message_count'] == 100
    topic = metadata['topics_with_message_count'][0]['topic_metadata']
    assert topic['offered_qos_profiles'][0]['reliability'] == 'best_effort'
    assert topic['type_description_hash'].startswith('RIHS01_')


def test_empty_bag_can_be_read(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic('/wheel_states', JOINT_STATE)
    with BagReader(tmp_path / 'bag') as bag:
        assert (bag.start, bag.duration) == (0, 0.0)
        assert list(bag.messages()) == []


def test_missing_path():
    with pytest.raises(BagError, match='nowhere: no such file or folder'):
        BagReader('nowhere')


def test_folder_without_metadata(tmp_path):
    with pytest.raises(BagError, match=r'not a bag, it has no metadata\.yaml'):
        BagReader(tmp_path)


def test_file_of_another_kind(tmp_path):
    (tmp_path / 'notes.txt').write_text('hello')
    with pytest.raises(BagError, match=r'notes\.txt: not a bag'):
        BagReader(tmp_path / 'notes.txt')
    (tmp_path / 'notes.mcap').write_text('hello, this is no MCAP file')
    with pytest.raises(BagError, match=r'notes\.mcap: not an MCAP file'):
        BagReader(tmp_path / 'notes.mcap')
    (tmp_path / 'notes.db3').write_text('hello, this is no database')
    with pytest.raises(BagError, match=r'notes\.db3: damaged bag'):
        BagReader(tmp_path / 'notes.db3')


@pytest.mark.parametrize('kept', [0.01, 0.5, 0.99])
def test_truncated_mcap(tmp_path, kept):
    path = write_bag(tmp_path / 'bag') / 'bag.mcap'
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * kept)])
    with pytest.raises(BagError, match=r'bag\.mcap: cut short after \d+ bytes'):
        BagReader(tmp_path / 'bag')


def test_flipped_bytes_are_found(tmp_path):
    path = write_bag(tmp_path / 'bag') / 'bag.mcap'
    data = bytearray(path.read_bytes())
    for i in range(len(data) // 4, len(data) // 4 + 64):
        data[i] ^= 0xFF
    path.write_bytes(bytes(data))
    with pytest.raises(BagError, match='damaged bag'), BagReader(tmp_path / 'bag') as bag:
        list(bag.messages())


def test_message_that_does_not_fit_its_type(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic('/wheel_states', JOINT_STATE)
        bag.write('/wheel_states', 5, b'\x00\x01\x00\x00\xff')
    with (
        BagReader(tmp_path / 'bag') as bag,
        pytest.raises(BagError, match=r'message on /wheel_states at 5 ns is not a valid'),
    ):
        list(bag.messages())


def test_existing_folder_is_not_overwritten(tmp_path):
    write_bag(tmp_path / 'bag')
    with pytest.raises(BagError, match='exists already, not overwritten'):
        BagWriter(tmp_path / 'bag')


def test_writer_refuses_what_it_does_not_know(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        with pytest.raises(BagError, match='/x has unknown type no_msgs/msg/None'):
            bag.add_topic('/x', 'no_msgs/msg/None')
        with pytest.raises(BagError, match='/y was not declared'):
            bag.write('/y', 0, b'')
        bag.add_topic('/z', JOINT_STATE)
        with pytest.raises(BagError, match='/z is declared twice'):
            bag.add_topic('/z', JOINT_STATE)
        with pytest.raises(BagError, match='message for /z at 0 ns does not fit its type'):
            bag.write('/z', 0, slip_estimate(0, 0.1))


@pytest.mark.parametrize(
    ('old', 'new', 'reason'),
    [
        ('name: /wheel_states', "name: ''", "a topic is named ''"),
        ('nanoseconds: ', f'nanoseconds: {10**400} #', 'is no whole number of 0 to'),
        ('depth: 5', 'depth: x', "'x' is no whole number"),
        ('version: 9', f'version: 9\nx: {50 * "["}{50 * "]"}', 'nested deeper than 32 levels'),
        ('version: 9', 'version: &v 9\nx: &x [*x]', 'stands within itself'),
    ],
)
def test_damaged_metadata_is_one_error(tmp_path, old, new, reason):
    path = write_bag(tmp_path / 'bag') / 'metadata.yaml'
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(BagError, match=reason):
        BagReader(tmp_path / 'bag')
