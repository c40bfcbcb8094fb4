"""Precomputed covariance of the slip filter over scheduling parameters.

Scheduling parameters are speed, slip, time since the speed was measured, and time since the soil
changed. At each point of a grid the covariance of the extended Kalman filter is computed for
steady driving on the nominal soil, with readings of the wheels every 10 ms and of the speed every
100 ms. Between grid points it is interpolated linearly over slip and the logarithms of speed and
times. So the gains depend only on these parameters, not on the measurements.
"""

import math

import numpy as np
from numpy.typing import NDArray

from traction_controller.estimation.filter_step import (
    DRAWBAR,
    FIRST_WHEEL,
    PER_WHEEL,
    SPEED,
    VEHICLE_MEMORY,
    WHEEL_MEMORY,
    Body,
    Noise,
    WheelSample,
    initialise,
    reset_soil,
    update_speed,
    update_wheels,
)
from traction_controller.estimation.kalman import Method
from traction_controller.estimation.wheel_contact import quasi_static
from traction_model.interpolation import GridTable
from traction_model.soil.rut import fresh_ruts
from traction_model.vehicle.wheel import FRICTION, RADIUS, STATIC_LOAD, TRACK

SPEEDS = (0.5, 1.5, 4.0, 10.0)
"""Speeds of the grid, m/s."""
SLIPS = (0.03, 0.12, 0.3)
"""Slips of the grid, the same for all wheels, dimensionless."""
SILENCES = (0.1, 0.5, 1.5, 4.0)
"""Times since the speed was measured, s."""
AGES = (0.05, 0.3, 1.0, 3.0, 10.0)
"""Times since the soil changed, s; the covariance is constant beyond the last."""
WHEEL_PERIOD, SPEED_PERIOD = 0.01, 0.1
"""Periods of the readings of the wheels, and of the speed, s."""
OLD = 30.0
"""Age of a soil that never changed, s, and time driven on it before a change, s."""


class ScheduledCovariance:
    """Covariance over speed, slip, time without measured speed, and time since a change of soil.

    Parameters
    ----------
    body : Body
        Vehicle and nominal soil.
    noise : Noise
        Noise of the filter.
    speed_variance : float
        Variance of a measured speed, m^2/s^2, above 0.
    unknown_drawbar : float
        Initial standard deviation of the drawbar, N.
    nominal : float
        Initial deviation of the soil factors, as a share of that after a change, dimensionless.
    """

    def __init__(
        self,
        body: Body,
        noise: Noise,
        speed_variance: float,
        unknown_drawbar: float,
        nominal: float,
    ) -> None:
        self._body, self._noise = body, noise
        self._speed_variance = speed_variance
        self._start = (unknown_drawbar, nominal)
        m = FIRST_WHEEL + PER_WHEEL * len(body.wheels)
        axes = [np.log(SPEEDS), np.array(SLIPS), np.log(SILENCES), np.log([*AGES, OLD])]
        table = np.zeros((*(len(axis) for axis in axes), m, m))
        for a, v in enumerate(SPEEDS):
            for b, slipping in enumerate(SLIPS):
                self._fill(table[a, b], v, slipping)
        self._table = GridTable(axes, table)

    def look_up(
        self, v: float, slipping: float, silence: float, age: float, p: NDArray[np.float64]
    ) -> None:
        """Interpolate the covariance.

        Parameters
        ----------
        v : float
            Speed, m/s, at least 0.
        slipping : float
            Mean slip of the wheels, without sign, dimensionless.
        silence, age : float
            Times since the speed was measured and since the soil changed, s.
        p : ndarray, shape (m, m)
            Out: covariance of the state, in products of its units.
        """
        least = 1e-3
        p[:] = self._table.at(
            math.log(max(v, least)), slipping, math.log(max(silence, least)),
            math.log(max(age, least)),
        )  # fmt: skip

    def _fill(self, table: NDArray[np.float64], v: float, slipping: float) -> None:
        """Compute the covariances at one speed and slip, shape (silences, ages, m, m)."""
        drive = _SteadyDrive(self._body, self._noise, self._speed_variance, v, slipping)
        drive.initialise(*self._start)
        drive.drive(OLD / 3)
        drive.record(table[:, -1])
        drive.change_soil()
        past = 0.0
        for k, age in enumerate(AGES):
            drive.drive(age - past)
            past = age
            drive.record(table[:, k])


