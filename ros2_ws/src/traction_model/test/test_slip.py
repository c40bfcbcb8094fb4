"""Slip: its definition in every quarter of the (speed, wheel speed) plane."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from traction_model.slip import is_valid, slip

SPEEDS = st.floats(-60.0, 60.0)


@pytest.mark.parametrize(
    ('v', 'rim', 'expected'),
    [
        (0.8, 1.0, 0.2),  # driving: 1 - 0.8/1
        (1.0, 0.8, -0.2),  # braking: 0.8/1 - 1
        (-0.8, -1.0, 0.2),  # driving in reverse
        (-1.0, -0.8, -0.2),  # braking in reverse
        (1.0, 1.0, 0.0),  # rolling
        (0.0, 1.0, 1.0),  # spinning at standstill
        (0.0, -1.0, 1.0),
        (1.0, 0.0, -1.0),  # locked
        (-1.0, 0.0, -1.0),
        (1.0, -0.5, -1.0),  # turning against the motion: bounded
        (-0.5, 1.0, 1.0),  # sliding back under a wheel that drives forward: bounded
        (0.0, 0.0, 0.0),  # standstill
    ],
)
def test_definition(v, rim, expected):
    assert slip(v, rim) == pytest.approx(expected)


@given(SPEEDS, SPEEDS)
def test_bounded(v, rim):
    assert -1.0 <= slip(v, rim) <= 1.0


@given(SPEEDS, SPEEDS)
def test_same_in_reverse(v, rim):
    assert slip(-v, -rim) == slip(v, rim)


@given(SPEEDS, SPEEDS)
def test_changes_sign_when_speeds_swap(v, rim):
    # 1 - a/b and a/b - 1; both 1 or both -1 when the speeds are opposed and as fast.
    if v * rim >= 0:
        assert slip(rim, v) == -slip(v, rim)


@given(st.floats(0.0, 60.0), st.floats(0.01, 60.0))
def test_grows_with_rim_speed_when_going_forward(rim, v):
    assert slip(v, rim + 1.0) >= slip(v, rim)


@given(st.floats(0.01, 60.0), st.floats(0.0, 1.0), st.floats(0.1, 10.0))
def test_depends_on_the_ratio_of_speeds_only(rim, ratio, scale):
    assert slip(scale * ratio * rim, scale * rim) == pytest.approx(1 - ratio, abs=1e-12)


def test_validity():
    assert is_valid(0.3, 0.0, 0.3)
    assert is_valid(0.0, -0.3, 0.3)
    assert not is_valid(0.29, -0.29, 0.3)
