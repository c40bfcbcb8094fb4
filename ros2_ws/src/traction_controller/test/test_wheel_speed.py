"""Wheel speed from pulses: how far off it is, when it may not be, and what is refused."""

import math

import numpy as np
import pytest

from traction_controller.wheel_speed import WheelSpeedFilter
from traction_model.sensors import Tachometer

DT = 0.01


def followed(omega, pulses):
    """What the filter makes of true speeds, shape (k, n), with its standard deviations."""
    omega = np.asarray(omega, dtype=float).reshape(len(omega), -1)
    tachometer = Tachometer(omega.shape[1], pulses)
    each = WheelSpeedFilter(pulses)
    found = []
    for now in omega:
        each.update(tachometer.read(now, DT), DT)
        found.append([each.omega, np.sqrt(each.variance)])
    found = np.array(found)
    return found[:, 0], found[:, 1], omega


@pytest.mark.parametrize('pulses', [200, 1000])
@pytest.mark.parametrize('speed', [0.7, 3.217, -5.0])
def test_even_turning_is_found_to_a_tenth_of_a_pulse(pulses, speed):
    # A count alone is off by up to a pulse in 10 ms, 3.1 rad/s at 200; a tenth of that is left.
    found, _, true = followed(np.full(500, speed), pulses)
    error = (found - true)[200:]
    assert np.sqrt(np.mean(error**2)) < 0.1 * 2 * math.pi / pulses / DT


@pytest.mark.parametrize('pulses', [200, 1000, 4000])
def test_deviation_is_honest_while_speed_changes_as_on_soil(pulses):
    t = DT * np.arange(2000.0)
    found, deviation, true = followed(3.0 + 0.3 * np.sin(1.3 * t), pulses)
    assert np.mean(np.abs(found - true) <= 2 * deviation) > 0.9


def test_steady_acceleration_has_no_lasting_error():
    found, _, true = followed(2.0 + 1.0 * DT * np.arange(600.0), 200)
    assert abs(np.mean((found - true)[300:])) < 0.02


def test_sudden_spinning_is_noticed_within_pulses():
    # From 3 rad/s the wheel gains 50 rad/s^2: half a pulse off what is expected (0.0157 rad)
    # after 25 ms; 0.1 s later it is followed.
    t = DT * np.arange(400.0)
    speed = 3.0 + 50.0 * np.clip(t - 2.0, 0.0, 0.15)
    found, _, true = followed(speed, 200)
    late = t > 2.3
    assert np.abs(found - true)[late].max() < 1.2
    assert np.abs(found - true)[t > 3.5].max() < 0.3
    # A low pass as calm as this one would be behind by far more.
    assert np.abs(found - true).max() < 4.0


def test_wheels_are_followed_each_by_itself():
    together, _, _ = followed(np.column_stack([np.full(300, 2.0), np.full(300, -4.0)]), 500)
    alone, _, _ = followed(np.full(300, -4.0), 500)
    np.testing.assert_array_equal(together[:, 1:], alone)


def test_speeds_go_through_where_nothing_is_counted():
    each = WheelSpeedFilter(0)
    assert each.update([1.0, -2.0], DT).tolist() == [1.0, -2.0]
    assert each.variance.tolist() == [0.0, 0.0]


def test_it_begins_anew():
    each = WheelSpeedFilter(100)
    each.update([1.0], DT)
    each.reset()
    assert each.update([3.0, 3.0], DT).tolist() == [3.0, 3.0]


def test_what_is_refused():
    for pulses in (-1.0, math.nan):
        with pytest.raises(ValueError, match='pulses_per_turn must be at least 0, got'):
            WheelSpeedFilter(pulses)
    each = WheelSpeedFilter(100)
    each.update([1.0, 1.0], DT)
    with pytest.raises(ValueError, match='wheel speeds must be finite, got'):
        each.update([1.0, math.nan], DT)
    with pytest.raises(ValueError, match='expected 2 wheel speeds, got 1'):
        each.update([1.0], DT)
    with pytest.raises(ValueError, match='dt must be above 0 s, got 0'):
        each.update([1.0, 1.0], 0.0)
    assert each.omega.tolist() == [1.0, 1.0]
