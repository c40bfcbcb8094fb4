"""Calibration of a vehicle's rolling radii against the best available distance over ground.

One source is used at a time: positions of a satellite receiver, else its velocity, else the radar.
A worse source is used only after the better ones have timed out. Without such a source, errors of
the radius and slip cannot be distinguished. An error of the radar's scale goes into the radii.
"""

import math
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_controller.estimation.gnss import GnssTrack
from traction_controller.estimation.rolling_radius import Calibration, FirmGround, RollingRadius
from traction_model.vehicle.vehicle import Vehicle

Array = NDArray[np.float64]


class GroundSource(IntEnum):
    """Sources of the distance over ground, best first."""

    POSITION = 0
    VELOCITY = 1
    RADAR = 2


class RadiusCalibration:
    """Calibration of the rolling radii of a vehicle.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle with its nominal radii, SI units.
    ground : FirmGround
        Conditions and deviations of a measurement.

    Attributes
    ----------
    radius : ndarray, shape (n,)
        Radii to use, m: nominal until the first calibration.
    radius_variance : ndarray, shape (n,)
        Their variance, m^2.
    """

    # Timeout of a source, s, after which a worse one replaces it.
    _SILENCE = 2.0
    # Largest interval between readings of the wheels, or of a speed, for the integration, s.
    _LONGEST_GAP = 0.5
    # Gap after a restart, s: long enough to end a running measurement.
    _RESTART = 10.0

    def __init__(self, vehicle: Vehicle, ground: FirmGround = FirmGround()) -> None:
        self._rolling = RollingRadius([wheel.radius for wheel in vehicle.wheels], ground)
        self._loads = vehicle.static_loads()
        self.radius = self._rolling.radius
        self.radius_variance = self._variance()
        self._offset = self._advanced = 0.0
        self.restart()

    def restart(self) -> None:
        """Restart after the clock was set; the radii are kept."""
        n = len(self._loads)
        self._offset = self._advanced + self._RESTART
        self._t = math.nan
        self._omega = np.zeros(n)
        self._angle = np.zeros(n)
        self._efforts = np.zeros(n)
        self._readings = 0
        self._broken = True
        self._source: GroundSource | None = None
        self._source_t = -math.inf
        # For each source of speed: time, s, speed, m/s, distance so far, m.
        self._speeds: dict[GroundSource, tuple[float, float, float]] = {}

    @property
    def state(self) -> Calibration:
        """State of the calibration: running, or the reason for its pause."""
        return self._rolling.state

    def wheels(self, t: float, omega: ArrayLike, gross_traction: ArrayLike) -> None:
        """Update with wheel speeds and gross traction.

        Parameters
        ----------
        t : float
            Time of measurement, s. Late readings are ignored.
        omega : array_like, shape (n,)
            Wheel speeds, rad/s, forward positive.
        gross_traction : array_like, shape (n,)
            Gross traction, N.
        """
        dt = t - self._t
        if dt < 0.0:
            return
        speeds = np.asarray(omega, dtype=float)
        if dt <= self._LONGEST_GAP:
            self._angle = self._angle + 0.5 * dt * (self._omega + speeds)
        else:
            self._broken = True
        self._t, self._omega = t, speeds
        self._efforts += np.abs(gross_traction) / self._loads
        self._readings += 1

    def fix(self, track: GnssTrack) -> None:
        """Update with the track of a satellite receiver, after each fix.

        Parameters
        ----------
        track : GnssTrack
            Track with its latency compensated.
        """
        if track.valid and track.t is not None:
            self._compare(GroundSource.POSITION, track.t, track.distance, track.heading)

    def speed(self, source: GroundSource, t: float, v: float) -> None:
        """Update with the integral of a speed.

        Parameters
        ----------
        source : GroundSource
            `VELOCITY` or `RADAR`.
        t : float
            Time of measurement, latency compensated, s. Late readings are ignored.
        v : float
            Speed over ground, m/s, forward positive.
        """
        before, speed, distance = self._speeds.get(source, (math.nan, 0.0, 0.0))
        dt = t - before
        if dt < 0.0:
            return
        seen = dt <= self._LONGEST_GAP
        distance += 0.5 * (speed + v) * dt if seen else 0.0
        self._speeds[source] = t, v, distance
        self._compare(source, t, distance if seen else math.nan)

    def _compare(
        self, source: GroundSource, t: float, distance: float, heading: float = math.nan
    ) -> None:
        worse = self._source is not None and source > self._source
        if worse and t - self._source_t <= self._SILENCE:
            return
        if source is not self._source:
            # Distances of different sources have different origins.
            self._source, self._broken = source, True
        self._source_t = t
        if not self._readings or self._offset + t <= self._advanced:
            return
        if self._broken:
            distance = math.nan
        self._broken = False
        self._advanced = self._offset + t
        # Angles of the wheels at that time.
        angle = self._angle + self._omega * (t - self._t)
        effort = self._efforts / self._readings
        self._efforts = np.zeros(len(self._loads))
        self._readings = 0
        self._rolling.advance(self._advanced, angle, distance, effort, heading)
        known = self._rolling.calibrated
        self.radius = np.where(known, self._rolling.radius, self.radius)
        self.radius_variance = np.where(known, self._variance(), self.radius_variance)

    def _variance(self) -> Array:
        return np.asarray(self._rolling.nominal**2 * self._rolling.scale_variance)
