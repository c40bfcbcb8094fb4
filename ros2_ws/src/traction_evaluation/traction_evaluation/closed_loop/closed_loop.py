"""Closed loop of plant, sensors, estimation and slip control, as it runs on a vehicle.

Every sampling period: tachometers and shaft torques are read, radar readings whose latency has
passed come in, slip is estimated, torque is found, and goes to the plant after a transport
delay. All noise follows from one seed. A copy (`copy.deepcopy`) goes on with the same noise, so
that two copies differ by what is done to them alone.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from traction_controller.control.slip_control import SlipControl
from traction_controller.control.slip_state import SlipState
from traction_controller.estimation.slip_filter import SlipFilter, Source
from traction_model.contact.contact import shear_deficit
from traction_model.simulation.plant import Plant
from traction_model.simulation.sensors import Radar, RadarModel, Tachometer
from traction_model.slip import slips
from traction_model.soil.terrain import soil_row

Array = NDArray[np.float64]

DT = 0.01
"""Sampling period of sensors and control, s: 100 Hz."""


@dataclass(frozen=True)
class Sensors:
    """What is wrong with the sensors of a vehicle.

    Attributes
    ----------
    pulses_per_turn : float
        Pulses of a tachometer in one turn of the wheel, at least 0; 0: ideal.
    radar : RadarModel
        Noise, m/s, latency, s, and blindness of the radar.
    radar_period : float
        Time between its readings, s, above 0; whole sampling periods are taken.
    torque_noise : float
        Standard deviation of a shaft torque's reading, at least 0, as a share of the wheel's
        static load times its radius, dimensionless.
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
    """What happened in a closed loop; k samples, n wheels.

    Attributes
    ----------
    t : ndarray, shape (k,)
        Time, s.
    v, x : ndarray, shape (k,)
        True speed, m/s, forward positive, and distance, m.
    v_estimate : ndarray, shape (k,)
        Estimated speed, m/s; the true one without estimation.
    net_traction : ndarray, shape (k,)
        Thrust less the soil's resistance, over all wheels, N, forward positive.
    target : ndarray, shape (k,)
        Slip target, dimensionless; NaN without control.
    rim_speed : ndarray, shape (k, n)
        r*omega, m/s, forward positive.
    shaft_power : ndarray, shape (k,)
        Power of all shafts, W.
    slip, slip_estimate : ndarray, shape (k, n)
        True and estimated slip, -1 to 1; both true without estimation.
    command : ndarray, shape (k, n)
        Torque sent, N*m, forward positive.
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
        """Tractive work and the energy that it took, from a time on.

        Parameters
        ----------
        start : float
            s.

        Returns
        -------
        work, energy : float
            Of net traction along the way, and of all shafts, J (N*m).
        """
        judged = self.t >= start
        dt = float(self.t[1] - self.t[0])
        work = float(np.sum(self.net_traction[judged] * self.v[judged])) * dt
        return work, float(np.sum(self.shaft_power[judged])) * dt


class Truth:
    """What a perfect estimation would say, to tell errors of estimation from those of control.

    Parameters
    ----------
    plant : Plant
        The vehicle.

    Attributes
    ----------
    v : float
        Speed over ground, m/s.
    slip, slip_variance, rim_speed, valid, thrust, slip_stiffness : ndarray, shape (n,)
        As of `SlipFilter`; dimensionless, dimensionless, m/s, dimensionless, N, N. The
        stiffness is that of the thrust curve through the plant's sinkage and tau_max.
    source : Source
        A sensor, so to speak.
    """

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._radii = np.array([wheel.radius for wheel in plant.vehicle.wheels])
        self.slip_variance = np.zeros(plant.n_wheels)
        self.source = Source.GROUND
        self.look()

    def look(self) -> None:
        """Look at the plant anew."""
        plant = self._plant
        self.v = plant.v
        self.slip = np.array(plant.slip)
        self.rim_speed = plant.rim_speed
        self.valid = np.array(plant.slip_valid)
        # What turns against the shaft, as an estimation finds thrust.
        self.gross_traction = plant.gross_traction

    @property
    def slip_stiffness(self) -> Array:
        """Slope of thrust over slip, N, shape (n,)."""
        plant, terrain, vehicle = self._plant, self._plant.terrain, self._plant.vehicle
        slopes = []
        for j, (wheel, track) in enumerate(zip(vehicle.wheels, vehicle.tracks, strict=True)):
            row = soil_row(plant.x + float(vehicle.wheel_positions[j]), terrain.starts)
            depth = min(max(float(plant.sinkage[j]), 1e-3), wheel.radius)
            length = wheel.contact_length(depth)
            path = length / terrain.soil(row, track).shear_deformation_modulus
            # As of 1 - kappa at y = |i|*l/K: (kappa - exp(-y))/y, 1/2 at y = 0.
            y = max(abs(float(self.slip[j])) * path, 1e-6)
            slope = (shear_deficit(y) - math.exp(-y)) / y if y > 1e-4 else 0.5
            slopes.append(wheel.width * length * path * slope)
        return np.asarray(np.array(plant.max_shear_stress) * np.array(slopes))


class ClosedLoop:
    """A vehicle whose torque answers to its sensors.

    Parameters
    ----------
    plant : Plant
        The vehicle on its soil, with the lag of its drive.
    control : SlipControl or None
        What finds the torque; without, wheels get the torque requested.
    estimation : SlipFilter or None
        What the control sees; without, it sees the truth.
    sensors : Sensors
        Their faults.
    seed : int
        Seed of all noise, at least 0.
    delay : float
        Time from sensors to the drive, s, at least 0; whole sampling periods are taken.
    stiffness_period : float
        Time between two slip stiffnesses that the control is told, s, above 0; whole sampling
        periods are taken.

    Raises
    ------
    ValueError
        If the delay or the period is out of range.
    """

    def __init__(
        self,
        plant: Plant,
        control: SlipControl | None,
        estimation: SlipFilter | None,
        sensors: Sensors,
        seed: int,
        *,
        delay: float = 0.02,
        stiffness_period: float = 0.1,
    ) -> None:
        if not (math.isfinite(delay) and delay >= 0):
            raise ValueError(f'delay must be at least 0 s, got {delay}')
        if not (math.isfinite(stiffness_period) and stiffness_period > 0):
            raise ValueError(f'stiffness_period must be above 0 s, got {stiffness_period}')
        self.plant = plant
        self.control = control
        self.estimation = estimation
        self.sensors = sensors
        self._truth = Truth(plant)
        vehicle = plant.vehicle
        radii = np.array([wheel.radius for wheel in vehicle.wheels])
        self._torque_noise = sensors.torque_noise * vehicle.static_loads() * radii
        n = plant.n_wheels
        self._tachometer = Tachometer(n, sensors.pulses_per_turn)
        self._radar = Radar(sensors.radar, seed)
        self._random = np.random.default_rng((seed, 1))
        self._radar_every = max(1, round(sensors.radar_period / DT))
        self._stiffness_every = max(1, round(stiffness_period / DT))
        self._under_way = deque([[0.0] * n] * round(delay / DT))
        self._steps = 0
        self._rows: list[list[float]] = []

    def step(self, request: Sequence[float]) -> None:
        """Read the sensors, find the torque and advance by one sampling period.

        Parameters
        ----------
        request : sequence of float
            Requested torque of every wheel, N*m, forward positive.

        Raises
        ------
        ValueError
            If a torque is not finite, or there are too few or too many.
        """
        plant, estimation = self.plant, self.estimation
        t, v, n = self._steps * DT, plant.v, plant.n_wheels
        omega = plant.omega
        shaft = plant.shaft_torque
        measured_omega = self._tachometer.read(omega, DT)
        measured_torque = shaft + self._torque_noise * self._random.standard_normal(n)
        if self._steps % self._radar_every == 0:
            self._radar.measure(t, v)
        target = math.nan
        command = list(request)
        seen: SlipFilter | Truth = self._truth
        if estimation is None:
            self._truth.look()
        else:
            seen = estimation
            estimation.wheel_states(t, measured_omega, measured_torque)
            for stamp, speed in self._radar.deliver(t):
                estimation.radar(stamp, speed, max(self.sensors.radar.noise, 1e-3) ** 2)
        slip_estimate = seen.slip.tolist()
        if self.control is not None:
            stiffness = None
            if self._steps and self._steps % self._stiffness_every == 0:
                stiffness = seen.slip_stiffness.tolist()
            outcomes = self.control.step(
                DT if self._steps else 0.0,
                SlipState(
                    slip_estimate,
                    seen.valid.tolist(),
                    seen.rim_speed.tolist(),
                    seen.v,
                    stiffness,
                    seen.gross_traction.tolist(),
                    seen.source is not Source.WHEEL,
                    np.sqrt(seen.slip_variance).tolist(),
                ),
                measured_torque.tolist(),
                request,
            )
            command = [outcome.torque for outcome in outcomes]
            target = self.control.slip_target
        self._rows.append(
            [
                t,
                v,
                plant.x,
                seen.v,
                float(plant.net_traction.sum()),
                float(shaft @ omega),
                target,
                *plant.rim_speed.tolist(),
                *slip_estimate,
                *command,
            ]
        )
        self._under_way.append(command)
        plant.step(self._under_way.popleft(), DT)
        self._steps += 1

    @property
    def t(self) -> float:
        """Time, s."""
        return self._steps * DT

    def drive(self) -> Drive:
        """All that happened so far.

        Returns
        -------
        Drive
            In SI units, one row a sampling period.
        """
        n = self.plant.n_wheels
        rows = np.array(self._rows).reshape(-1, 7 + 3 * n)
        t, v, x, v_estimate, net, power, target = rows[:, :7].T.copy()
        rims, estimates, commands = (
            np.ascontiguousarray(rows[:, a:b]) for a, b in pairwise(range(7, 8 + 3 * n, n))
        )
        return Drive(
            t, v, x, v_estimate, net, power, target, rims, slips(v, rims), estimates, commands
        )
