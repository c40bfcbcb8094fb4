"""Sensors of a simulated vehicle: tachometers that count teeth, a radar with its faults."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Tachometer:
    """Wheel speed from counted pulses.

    The pulses of every sampling period are counted and divided by its length, so that the
    reading is quantised in steps of ``2*pi/(pulses_per_turn*dt)`` whose error averages out.

    Parameters
    ----------
    n_wheels : int
        Number of wheels.
    pulses_per_turn : float
        Pulses of one turn of the wheel, at least 0; 0 stands for an ideal tachometer.

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
    """Faults of a ground speed radar.

    Attributes
    ----------
    noise : float
        Standard deviation of a reading, m/s, at least 0.
    bias : float
        Relative error of its scale, dimensionless, above -1.
    min_speed : float
        Speed below which it gives no reading, m/s, at least 0.
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
    """A ground speed radar.

    Parameters
    ----------
    model : RadarModel
        Its faults.
    seed : int
        Seed of its noise, so that a run can be repeated.
    """

    def __init__(self, model: RadarModel, seed: int) -> None:
        self.model = model
        self._random = np.random.default_rng(seed)
        self._under_way: deque[tuple[float, float]] = deque()

    def measure(self, t: float, v: float) -> None:
        """Take a measurement, which gets under way unless the radar is blind.

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
        """Deliver the measurements whose latency has passed, each once.

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
