"""Sensors of a simulated vehicle: tachometers with counted pulses, and a radar with errors."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Tachometer:
    """Wheel speed from counted pulses.

    A reading is the number of pulses in a sampling period over its length. It has a resolution of
    ``2*pi/(pulses_per_turn*dt)``; the errors cancel in the mean.

    Parameters
    ----------
    n_wheels : int
        Number of wheels.
    pulses_per_turn : float
        Pulses per turn of the wheel, at least 0; 0: ideal tachometer.

    Raises
    ------
    ValueError
        If `pulses_per_turn` is negative or not finite.
    """

    def __init__(self, n_wheels: int, pulses_per_turn: float) -> None:
        if not (math.isfinite(pulses_per_turn) and pulses_per_turn >= 0):
            raise ValueError(f'pulses_per_turn must be at least 0, got {pulses_per_turn}')
        self._pulse = 2 * math.pi / pulses_per_turn if pulses_per_turn else 0.0
        self._angle = np.zeros(n_wheels)
        self._counted = np.zeros(n_wheels)

    def read(self, omega: ArrayLike, dt: float) -> NDArray[np.float64]:
        """Read the wheel speeds at the end of a sampling period.

        Parameters
        ----------
        omega : array_like, shape (n,)
            True wheel speeds, rad/s, forward positive.
        dt : float
            Length of the period, s, above 0.

        Returns
        -------
        ndarray, shape (n,)
            Measured wheel speeds, rad/s.
        """
        omega = np.asarray(omega, dtype=float)
        if not self._pulse:
            return omega.copy()
        self._angle += omega * dt
        pulses = np.floor(self._angle / self._pulse)
        reading = (pulses - self._counted) * self._pulse / dt
        self._counted = pulses
        return np.asarray(reading)


@dataclass(frozen=True)
class RadarModel:
    """Errors of a ground speed radar.

    Attributes
    ----------
    noise : float
        Standard deviation of a reading, m/s, at least 0.
    bias : float
        Relative error of its scale, dimensionless, above -1.
    min_speed : float
        Smallest speed that it measures, m/s, at least 0.
    latency : float
        Time from measurement to delivery, s, at least 0.
    """

    noise: float = 0.05
    bias: float = 0.0
    min_speed: float = 0.2
    latency: float = 0.0

    def __post_init__(self) -> None:
        for name, least in (('noise', 0), ('bias', -1), ('min_speed', 0), ('latency', 0)):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= least):
                raise ValueError(f'radar {name} must be at least {least}, got {value}')


class Radar:
    """Ground speed radar.

    Parameters
    ----------
    model : RadarModel
        Errors of the radar.
    seed : int
        Seed of its noise.
    """

    def __init__(self, model: RadarModel, seed: int) -> None:
        self.model = model
        self._random = np.random.default_rng(seed)
        self._under_way: deque[tuple[float, float]] = deque()

    def measure(self, t: float, v: float) -> None:
        """Measure the speed, unless it is below the smallest measurable one.

        Parameters
        ----------
        t : float
            Time, s, not decreasing from call to call.
        v : float
            True speed, m/s.
        """
        noise = self.model.noise * self._random.standard_normal()
        if abs(v) >= self.model.min_speed:
            self._under_way.append((t, v * (1 + self.model.bias) + noise))

    def deliver(self, t: float) -> list[tuple[float, float]]:
        """Measurements whose latency has passed, each once.

        Parameters
        ----------
        t : float
            Time, s, not decreasing from call to call.

        Returns
        -------
        list of (float, float)
            Time of measurement, s, and measured speed, m/s, oldest first.
        """
        delivered = []
        while self._under_way and self._under_way[0][0] + self.model.latency <= t + 1e-9:
            delivered.append(self._under_way.popleft())
        return delivered
