"""Calibration of the rolling radius: accuracy, and robustness against slip and faults."""

import math

import numpy as np
import pytest

from traction_controller.estimation.rolling_radius import Calibration, FirmGround, RollingRadius

DT = 0.1


class Drive:
    """A vehicle of true radius 0.85 m, nominal 0.8 m, that is driven in pieces."""

    def __init__(self, nominal=(0.8,), true=0.85, seed=1, noise=0.0, **ground):
        self.calibration = RollingRadius(nominal, FirmGround(**ground))
        self.true, self.noise = true, noise
        self.random = np.random.default_rng(seed)
        self.t = self.distance = 0.0
        self.angle = np.zeros(len(nominal))

    def on(self, seconds, v=3.0, slip=0.0, effort=0.05, turn_rate=0.0, seen=True):
        """Drive on, and return the states the calibration went through."""
        states = set()
        heading = 0.0
        for _ in range(round(seconds / DT)):
            self.t += DT
            heading += turn_rate * DT
            self.distance += v * DT
            self.angle = self.angle + v * DT / (self.true * (1.0 - np.asarray(slip)))
            measured = self.distance + self.noise * self.random.standard_normal()
            self.calibration.advance(
                self.t, self.angle, measured if seen else math.nan, effort, heading
            )
            states.add(self.calibration.state)
        return states


def test_first_measurement_by_hand():
    drive = Drive(stretch=2.0, distance=0.04, slip=0.004, drift=1e-9)
    # The first reading has nothing before it; then 0.3 m each: 7 of them make 2.1 m.
    drive.on(0.8)
    # Variance of the measurement (0.04/2.1)^2 + 0.004^2 = 3.79e-4, of the start 0.05^2: gain
    # 0.8684 of an offset of 0.85/0.8 - 1 = 0.0625.
    assert drive.calibration.measured.tolist() == [1]
    assert drive.calibration.scale[0] == pytest.approx(1 + 0.8684 * 0.0625, abs=2e-5)
    # 0.8684*3.79e-4.
    assert drive.calibration.scale_variance[0] == pytest.approx(3.29e-4, rel=2e-3)
    assert not drive.calibration.calibrated[0]


@pytest.mark.parametrize('nominal', [0.8, 0.85 * 0.94, 0.85, 0.85 * 1.06])
def test_converges_from_a_wrong_start(nominal):
    drive = Drive((nominal,), noise=0.02)
    drive.on(60.0)
    assert drive.calibration.radius[0] == pytest.approx(0.85, rel=0.005)
    assert drive.calibration.calibrated[0]


def test_its_variance_is_honest():
    """With the stated noise and slip (constant over a drive) 95 % of errors are within 2 sigma."""
    inside = 0
    for seed in range(200):
        slip = 0.004 * np.random.default_rng(1000 + seed).standard_normal()
        # Of both ends of a stretch together the distance is off by 0.04 m.
        drive = Drive((0.8,), seed=seed, noise=0.04 / math.sqrt(2))
        drive.on(12.0, slip=slip)
        error = drive.calibration.scale[0] - 0.85 / 0.8
        inside += abs(error) <= 2 * math.sqrt(drive.calibration.scale_variance[0])
    # Errors of common ends of measurements cancel, so up to 99 % are within.
    assert inside >= 0.92 * 200


@pytest.mark.parametrize(
    ('conditions', 'state'),
    [
        ({'v': 0.4}, Calibration.TOO_SLOW),
        ({'effort': 0.3}, Calibration.PULLING),
        ({'effort': -0.3}, Calibration.PULLING),
        ({'effort': math.nan}, Calibration.PULLING),
        ({'turn_rate': 0.5}, Calibration.TURNING),
        ({'seen': False}, Calibration.NO_GROUND_SPEED),
    ],
)
def test_frozen_where_conditions_do_not_hold(conditions, state):
    drive = Drive()
    drive.on(20.0)
    before = drive.calibration.scale.copy(), drive.calibration.scale_variance.copy()
    # Break off the measurement under way.
    drive.on(0.1, v=0.0)
    # At 1 m/s a stretch takes 2 s, and it turns by 0.2 rad in 0.4 s.
    states = drive.on(30.0, **({'v': 1.0} | conditions), slip=0.08)
    assert states - {state} <= ({Calibration.CALIBRATING} if 'turn_rate' in conditions else set())
    assert state in states
    assert np.array_equal(drive.calibration.scale, before[0])
    assert np.array_equal(drive.calibration.scale_variance, before[1])


