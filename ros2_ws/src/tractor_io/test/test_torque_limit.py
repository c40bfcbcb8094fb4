"""Torque limit: the frame byte by byte, and its reading as in an engine."""

import math

import pytest

from tractor_io.can.j1939 import Unknown
from tractor_io.can.parameter_group import FrameError, tractor_groups
from tractor_io.can.torque_limit import LimitReader, TorqueLimit, checksum, with_fraction

GROUPS = tractor_groups()


def read(reader, identifier, data):
    return reader.read(GROUPS.decode(identifier, data), data)


def test_frame_by_hand():
    identifier, data = TorqueLimit(GROUPS, destination=0, priority=1).limit(0x27, 0.5)
    assert identifier == 0x0C000027
    # Mode 3, conditions all ones, priority 1, ones: 11 01 11 11 from the top. Speed 0xFAFF, 50 %
    # is 175, standard rate and P32 all ones, no eighths of a percent.
    assert data[:7] == bytes([0b11011111, 0xFF, 0xFA, 175, 0xFF, 0xF0, 0xFF])
    # 223 + 255 + 250 + 175 + 255 + 240 + 255 + 0 + (0x27 + 0 + 0 + 0x0C) = 1704;
    # 1704 >> 6 is 26, & 3 is 2; 1704 >> 3 is 213; 2 + 213 + 1704 = 1919, & 7 is 7.
    assert checksum(identifier, data, 0) == 7
    assert data[7] == 0x70


def test_counter_goes_round():
    limit = TorqueLimit(GROUPS)
    counts = [limit.limit(1, 0.1)[1][7] & 0x0F for _ in range(10)]
    assert counts == [0, 1, 2, 3, 4, 5, 6, 7, 0, 1]


@pytest.mark.parametrize(
    ('asked', 'told'),
    [(0.5, 0.5), (0.509, 0.50875), (-0.501, -0.50125), (1.25, 1.25), (0.29, 0.29)],
)
def test_limits_are_never_rounded_up(asked, told):
    assert read(LimitReader(), *TorqueLimit(GROUPS).limit(1, asked)) == pytest.approx(told)


def test_engine_of_whole_percents_is_limited_to_less():
    identifier, data = TorqueLimit(GROUPS).limit(1, 0.509)
    values = GROUPS.decode(identifier, data).values
    assert values['EngineRequestedTorque'] == pytest.approx(0.5)
    assert values['EngineRequestedTorqueFraction'] == pytest.approx(0.00875)


def test_sender_of_whole_percents_leaves_the_fraction_out():
    # All ones: not available; 8 of 8 is reserved.
    assert with_fraction(0.4, Unknown.NOT_AVAILABLE) == 0.4
    assert with_fraction(0.4, 0.01) == 0.4
    assert with_fraction(1.25, 0.0025) == 1.25
    assert with_fraction(-0.4, 0.00125) == pytest.approx(-0.39875)


def test_release_takes_the_limit_back():
    limit, reader = TorqueLimit(GROUPS), LimitReader()
    assert read(reader, *limit.limit(1, 0.2)) == pytest.approx(0.2)
    assert read(reader, *limit.release(1)) is None


def test_damaged_and_repeated_frames_do_not_count():
    limit, reader = TorqueLimit(GROUPS), LimitReader()
    identifier, data = limit.limit(1, 0.2)
    assert read(reader, identifier, data) == pytest.approx(0.2)
    with pytest.raises(FrameError, match='MessageCounter stays at 0'):
        read(reader, identifier, data)
    identifier, data = limit.limit(1, 0.2)
    with pytest.raises(FrameError, match='MessageChecksum is'):
        read(reader, identifier, bytes([*data[:3], data[3] + 1, *data[4:]]))
    # From another sender the same bytes are wrong.
    identifier, data = limit.limit(1, 0.2)
    with pytest.raises(FrameError, match='MessageChecksum is'):
        read(reader, identifier + 1, data)


def test_sender_without_counter_and_checksum_is_believed():
    data = GROUPS.encode('TSC1', {'EngineOverrideControlMode': 3, 'EngineRequestedTorque': 0.4})
    identifier = GROUPS.identifier('TSC1')._replace(source=3, destination=0).bits
    reader = LimitReader()
    assert read(reader, identifier, data) == pytest.approx(0.4)
    assert read(reader, identifier, data) == pytest.approx(0.4)


def test_limit_without_a_torque_is_refused():
    data = GROUPS.encode('TSC1', {'EngineOverrideControlMode': 3})
    with pytest.raises(FrameError, match='EngineRequestedTorque is not available'):
        read(LimitReader(), GROUPS.identifier('TSC1')._replace(destination=0).bits, data)


@pytest.mark.parametrize('share', [math.nan, math.inf, 1.26, -1.26])
def test_limits_that_cannot_be_told(share):
    limit = TorqueLimit(GROUPS)
    with pytest.raises(FrameError, match=r'must be -1\.25 to 1\.25 of reference, got'):
        limit.limit(1, share)
    # The counter did not change.
    assert limit.limit(1, 0.0)[1][7] & 0x0F == 0
