"""Closed loop of plant, sensors and the shipped loop: estimator, slip control and gate.

In every sampling period `TractionLoop` receives the driver's request, a reading of the wheels, and
radar readings after their latency, in the order of messages from the plant node. Torques after the
gate reach the plant after a transport delay. One seed determines all noise. A copy
(`copy.deepcopy`) continues with the same noise.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from traction_evaluation.closed_loop.perfect_estimator import PerfectEstimator
from traction_evaluation.loop.traction_loop import TractionLoop
from traction_model.simulation.plant import Plant
from traction_model.simulation.sensors import Radar, RadarModel, Tachometer
from traction_model.slip import slips

Array = NDArray[np.float64]

DT = 0.01
"""Sampling period of sensors and control, s: 100 Hz."""


@dataclass(frozen=True)
class Sensors:
    """Errors of the sensors of a vehicle.

    Attributes
    ----------
    pulses_per_turn : float
        Pulses of a tachometer in one turn of the wheel, at least 0; 0: ideal.
    radar : RadarModel
        Noise, m/s, latency, s, and smallest speed, m/s, of the radar.
    radar_period : float
        Period of its readings, s, above 0; rounded to whole sampling periods.
    torque_noise : float
        Standard deviation of a reading of shaft torque, over static load times radius of the
        wheel, dimensionless, at least 0.
    """

    pulses_per_turn: float = 0.0
    radar: RadarModel = RadarModel()
    radar_period: float = 0.05
    torque_noise: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.torque_noise) and self.torque_noise >= 0):
            raise ValueError(f'torque_noise must be at least 0, got {self.torque_noise}')
        if not (math.isfinite(self.radar_period) and self.radar_period > 0):
            raise ValueError(f'radar_period must be above 0 s, got {self.radar_period}')


@dataclass(frozen=True)
class Drive:
    """Recording of a closed loop; k samples, n wheels.

    Attributes
    ----------
    t : ndarray, shape (k,)
        Time, s.
    v, x : ndarray, shape (k,)
        True speed, m/s, forward positive, and distance, m.
    v_estimate : ndarray, shape (k,)
        Estimated speed, m/s; the true one without estimation.
    net_traction : ndarray, shape (k,)
        Net traction of all wheels, N, forward positive.
    target : ndarray, shape (k,)
        Slip target, dimensionless; NaN without control.
    rim_speed : ndarray, shape (k, n)
        r*omega, m/s, forward positive.
    shaft_power : ndarray, shape (k,)
        Power of all shafts, W.
    slip, slip_estimate : ndarray, shape (k, n)
        True and estimated slip, -1 to 1; both true without estimation.
    command : ndarray, shape (k, n)
        Torque sent, N·m, forward positive.
    """

    t: Array
    v: Array
    x: Array
    v_estimate: Array
    net_traction: Array
    shaft_power: Array
    target: Array
    rim_speed: Array
    slip: Array
    slip_estimate: Array
    command: Array

    def efficiency(self, start: float = 0.0) -> tuple[float, float]:
        """Tractive work and shaft energy from a time on.

        Parameters
        ----------
        start : float
            Time, s.

        Returns
        -------
        work, energy : float
            Work of net traction, and energy of all shafts, J (N·m).
        """
        judged = self.t >= start
        dt = float(self.t[1] - self.t[0])
        work = float(np.sum(self.net_traction[judged] * self.v[judged])) * dt
        return work, float(np.sum(self.shaft_power[judged])) * dt


class ClosedLoop:
    """Simulated vehicle under slip control with its sensors.

    Parameters
    ----------
    plant : Plant
        Vehicle on its soil, with the lag of its drive.
    loop : TractionLoop or None
        Estimator, slip control and gate; None: wheels have the requested torque.
    sensors : Sensors
        Errors of the sensors.
    seed : int
        Seed of all noise, at least 0.
    delay : float
        Time from sensors to the drive, s, at least 0; rounded to whole sampling periods.
    perfect : bool
        True to replace the estimator of the loop by a `PerfectEstimator` of the plant.

    Raises
    ------
    ValueError
        If the delay is out of range.
    """

    def __init__(
        self,
        plant: Plant,
        loop: TractionLoop | None,
        sensors: Sensors,
        seed: int,
        *,
        delay: float = 0.02,
        perfect: bool = False,
    ) -> None:
        if not (math.isfinite(delay) and delay >= 0):
            raise ValueError(f'delay must be at least 0 s, got {delay}')
        self.plant = plant
        self.loop = loop
        if loop is not None and perfect:
            loop.estimator = PerfectEstimator(plant)
        self.sensors = sensors
        vehicle = plant.vehicle
        radii = np.array([wheel.radius for wheel in vehicle.wheels])
        self._torque_noise = sensors.torque_noise * vehicle.static_loads() * radii
        n = plant.n_wheels
        self._tachometer = Tachometer(n, sensors.pulses_per_turn)
        self._radar = Radar(sensors.radar, seed)
        self._random = np.random.default_rng((seed, 1))
        self._radar_every = max(1, round(sensors.radar_period / DT))
        self._under_way = deque([[0.0] * n] * round(delay / DT))
        self._steps = 0
        self._rows: list[list[float]] = []

    def set_target(self, target: float) -> None:
        """Set the slip target of the loop.

        Parameters
        ----------
        target : float
            0.01 to 0.9.

        Raises
        ------
        ValueError
            If it is out of range, or there is no loop.
        """
        if self.loop is None:
            raise ValueError('there is no slip control to give a target to')
        self.loop.slip_target(target)

    def step(self, request: Sequence[float]) -> None:
        """Read the sensors, compute the torque and advance by one sampling period.

        Parameters
        ----------
        request : sequence of float
            Requested torque of every wheel, N·m, forward positive.

        Raises
        ------
        ValueError
            If a torque is not finite, or their number is wrong.
        """
        plant, loop = self.plant, self.loop
        t, v, n = self._steps * DT, plant.v, plant.n_wheels
        omega, shaft = plant.omega, plant.shaft_torque
        measured_omega = self._tachometer.read(omega, DT)
        measured_torque = shaft + self._torque_noise * self._random.standard_normal(n)
        if self._steps % self._radar_every == 0:
            self._radar.measure(t, v)
        readings = self._radar.deliver(t)
        net_traction = float(plant.net_traction.sum())
        if loop is None:
            torque, target = list(request), math.nan
            v_estimate, slip_estimate = v, list(plant.slip)
        else:
            loop.torque_request(t, request)
            torque = loop.wheel_states(t, t, measured_omega.tolist(), measured_torque.tolist())
            target = loop.controller.control.slip_target
            v_estimate, slip_estimate = loop.estimator.v, loop.estimator.slip.tolist()
            for stamp, speed in readings:
                loop.radar(stamp, speed, max(self.sensors.radar.noise, 1e-3) ** 2)
        self._rows.append(
            [
                t, v, plant.x, v_estimate, net_traction, float(shaft @ omega), target,
                *plant.rim_speed.tolist(), *slip_estimate, *torque,
            ]
        )  # fmt: skip
        self._under_way.append(torque)
        plant.step(self._under_way.popleft(), DT)
        self._steps += 1

    @property
    def t(self) -> float:
        """Time, s."""
        return self._steps * DT

    def drive(self) -> Drive:
        """Recording so far.

        Returns
        -------
        Drive
            In SI units, one row per sampling period.
        """
        n = self.plant.n_wheels
        rows = np.array(self._rows).reshape(-1, 7 + 3 * n)
        t, v, x, v_estimate, net, power, target = rows[:, :7].T.copy()
        rims, estimates, torques = (
            np.ascontiguousarray(rows[:, a:b]) for a, b in pairwise(range(7, 8 + 3 * n, n))
        )
        return Drive(
            t, v, x, v_estimate, net, power, target, rims, slips(v, rims), estimates, torques
        )
