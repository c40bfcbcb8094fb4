"""Calibration of a vehicle's radii: choice of the source, and ends of a measurement."""

import math

import numpy as np
import pytest

from traction_controller.estimation.gnss import GnssTrack
from traction_controller.estimation.radius_calibration import GroundSource, RadiusCalibration
from traction_controller.estimation.rolling_radius import Calibration
from traction_model.vehicle.vehicle import load_vehicle

TRACTOR = load_vehicle('tractor_4wd')
NOMINAL = np.array([wheel.radius for wheel in TRACTOR.wheels])
# True radii: smaller in front, larger behind.
TRUE = NOMINAL * [0.95, 0.95, 1.04, 1.04]


class Drive:
    """The tractor at 100 Hz, rolling at 3 m/s, with sources of speed and position at 10 Hz."""

    def __init__(self, latency=0.0):
        self.calibration = RadiusCalibration(TRACTOR)
        self.track = GnssTrack(latency=latency)
        self.latency = latency
        self.t = self.x = 0.0

    def on(self, seconds, v=3.0, effort=0.05, radar=None, velocity=None, fixes=False):
        """Continue the drive; sensors have the given scale factors, None: no reading."""
        thrust = effort * TRACTOR.static_loads()
        for k in range(round(seconds * 100)):
            self.t += 0.01
            self.x += 0.01 * v
            self.calibration.wheels(self.t, v / TRUE, thrust)
            self.track.wheels(self.t, v)
            if k % 10:
                continue
            if fixes:
                # Measured now, stamped later; the track compensates this latency.
                self.track.fix(self.t + self.latency, [self.x, 0.0])
                self.calibration.fix(self.track)
            if velocity:
                self.calibration.speed(GroundSource.VELOCITY, self.t, velocity * v)
            if radar:
                self.calibration.speed(GroundSource.RADAR, self.t, radar * v)
        return self.calibration


@pytest.mark.parametrize(
    'sources', [{'radar': 1.0}, {'velocity': 1.0}, {'fixes': True}, {'fixes': True, 'radar': 1.1}]
)
def test_every_source_finds_the_radii(sources):
    calibration = Drive().on(15.0, **sources)
    assert calibration.radius == pytest.approx(TRUE, rel=0.005)
    assert np.all(calibration.radius_variance <= (0.01 * NOMINAL) ** 2)


def test_better_source_counts_and_a_worse_one_once_it_is_silent():
    # A radar with a scale error of 2 %, and a satellite receiver.
    drive = Drive()
    calibration = drive.on(15.0, velocity=1.0, radar=1.02)
    assert calibration.radius == pytest.approx(TRUE, rel=0.003)
    # Alone, and for longer than 2 s, it pulls the radii its way.
    drive.on(60.0, radar=1.02)
    assert calibration.radius == pytest.approx(1.02 * TRUE, rel=0.01)
    assert np.all(calibration.radius > 1.005 * TRUE)


def test_radii_are_nominal_until_they_are_known_to_one_percent():
    drive = Drive()
    # One stretch of 2 m, 0.7 s, leaves 3.3e-4 of variance (see test_rolling_radius.py).
    calibration = drive.on(1.0, radar=1.0)
    assert np.array_equal(calibration.radius, NOMINAL)
    assert calibration.radius_variance == pytest.approx((0.05 * NOMINAL) ** 2)
    assert not np.array_equal(drive.on(5.0, radar=1.0).radius, NOMINAL)


def test_a_wheel_that_pulls_is_not_calibrated():
    calibration = Drive().on(15.0, effort=np.array([0.05, 0.05, 0.3, -0.3]), radar=1.0)
    assert calibration.radius[:2] == pytest.approx(TRUE[:2], rel=0.005)
    assert np.array_equal(calibration.radius[2:], NOMINAL[2:])
    drive = Drive()
    assert np.array_equal(drive.on(15.0, effort=0.3, radar=1.0).radius, NOMINAL)
    assert drive.calibration.state is Calibration.PULLING


def test_latency_of_positions_does_not_matter():
    calibration = Drive(latency=0.2).on(15.0, fixes=True)
    assert calibration.radius == pytest.approx(TRUE, rel=0.005)


@pytest.mark.parametrize('gap', [0.6, 30.0])
def test_wheels_that_were_silent_leave_no_wrong_radius(gap):
    drive = Drive()
    known = drive.on(15.0, radar=1.0).radius.copy()
    # The vehicle moves on without readings of the wheels.
    drive.t += gap
    drive.x += 3.0 * gap
    calibration = drive.on(5.0, radar=1.0)
    assert calibration.radius == pytest.approx(known, rel=2e-3)


def test_a_clock_that_was_set_back_keeps_the_radii():
    drive = Drive()
    known = drive.on(15.0, radar=1.0).radius.copy()
    drive.t = 0.0
    drive.calibration.restart()
    calibration = drive.on(15.0, radar=1.0)
    assert calibration.state is Calibration.CALIBRATING
    assert calibration.radius == pytest.approx(known, rel=2e-3)
    # Measurements went on: a drift of 1e-5 per root of a metre is all that variance would gain.
    assert np.all(calibration.radius_variance <= (0.0045 * NOMINAL) ** 2)


def test_late_readings_are_passed_over():
    drive = Drive()
    known = drive.on(15.0, radar=1.0).radius.copy()
    drive.calibration.wheels(drive.t - 0.1, [math.pi] * 4, np.zeros(4))
    drive.calibration.speed(GroundSource.RADAR, drive.t - 0.3, 30.0)
    assert np.array_equal(drive.calibration.radius, known)
    assert drive.on(5.0, radar=1.0).radius == pytest.approx(known, rel=2e-3)
