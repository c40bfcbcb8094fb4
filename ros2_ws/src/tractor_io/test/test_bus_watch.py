"""Bus watch: newest values, missing messages, accepted senders."""

import math

import pytest

from tractor_io.can.bus_watch import BusWatch
from tractor_io.can.j1939 import Unknown
from tractor_io.can.parameter_group import FrameError, tractor_groups

GROUPS = tractor_groups()
FIELD = 'GroundBasedMachineSpeed'


def send(watch, t, speed, source=0):
    identifier = GROUPS.identifier('GBSD')._replace(source=source)
    return watch.take(t, identifier.bits, GROUPS.encode('GBSD', {FIELD: speed}))


def test_newest_value_counts_until_silence():
    watch = BusWatch(GROUPS, missed=5.0)
    assert watch.silent(0.0, 'GBSD')
    assert watch.value(0.0, 'GBSD', FIELD) is Unknown.NOT_AVAILABLE
    send(watch, 0.0, 1.0)
    assert send(watch, 0.1, 2.0).values[FIELD] == pytest.approx(2.0)
    # Five periods of 100 ms.
    assert watch.value(0.59, 'GBSD', FIELD) == pytest.approx(2.0)
    assert watch.value(0.61, 'GBSD', FIELD) is Unknown.NOT_AVAILABLE
    assert watch.silent(0.61, 'GBSD')
    # The sender is chosen for each message separately.
    assert watch.silent(0.1, 'WBSD')


def test_first_sender_is_heard_until_it_is_silent():
    watch = BusWatch(GROUPS)
    send(watch, 0.0, 1.0, source=10)
    assert send(watch, 0.05, 9.0, source=20) is None
    assert watch.value(0.1, 'GBSD', FIELD) == pytest.approx(1.0)
    assert watch.refused == {'GBSD': 1}
    assert send(watch, 0.7, 3.0, source=20) is not None
    # Now the second sender is accepted, and the first is not.
    assert send(watch, 0.8, 1.0, source=10) is None
    assert watch.value(0.8, 'GBSD', FIELD) == pytest.approx(3.0)


def test_pinned_sender_alone_is_heard():
    watch = BusWatch(GROUPS, {'GBSD': 20})
    assert send(watch, 0.0, 1.0, source=10) is None
    assert watch.silent(0.0, 'GBSD')
    assert send(watch, 0.0, 2.0, source=20) is not None


def test_frames_of_others_change_nothing():
    watch = BusWatch(GROUPS)
    assert watch.take(0.0, 0x18FEF100, b'\xff' * 8) is None
    with pytest.raises(FrameError, match='GBSD: has 7 bytes, not 8'):
        watch.take(0.0, GROUPS.identifier('GBSD').bits, b'\xff' * 7)
    assert watch.silent(0.0, 'GBSD')


@pytest.mark.parametrize(
    ('arguments', 'text'),
    [
        (({'GBSX': 1},), "unknown message 'GBSX'"),
        (({'GBSD': 254},), 'source of GBSD must be an address of 0 to 253, got 254'),
        (({}, 1.0), 'missed must be above 1, got 1'),
        (({}, math.nan), 'missed must be above 1, got nan'),
    ],
)
def test_what_is_refused(arguments, text):
    with pytest.raises(ValueError, match=text):
        BusWatch(GROUPS, *arguments)
