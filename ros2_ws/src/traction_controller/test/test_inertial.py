"""Inertial measurement unit: means between readings of the wheels, biases, bad readings."""

import math

import pytest

from traction_controller.estimation.inertial import InertialUnit


@pytest.fixture
def unit():
    return InertialUnit()


def test_means_of_the_readings_since_the_last(unit):
    assert unit.take(0.0) is None
    unit.add(0.005, 1.0, 0.0, 0.1, 0.02)
    unit.add(0.010, 3.0, 0.08, 0.3, 0.04)
    motion = unit.take(0.010)
    assert motion.acceleration == pytest.approx(2.0)
    # Variance of the mean: (0.04 + 0.08)/4, of which 0.04 is the default.
    assert motion.variance == pytest.approx(0.03)
    assert motion.yaw_rate == pytest.approx(0.2)
    assert motion.pitch_rate == pytest.approx(0.03)
    assert unit.take(0.020) is None


def test_old_readings_are_not_used(unit):
    unit.add(0.0, 1.0, 0.0, 0.1, 0.0)
    assert unit.alive(0.1)
    assert not unit.alive(0.11)
    assert unit.take(0.11) is None


def test_biases_are_found_at_rest_and_kept_on_the_move(unit):
    before = unit.yaw_rate_variance
    for k in range(1, 600):
        unit.add(0.01 * k, 0.0, 0.0, 0.004, -0.003)
        motion = unit.take(0.01 * k)
        unit.note_rest(0.01 * k, True)
    assert motion.yaw_rate == pytest.approx(0.0, abs=1e-4)
    assert motion.pitch_rate == pytest.approx(0.0, abs=1e-4)
    assert unit.yaw_rate_variance < before
    for k in range(600, 800):
        unit.add(0.01 * k, 0.0, 0.0, 0.204, -0.003)
        motion = unit.take(0.01 * k)
        unit.note_rest(0.01 * k, False)
    assert motion.yaw_rate == pytest.approx(0.2, abs=1e-4)


@pytest.mark.parametrize(
    ('values', 'reason'),
    [
        ((0.01, math.nan, 0.0, 0.0, 0.0), 'acceleration of imu is nan'),
        ((0.01, 99.0, 0.0, 0.0, 0.0), 'acceleration of imu is 99.0'),
        ((0.01, 0.0, -1.0, 0.0, 0.0), 'variance of imu is -1.0'),
        ((0.01, 0.0, 0.0, math.inf, 0.0), 'yaw rate of imu is inf'),
        ((0.01, 0.0, 0.0, 0.0, 20.0), 'pitch rate of imu is 20.0'),
        ((0.0, 0.0, 0.0, 0.0, 0.0), 'stamp of imu does not advance'),
        ((math.nan, 0.0, 0.0, 0.0, 0.0), 'stamp of imu does not advance'),
    ],
)
def test_bad_readings_are_named_and_change_nothing(unit, values, reason):
    unit.add(0.0, 1.0, 0.0, 0.1, 0.02)
    with pytest.raises(ValueError, match=reason):
        unit.add(*values)
    assert unit.take(0.01).acceleration == 1.0