def test_frozen_while_speed_changes():
    drive = Drive()
    states = set()
    # 1 m/s^2: over a stretch of 2 m at 2 m/s the speed changes by half.
    for v in np.concatenate([np.arange(1.0, 3.0, 0.1), np.arange(3.0, 1.0, -0.1)] * 5):
        states |= drive.on(DT, v=v)
    assert Calibration.UNSTEADY in states
    assert drive.calibration.measured[0] <= 5


def test_work_in_the_field_is_not_calibrated_away():
    drive = Drive(noise=0.02)
    drive.on(60.0)
    before = drive.calibration.scale[0]
    # An hour of 8 % slip with the pull known, then with a sensor of pull that says nothing.
    assert drive.on(600.0, v=2.0, slip=0.08, effort=0.45) == {Calibration.PULLING}
    assert drive.calibration.scale[0] == before
    refused = drive.calibration.refused[0]
    drive.on(600.0, v=2.0, slip=0.08, effort=0.0)
    assert drive.calibration.refused[0] > refused + 100
    assert drive.calibration.scale[0] == pytest.approx(before, rel=2e-3)
    # The road again: still right.
    drive.on(60.0)
    assert drive.calibration.radius[0] == pytest.approx(0.85, rel=0.005)


def test_a_radius_learnt_on_soft_ground_is_put_right_on_the_road():
    drive = Drive(noise=0.02)
    drive.on(60.0, slip=0.08)
    assert drive.calibration.radius[0] == pytest.approx(0.85 * 0.92, rel=0.01)
    drive.on(20.0)
    assert drive.calibration.radius[0] == pytest.approx(0.85, rel=0.01)


def test_a_wheel_that_pulls_does_not_hold_up_the_others():
    drive = Drive((0.8, 0.8))
    drive.on(30.0, slip=np.array([0.0, 0.1]), effort=np.array([0.0, 0.4]))
    assert drive.calibration.radius[0] == pytest.approx(0.85, rel=0.005)
    assert drive.calibration.radius[1] == 0.8
    assert drive.calibration.measured[1] == 0


def test_reverse_calibrates_as_well():
    drive = Drive()
    drive.on(30.0, v=-2.0)
    assert drive.calibration.radius[0] == pytest.approx(0.85, rel=0.005)


def test_a_locked_wheel_is_refused():
    drive = Drive((0.8, 0.8))
    for _ in range(100):
        drive.t += DT
        drive.distance += 0.3
        drive.angle = drive.angle + np.array([0.3 / 0.85, 0.0])
        drive.calibration.advance(drive.t, drive.angle, drive.distance, 0.0)
    assert drive.calibration.refused[1] > 0
    assert drive.calibration.scale[1] == 1.0


def test_reset_starts_from_the_nominal_radii():
    drive = Drive()
    drive.on(20.0)
    drive.calibration.reset()
    assert drive.calibration.radius[0] == 0.8
    assert drive.calibration.measured[0] == 0


@pytest.mark.parametrize(
    ('arguments', 'named'),
    [
        ((1.0, [1.0, 2.0], 1.0, 0.0), 'angles of 1 wheels'),
        ((1.0, [math.nan], 1.0, 0.0), 'angles of 1 wheels'),
        ((math.nan, [1.0], 1.0, 0.0), 'not finite'),
        ((0.0, [1.0], 1.0, 0.0), 'before 0.5 s'),
    ],
)
def test_what_is_not_usable_is_named(arguments, named):
    calibration = RollingRadius([0.8])
    calibration.advance(0.5, [0.0], 0.0, 0.0)
    with pytest.raises(ValueError, match=named):
        calibration.advance(*arguments)


@pytest.mark.parametrize(
    ('make', 'named'),
    [
        (lambda: RollingRadius([0.8, 0.0]), 'nominal radii'),
        (lambda: RollingRadius([0.8], deviation=0.0), 'deviation'),
        (lambda: FirmGround(stretch=-1.0), 'stretch'),
        (lambda: FirmGround(largest_effort=math.nan), 'largest_effort'),
    ],
)
def test_parameters_out_of_range_are_named(make, named):
    with pytest.raises(ValueError, match=named):
        make()
