"""Stamps to seconds and back."""

from types import SimpleNamespace

from hypothesis import given
from hypothesis import strategies as st

from traction_node.stamp import between, nanoseconds, seconds, to_stamp


def stamp(sec=0, nanosec=0):
    return SimpleNamespace(sec=sec, nanosec=nanosec)


def test_nanoseconds_are_exact_near_the_present_date():
    assert nanoseconds(stamp(1_795_312_098, 864_136_933)) == 1_795_312_098_864_136_933


def test_seconds():
    assert seconds(stamp(3, 250_000_000)) == 3.25


def test_between_is_exact_far_from_zero():
    # At 1.7e9 s a float cannot resolve 100 ns; the difference of the stamps can.
    earlier, later = stamp(1_700_000_000, 999_999_950), stamp(1_700_000_001, 50)
    assert between(earlier, later) == 1.0 - 999_999_900 / 1e9
    assert abs(between(earlier, later) - 100e-9) < 1e-15
    assert between(later, earlier) == -between(earlier, later)


def test_rounding_up_carries_into_the_seconds():
    # 4 ulp below 2 s: 2 - 8.9e-16, which is nearest to 2 s and 0 ns.
    time = stamp()
    to_stamp(time, 2.0 - 4 * 2.220446049250313e-16)
    assert (time.sec, time.nanosec) == (2, 0)


@given(st.integers(0, 100_000), st.integers(0, 999_999_999))
def test_round_trip(sec, nanosec):
    # Below 1e5 s neighbouring floats are at most 1.5e-11 s apart: a nanosecond survives.
    time = stamp()
    to_stamp(time, seconds(stamp(sec, nanosec)))
    assert (time.sec, time.nanosec) == (sec, nanosec)
