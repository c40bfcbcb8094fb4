"""Engine torque to wheel torques and back, calculated by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tractor_io.can.drivetrain import Drivetrain

FOUR = (True, True, False, False)


def test_torques_by_hand():
    # 600 N·m at half, times 40, times 0.9: 10800 N·m; 40 % of it in front.
    drive = Drivetrain(FOUR, 600.0, 40.0, 0.9, 0.4)
    assert drive.wheel_torques(0.5, True) == pytest.approx([2160, 2160, 3240, 3240])
    assert drive.wheel_torques(0.5, False) == pytest.approx([0, 0, 5400, 5400])
    assert drive.shares(True).sum() == pytest.approx(1.0)


def test_no_wheel_gets_more_than_it_may():
    drive = Drivetrain(FOUR, 600.0, 40.0, 1.0, 0.5)
    # The wheel of 1000 N·m decides: four times it of 24000 N·m.
    assert drive.engine_share([1000, 2000, 3000, 4000], True) == pytest.approx(4000 / 24000)
    # Without the front axle the one of 3000: twice it.
    assert drive.engine_share([1000, 2000, 3000, 4000], False) == pytest.approx(6000 / 24000)


@given(
    engine=st.floats(-1.25, 1.25), front=st.booleans(), share=st.floats(0.0, 0.9),
    efficiency=st.floats(0.1, 1.0),
)  # fmt: skip
def test_there_and_back(engine, front, share, efficiency):
    drive = Drivetrain(FOUR, 500.0, 30.0, efficiency, share)
    torques = drive.wheel_torques(engine, front)
    assert drive.engine_share(torques, front) == pytest.approx(engine, abs=1e-12)
    assert np.all(torques[:2] == 0.0) or front


@pytest.mark.parametrize(
    ('arguments', 'text'),
    [
        ((FOUR, 0.0, 40.0), 'reference_torque must be above 0'),
        ((FOUR, 600.0, math.nan), 'ratio must be above 0'),
        ((FOUR, 600.0, 40.0, 1.1), 'efficiency must be above 0 and at most 1, got 1.1'),
        ((FOUR, 600.0, 40.0, 1.0, 1.0), 'front_share must be at least 0 and below 1, got 1'),
        (((True, True), 600.0, 40.0), 'there must be a wheel on the rear axle'),
        (((), 600.0, 40.0), 'there must be a wheel on the rear axle'),
        (((False, False), 600.0, 40.0, 1.0, 0.2), 'front_share must be 0 without a wheel'),
    ],
)
def test_drives_that_cannot_be(arguments, text):
    with pytest.raises(ValueError, match=text):
        Drivetrain(*arguments)


@pytest.mark.parametrize(
    ('torques', 'text'),
    [([1.0] * 3, 'expected 4 wheel torques, got 3'), ([1.0, 1.0, 1.0, math.nan], 'finite')],
)
def test_torques_that_are_refused(torques, text):
    with pytest.raises(ValueError, match=text):
        Drivetrain(FOUR, 600.0, 40.0).engine_share(torques, True)
