"""Bags as arrays, replayed and drawn, also those of a namespace and those that hold little."""

from pathlib import Path

import numpy as np
import pytest

from traction_evaluation.drives.picture import draw
from traction_evaluation.drives.recording import read_recording
from traction_evaluation.estimation.estimate_errors import estimate_errors
from tractor_io.bags.bag_error import BagError
from tractor_io.bags.reader import BagReader
from tractor_io.bags.writer import BagWriter

DRAWBAR = Path(__file__).resolve().parents[4] / 'bags' / 'wheel_drawbar'


def copy(path, prefixes=('',), topics=None):
    """Write the first 4 s of a bag under one or more namespaces, optionally only some topics."""
    with BagReader(DRAWBAR) as bag, BagWriter(path, bag.custom_data) as writer:
        kept = {name: topic for name, topic in bag.topics.items() if not topics or name in topics}
        for prefix in prefixes:
            for name, topic in kept.items():
                writer.add_topic(prefix + name, topic.type, topic.qos)
        for message in bag.messages(list(kept), raw=True):
            if message.time - bag.start < 4_000_000_000:
                for prefix in prefixes:
                    writer.write(prefix + message.topic, message.time, message.message)
    return path


def test_a_bag_of_a_namespace_is_the_same_drive(tmp_path):
    plain = copy(tmp_path / 'plain')
    named = copy(tmp_path / 'named', ['/farm/tractor1'])
    expected, found = read_recording(plain), read_recording(named)
    assert found.wheel_names == expected.wheel_names
    assert found.series.keys() == expected.series.keys()
    for name, series in expected.series.items():
        assert np.array_equal(found[name].values, series.values), name
        assert np.array_equal(found[name].t, series.t), name
    assert estimate_errors(named).slip_rmse.tobytes() == estimate_errors(plain).slip_rmse.tobytes()


@pytest.mark.parametrize('use', [read_recording, estimate_errors])
def test_which_of_several_vehicles_is_not_guessed(tmp_path, use):
    bag = copy(tmp_path / 'bag', ['/a', '/b'])
    with pytest.raises(BagError, match='several vehicles: /a/wheel_states, /b/wheel_states'):
        use(bag)


@pytest.mark.parametrize('use', [read_recording, estimate_errors])
def test_a_bag_without_wheels_names_what_is_missing(tmp_path, use):
    bag = copy(tmp_path / 'bag', topics=['/radar'])
    with pytest.raises(BagError, match='no topic /wheel_states; it holds: /radar'):
        use(bag)


@pytest.mark.filterwarnings('error')
def test_a_bag_with_wheels_only_can_be_drawn(tmp_path):
    recording = read_recording(copy(tmp_path / 'bag', topics=['/wheel_states']))
    draw([recording], ['wheels'], tmp_path / 'picture.png')
    assert (tmp_path / 'picture.png').stat().st_size > 0
