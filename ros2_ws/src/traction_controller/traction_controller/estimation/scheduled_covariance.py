"""Covariance of the slip filter computed beforehand, over what the vehicle is doing.

How well speed and soil are known depends on the speed, on the slip, on how long the speed has not
been measured and on how long ago the soil changed. For a grid of these the extended filter's
covariance is computed as it drives steadily on the nominal soil with a reading of the wheels
every 10 ms and one of the speed every 100 ms. In between it is interpolated linearly, along the
logarithms of speed and times. A filter that looks it up at every reading has gains that these
parameters alone schedule: what it has measured changes its state, not its gains.
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
    begin,
    doubt_soil,
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
"""Times since the soil changed, s; beyond the last it counts as learnt."""
WHEEL_PERIOD, SPEED_PERIOD = 0.01, 0.1
"""From reading to reading of the wheels, and of the speed, s."""
OLD = 30.0
"""Age of the soil that was never seen to change, s, and how long it is driven on first."""


class ScheduledCovariance:
    """Covariance over speed, slip, silence and age of the soil.

    Parameters
    ----------
    body : Body
        Vehicle and nominal soil.
    noise : Noise
        The filter's.
    speed_variance : float
        Variance of a measured speed, m^2/s^2, above 0.
    unknown_drawbar : float
        Standard deviation of the drawbar at first, N.
    nominal : float
        How much of a change of soil the nominal soil is off, dimensionless.
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
        """Find the covariance that belongs to a state of the vehicle.

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
        drive.begin(*self._start)
        drive.on(OLD / 3)
        drive.record(table[:, -1])
        drive.change_soil()
        past = 0.0
        for k, age in enumerate(AGES):
            drive.on(age - past)
            past = age
            drive.record(table[:, k])


class _SteadyDrive:
    """The extended filter while nothing but its covariance changes."""

    def __init__(
        self, body: Body, noise: Noise, speed_variance: float, v: float, slipping: float
    ) -> None:
        self._noise, self._speed_variance, self._v = noise, speed_variance, v
        n = len(body.wheels)
        m = FIRST_WHEEL + PER_WHEEL * n
        self._x, self._p = np.zeros(m), np.zeros((m, m))
        self._wheel_memory = np.zeros(n, WHEEL_MEMORY)
        self._vehicle_memory = np.zeros(1, VEHICLE_MEMORY)
        # Each on fresh soil.
        self._ruts = fresh_ruts(0, 0.0)
        wheels = body.wheels.copy()
        wheels[:, TRACK] = -1.0
        self._body = body._replace(wheels=wheels)
        soil = np.empty((1, body.soils.shape[1]))
        self._omega, self._torque, self._drawbar = np.zeros(n), np.zeros(n), 0.0
        for j, wheel in enumerate(wheels):
            self._omega[j] = v / (1.0 - slipping) / wheel[RADIUS]
            moment, resistance, *_ = quasi_static(
                v, self._omega[j], wheel[STATIC_LOAD], 0.0, (0.0, 0.0, 0.0), body.soils[j], wheel,
                self._ruts, 0.0, soil,
            )  # fmt: skip
            self._torque[j] = moment + wheel[FRICTION] * self._omega[j]
            self._drawbar += moment / wheel[RADIUS] - resistance
            self._wheel_memory['resistance'][j] = resistance

    def begin(self, unknown_drawbar: float, nominal: float) -> None:
        begin(
            0.0, self._omega, self._torque, self._x, self._p, self._wheel_memory,
            self._vehicle_memory, self._body, self._noise,
        )  # fmt: skip
        self._x[SPEED], self._x[DRAWBAR] = self._v, self._drawbar
        self._p[SPEED, SPEED] = self._speed_variance
        self._p[DRAWBAR, DRAWBAR] = unknown_drawbar**2
        for j in range(len(self._omega)):
            doubt_soil(self._x, self._p, j, self._body.changed * nominal**2, False)
        self._wheel_memory['held_until'] = -1.0
        self._vehicle_memory['travelled'] = 1e3
        self._vehicle_memory['soil_changed_at'] = -math.inf
        self._state = (self._x, self._p, self._wheel_memory, self._vehicle_memory)

    def change_soil(self) -> None:
        for j in range(len(self._omega)):
            doubt_soil(self._x, self._p, j, self._body.changed, False)
        self._wheel_memory['held_until'] = self._vehicle_memory['travelled']
        self._vehicle_memory['soil_changed_at'] = self._vehicle_memory['time']

    def on(self, time: float, measured: bool = True) -> None:
        """Drive on for a time."""
        every = round(SPEED_PERIOD / WHEEL_PERIOD)
        steps = round(time / WHEEL_PERIOD)
        for k in range(steps):
            # Only the covariance is wanted: the state stays where it is.
            self._x[SPEED], self._x[DRAWBAR] = self._v, self._drawbar
            self._x[FIRST_WHEEL:] = 0.0
            update_wheels(
                int(Method.EKF), self._vehicle_memory['time'][0] + WHEEL_PERIOD, self._omega,
                self._torque, self._x, self._p, self._wheel_memory, self._vehicle_memory,
                self._ruts, self._body, self._noise,
            )  # fmt: skip
            if measured and (steps - k) % every == every - 1:
                update_speed(self._x, self._p, self._v, self._speed_variance)

    def record(self, table: NDArray[np.float64]) -> None:
        """Note the covariance now, and as it grows while the speed is not measured."""
        kept = [part.copy() for part in self._state]
        table[0] = self._p
        for k in range(1, len(SILENCES)):
            self.on(SILENCES[k] - SILENCES[k - 1], measured=False)
            table[k] = self._p
        for part, copy in zip(self._state, kept, strict=True):
            part[:] = copy
