"""Wheel speed from counted pulses, by the angle that they add up to.

A tachometer that counts n pulses a turn tells the angle of its wheel to within one pulse,
``2*pi/n``, but its speed over a sampling period dt only to within ``2*pi/(n*dt)``: of 200 pulses
at 100 Hz, 3 rad/s. So the angle is what is filtered, by a Kalman filter with the state angle,
speed and acceleration of every wheel:

    theta' = omega,   omega' = alpha + white noise,   alpha' = white noise

and the count as a measurement of theta. Unlike other noise, the error of a count is bounded: what
is expected cannot be more than half a pulse off the middle of the pulse that is counted. While it
is not, wheels turn evenly and noise is small; where it is, the wheel has changed its speed in a
way that was not expected, and the speed is known less, by about the excess over one period.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_model.kernel import kernel

Array = NDArray[np.float64]

ACCELERATION_NOISE = 1.0
"""White noise of the acceleration's rate of change, (rad/s^3)^2 per Hz."""

SPEED_NOISE = 0.02
"""White noise of the acceleration, (rad/s^2)^2 per Hz."""

SLACK = 1.2
"""Distance of what is expected from the middle of the pulse, in half pulses, that is allowed."""

SURPRISE = 0.2
"""Share of the square of (excess over a period) by which the variance of speed grows."""


@kernel
def follow_pulses(state, covariance, turned, pulse, dt):
    """Carry the filters of all wheels over one sampling period, in place.

    Parameters
    ----------
    state : ndarray, shape (n, 3)
        Angle less the counted one, rad, speed, rad/s, acceleration, rad/s^2, of every wheel.
    covariance : ndarray, shape (n, 3, 3)
        Their covariances, in products of these units.
    turned : ndarray, shape (n,)
        Angle counted over the period, rad.
    pulse : float
        Angle of a pulse, rad, above 0.
    dt : float
        Length of the period, s, above 0.
    """
    variance = pulse * pulse / 12.0
    allowed = SLACK * pulse / 2.0
    for j in range(turned.size):
        x, p = state[j], covariance[j]
        x[0] += (x[1] + 0.5 * dt * x[2]) * dt - turned[j]
        x[1] += dt * x[2]
        # Rows, then columns, of the transition [1 dt dt^2/2; 0 1 dt; 0 0 1].
        for k in range(3):
            p[0, k] += dt * p[1, k] + 0.5 * dt * dt * p[2, k]
            p[1, k] += dt * p[2, k]
        for k in range(3):
            p[k, 0] += dt * p[k, 1] + 0.5 * dt * dt * p[k, 2]
            p[k, 1] += dt * p[k, 2]
        p[0, 0] += SPEED_NOISE * dt**3 / 3.0
        p[0, 1] += SPEED_NOISE * dt**2 / 2.0
        p[1, 0] += SPEED_NOISE * dt**2 / 2.0
        p[1, 1] += SPEED_NOISE * dt
        p[2, 2] += ACCELERATION_NOISE * dt
        excess = abs(x[0]) - allowed
        if excess > 0.0:
            p[1, 1] += SURPRISE * (excess / dt) ** 2
        total = p[0, 0] + variance
        gain = p[:, 0] / total
        innovation = -x[0]
        # Joseph's form, (I - K*h)*P*(I - K*h)' + K*r*K' with h = [1, 0, 0].
        left = np.eye(3)
        left[:, 0] -= gain
        p[:] = left @ p @ left.T + variance * np.outer(gain, gain)
        x += gain * innovation


class WheelSpeedFilter:
    """Wheel speeds of a vehicle from what its tachometers counted.

    Parameters
    ----------
    pulses_per_turn : float
        Pulses of one turn of the wheel, at least 0; 0: readings are speeds and go through.

    Attributes
    ----------
    omega : ndarray, shape (n,)
        Wheel speeds, rad/s, forward positive; empty before the first reading.
    variance : ndarray, shape (n,)
        Their variances, rad^2/s^2; 0 of readings that go through.

    Raises
    ------
    ValueError
        If `pulses_per_turn` is negative or not finite.
    """

    def __init__(self, pulses_per_turn: float) -> None:
        if not (math.isfinite(pulses_per_turn) and pulses_per_turn >= 0):
            raise ValueError(f'pulses_per_turn must be at least 0, got {pulses_per_turn}')
        self._pulse = 2.0 * math.pi / pulses_per_turn if pulses_per_turn else 0.0
        self.reset()

    def reset(self) -> None:
        """Forget all readings."""
        self.omega: Array = np.zeros(0)
        self.variance: Array = np.zeros(0)
        self._state = np.zeros((0, 3))
        self._covariance = np.zeros((0, 3, 3))

    def update(self, readings: ArrayLike, dt: float) -> Array:
        """Take in a reading of all wheels.

        Parameters
        ----------
        readings : array_like, shape (n,)
            Mean speed over the period as counted, rad/s, forward positive.
        dt : float
            Length of the period, s, above 0.

        Returns
        -------
        ndarray, shape (n,)
            `omega`.

        Raises
        ------
        ValueError
            If a reading is not finite, their number changes, or the period is not above 0.
        """
        read = np.asarray(readings, dtype=float)
        if not np.all(np.isfinite(read)):
            raise ValueError(f'wheel speeds must be finite, got {readings!r}')
        if not (math.isfinite(dt) and dt > 0):
            raise ValueError(f'dt must be above 0 s, got {dt}')
        if self.omega.size not in (0, read.size):
            raise ValueError(f'expected {self.omega.size} wheel speeds, got {read.size}')
        if not self._pulse:
            self.omega, self.variance = read.copy(), np.zeros(read.size)
        elif not self.omega.size:
            self._state = np.zeros((read.size, 3))
            self._state[:, 1] = read
            # A first reading is one pulse in the period off at most; wheels may be speeding up.
            spread = [self._pulse**2 / 12.0, (self._pulse / dt) ** 2 / 6.0, 1.0]
            self._covariance = np.tile(np.diag(spread), (read.size, 1, 1))
        else:
            follow_pulses(self._state, self._covariance, read * dt, self._pulse, dt)
        if self._pulse:
            self.omega = self._state[:, 1].copy()
            self.variance = self._covariance[:, 1, 1].copy()
        return self.omega