class _SteadyDrive:
    """Extended Kalman filter in steady driving; only its covariance changes."""

    def __init__(
        self, body: Body, noise: Noise, speed_variance: float, v: float, slipping: float
    ) -> None:
        self._noise, self._speed_variance, self._v = noise, speed_variance, v
        n = len(body.wheels)
        m = FIRST_WHEEL + PER_WHEEL * n
        self._x, self._p = np.zeros(m), np.zeros((m, m))
        self._wheel_memory = np.zeros(n, WHEEL_MEMORY)
        self._vehicle_memory = np.zeros(1, VEHICLE_MEMORY)
        # Every wheel on undisturbed soil.
        self._ruts = fresh_ruts(0, 0.0)
        wheels = body.wheels.copy()
        wheels[:, TRACK] = -1.0
        self._body = body._replace(wheels=wheels)
        soil = np.empty((1, body.soils.shape[1]))
        self._omega, self._torque, self._drawbar = np.zeros(n), np.zeros(n), 0.0
        self._sample = WheelSample(self._omega, self._torque, *np.zeros((3, n)))
        for j, wheel in enumerate(wheels):
            self._omega[j] = v / (1.0 - slipping) / wheel[RADIUS]
            moment, resistance, *_ = quasi_static(
                v, self._omega[j], wheel[STATIC_LOAD], 0.0, (0.0, 0.0, 0.0), body.soils[j], wheel,
                self._ruts, 0.0, soil,
            )  # fmt: skip
            self._torque[j] = moment + wheel[FRICTION] * self._omega[j]
            self._drawbar += moment / wheel[RADIUS] - resistance
            self._wheel_memory['resistance'][j] = resistance

    def initialise(self, unknown_drawbar: float, nominal: float) -> None:
        initialise(
            0.0, self._sample, self._x, self._p, self._wheel_memory, self._vehicle_memory,
            self._body, self._noise,
        )  # fmt: skip
        self._x[SPEED], self._x[DRAWBAR] = self._v, self._drawbar
        self._p[SPEED, SPEED] = self._speed_variance
        self._p[DRAWBAR, DRAWBAR] = unknown_drawbar**2
        for j in range(len(self._omega)):
            reset_soil(self._x, self._p, j, self._body.changed * nominal**2, False)
        self._wheel_memory['held_until'] = -1.0
        self._vehicle_memory['travelled'] = 1e3
        self._vehicle_memory['soil_changed_at'] = -math.inf
        self._state = (self._x, self._p, self._wheel_memory, self._vehicle_memory)

    def change_soil(self) -> None:
        for j in range(len(self._omega)):
            reset_soil(self._x, self._p, j, self._body.changed, False)
        self._wheel_memory['held_until'] = self._vehicle_memory['travelled']
        self._vehicle_memory['soil_changed_at'] = self._vehicle_memory['time']

    def drive(self, time: float, measured: bool = True) -> None:
        """Continue the steady drive for a time."""
        every = round(SPEED_PERIOD / WHEEL_PERIOD)
        steps = round(time / WHEEL_PERIOD)
        for k in range(steps):
            # Restore the state: only the covariance is needed.
            self._x[SPEED], self._x[DRAWBAR] = self._v, self._drawbar
            self._x[FIRST_WHEEL:] = 0.0
            update_wheels(
                int(Method.EKF), self._vehicle_memory['time'][0] + WHEEL_PERIOD, self._sample,
                self._x, self._p, self._wheel_memory, self._vehicle_memory, self._ruts,
                self._body, self._noise,
            )  # fmt: skip
            if measured and (steps - k) % every == every - 1:
                update_speed(self._x, self._p, self._v, self._speed_variance)

    def record(self, table: NDArray[np.float64]) -> None:
        """Store the covariance now, and its growth without measured speed."""
        kept = [part.copy() for part in self._state]
        table[0] = self._p
        for k in range(1, len(SILENCES)):
            self.drive(SILENCES[k] - SILENCES[k - 1], measured=False)
            table[k] = self._p
        for part, copy in zip(self._state, kept, strict=True):
            part[:] = copy
