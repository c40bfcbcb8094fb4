"""Slip filter: slip, speed and soil from tachometers, shaft torque, radar and satellite speed.

`traction_controller.estimation.filter_step` has the filter's equations. This module has its
construction, history and outputs. The time of a measurement is its stamp less the latency of its
sensor. A measured speed is assigned to the newest reading of the wheels that is not younger, and
compared with the speed extrapolated from that reading to its time. The state before every reading
of the last second is kept. A late measurement is inserted at its time and all later updates are
repeated, so the estimate does not depend on the order of arrival.
"""

import copy
import math
from bisect import bisect_right
from collections import deque
from dataclasses import asdict, dataclass
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_controller.estimation.filter_step import (
    DRAWBAR,
    FIRST_WHEEL,
    MAX_DRAWBAR,
    PER_WHEEL,
    SHEAR_MODULUS,
    SINKAGE_MODULUS,
    SPEED,
    START_EXTRA,
    START_LENGTH,
    STRENGTH,
    VEHICLE_MEMORY,
    WHEEL_MEMORY,
    Body,
    Noise,
    WheelSample,
    initialise,
    reset_soil,
    update_acceleration,
    update_speed,
    update_wheels,
)
from traction_controller.estimation.kalman import Method, method_named, reset_entry
from traction_controller.estimation.scheduled_covariance import ScheduledCovariance
from traction_controller.estimation.speed_filter import (
    ACCELERATION,
    OFFSET,
    SPEED_TRACK,
    accelerate,
    advance,
    compare,
    expected_speed,
    measure,
    rest,
)
from traction_controller.estimation.speed_trust import SENSOR_MEMORY, follow
from traction_model.contact.tractive import static_contact_length
from traction_model.slip import MIN_SPEED, is_valid, slip
from traction_model.soil.rut import Ruts, fresh_ruts
from traction_model.soil.soil import Soil
from traction_model.vehicle.vehicle import GRAVITY, Vehicle
from traction_model.vehicle.wheel import RADIUS, STATIC_LOAD, TRACK
from traction_node.positive import check_positive


class Source(IntEnum):
    """Source of the ground speed, numbered as in ISO 11783-7."""

    WHEEL = 0
    GROUND = 1
    BLENDED = 3


class SpeedSensor(IntEnum):
    """Sensors of the speed over ground."""

    RADAR = 0
    GNSS = 1


@dataclass(frozen=True)
class EstimatorNoise:
    """Process and measurement noise of the slip filter; all above 0.

    Attributes
    ----------
    acceleration : float
        Random walk of the drawbar, as acceleration, m/s^2 per sqrt(s).
    speed : float
        Random walk of the speed beyond the model's acceleration, m/s per sqrt(s).
    soil : float
        Random walk of the logarithms of strength, shear deformation modulus and sinkage
        modulus, 1 per sqrt(s).
    strength, shear_modulus, sinkage_modulus : float
        Standard deviation of these logarithms where the soil has changed, dimensionless.
    nominal : float
        Initial standard deviation for the nominal soil, as a share of these, dimensionless.
    gross_traction : float
        Standard deviation of a wheel's moment over radius and static load, dimensionless.
    slip : float
        Standard deviation of the slip at which a moment is reached, dimensionless: errors
        of rolling radius and shape of the curve, largest in effect where the curve is steep.
    wheel_speed : float
        Standard deviation of a reading of a tachometer without pulses, rad/s.
    wheel_acceleration : float
        Random walk of the wheel speed, for a tachometer that counts pulses, as a share of it,
        1 per sqrt(s).
    """

    acceleration: float = 0.22
    speed: float = 0.04
    soil: float = 0.01
    strength: float = 0.18
    shear_modulus: float = 0.6
    sinkage_modulus: float = 0.9
    nominal: float = 0.1
    gross_traction: float = 0.03
    slip: float = 0.03
    wheel_speed: float = 0.005
    wheel_acceleration: float = 0.07

    def __post_init__(self) -> None:
        check_positive(**{f'noise {name}': value for name, value in asdict(self).items()})


# Correlation of the logarithms of strength, shear deformation modulus and sinkage modulus between
# soils: soils of lower bearing capacity have lower strength and a larger shear deformation
# modulus.
CORRELATION = np.array([[1.0, -0.4, 0.5], [-0.4, 1.0, -0.7], [0.5, -0.7, 1.0]])
# Largest standard deviation of the logarithm of tau_max at which it counts as known.
STRENGTH_KNOWN = 0.15
# Standard deviation of the quasi-static model, as a share of the sinkage.
SINKAGE_OPEN = 0.1
# Smallest slope of moment over slip, over radius and load.
MIN_STIFFNESS = 0.05
# Relative change of rolling radius above which the soil factors are reset.
OTHER_RADIUS = 0.01


class Motion(NamedTuple):
    """Reading of an inertial measurement unit.

    Attributes
    ----------
    acceleration : float
        Specific force along the vehicle, m/s^2, forward positive.
    variance : float
        Its variance, m^2/s^4, above 0.
    yaw_rate : float
        Rate of yaw, rad/s, counter-clockwise positive.
    pitch_rate : float
        Rate of pitch, rad/s, nose down positive (REP-103).
    bias_variance : float
        Variance of the biases left in these rates, rad^2/s^2.
    """

    acceleration: float
    variance: float
    yaw_rate: float
    pitch_rate: float
    bias_variance: float


class WheelReading:
    """A reading of the wheels, the speeds assigned to it, and the state before it.

    Parameters
    ----------
    size : int
        Number of floats of the state.
    tracks, n : int
        Number of tracks and of wheels.
    """

    def __init__(self, size: int, tracks: int, n: int) -> None:
        self.t = 0.0
        self.sample = WheelSample(*np.zeros((5, n)))
        self.motion: Motion | None = None
        # Tuples: time, s; sensor; speed, m/s; variance, m^2/s^2.
        self.speeds: list[tuple[float, int, float, float]] = []
        self.before = np.zeros(size)
        self.newest = np.zeros(tracks, dtype=np.int64)


class SlipFilter:
    """Estimator of slip, ground speed and soil from tachometers, torque and ground speed sensors.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle, SI units.
    soil : Soil
        Nominal soil: initial value of the estimated soil.
    noise : EstimatorNoise
        Process and measurement noise.
    min_speed : float
        Speed of rim or vehicle below which slip is not valid, m/s, above 0.
    radar_timeout : float
        Time without readings of radar and satellite receiver after which the ground speed no
        longer counts as measured, s, above 0.
    radar_variance : float
        Default variance of a measured speed, m^2/s^2, above 0.
    method : {'ekf', 'ukf', 'scheduled_gain'}
        Kalman filter: extended, unscented, or with scheduled gains.
    radar_latency, gnss_latency : float
        Delay of stamps after the time of measurement, s, 0 to 0.5.
    radar_min_speed : float
        Smallest speed that the radar measures, m/s, at least 0; lower readings are ignored.

    Attributes
    ----------
    t : float or None
        Time of the newest reading of the wheels, s; None before the first.
    slip, slip_variance : ndarray, shape (n,)
        Slip of every wheel, -1 to 1, and its variance.
    valid : ndarray of bool, shape (n,)
        True if a slip can be used.
    rim_speed : ndarray, shape (n,)
        r*omega, m/s.
    gross_traction : ndarray, shape (n,)
        Gross traction from shaft torque, N.

    Raises
    ------
    ValueError
        If a value is out of its range.
    """

    # Largest interval between readings of the wheels, or between wheels and a speed, s. A longer
    # one means a dropout, or that a clock was set.
    LONGEST_GAP = 0.5
    # Length of the history for late readings, s.
    HISTORY = 1.0
    # Stamps closer than this count as equal, s.
    _SAME = 1e-6
    # Gate for the innovation of a measured speed, in standard deviations.
    _GATE = 5.0
    # Number of consecutive rejected readings that must agree with each other before the estimate
    # is reset to them; tolerance in standard deviations of two readings, plus the change of speed
    # at this acceleration, m/s^2.
    _AGREEING = 3
    _LARGEST_ACCELERATION = 5.0
    # A sensor whose scatter exceeds the stated variance by this factor has that variance.
    _NOISIER = 4.0
    # A sensor that jumped is trusted again near the estimate, in standard deviations, of which
    # that of the estimate counts up to a share of 1 m/s plus the speed; or after a time, s, of
    # slips up to a limit.
    _NEAR, _DOUBT = 2.0, 0.1
    _TRIAL, _USUAL_SLIP = 2.0, 0.35
    # Weight of the newest speed in the mean innovation, and limit of that mean, in standard
    # deviations of one innovation (white innovations give it a sixth of this).
    _INNOVATION_SHARE = 0.05
    _INNOVATION_LIMIT = 0.8
    # Error of the model's acceleration, m/s^2, and rim speed below which a vehicle rests, m/s.
    _ACCELERATION_OPEN = 0.1
    _AT_REST = 0.02
    # Ground speed is valid up to this standard deviation, m/s.
    _LARGEST_DEVIATION = 0.5

    def __init__(
        self,
        vehicle: Vehicle,
        soil: Soil,
        noise: EstimatorNoise = EstimatorNoise(),
        min_speed: float = MIN_SPEED,
        radar_timeout: float = 0.5,
        radar_variance: float = 0.0025,
        *,
        method: str = 'ukf',
        radar_latency: float = 0.0,
        gnss_latency: float = 0.0,
        radar_min_speed: float = 0.0,
    ) -> None:
        check_positive(
            min_speed=min_speed, radar_timeout=radar_timeout, radar_variance=radar_variance
        )
        for name, value, most in (
            ('radar_latency', radar_latency, 0.5),
            ('gnss_latency', gnss_latency, 0.5),
            ('radar_min_speed', radar_min_speed, math.inf),
        ):
            if not (math.isfinite(value) and 0 <= value <= most):
                raise ValueError(f'{name} must be 0 to {most:g}, got {value}')
        self.vehicle = vehicle
        self.noise = noise
        self.method = method
        self.min_speed = min_speed
        self.radar_timeout = radar_timeout
        self.radar_variance = radar_variance
        self.radar_min_speed = radar_min_speed
        self._method = int(method_named(method))
        self._latency = (radar_latency, gnss_latency)

        self._positions, self._offsets = vehicle.wheel_positions, vehicle.wheel_offsets
        # A vehicle with a single axle does not run in a rut of its own.
        self._wheels = vehicle.packed_wheels(in_ruts=len(vehicle.axles) > 1)
        loads = vehicle.static_loads()
        cg_x, cg_height = vehicle.centre_of_gravity
        deviations = np.array([noise.strength, noise.shear_modulus, noise.sinkage_modulus])
        changed = CORRELATION * np.outer(deviations, deviations)
        self._body = Body(
            wheels=self._wheels,
            soils=np.array([soil.packed(wheel) for wheel in vehicle.wheels]),
            load_distribution=np.ascontiguousarray(vehicle.load_distribution()),
            drift=np.eye(PER_WHEEL) * noise.soil**2,
            changed=changed,
            mass=float(vehicle.mass),
            cg_x=float(cg_x),
            cg_height=float(cg_height),
            hitch_height=float(vehicle.hitch_height),
        )
        self._noise = Noise(
            speed=noise.speed,
            drawbar=noise.acceleration * vehicle.mass,
            moment=noise.gross_traction,
            slip=noise.slip,
            wheel_speed=noise.wheel_speed,
            wheel_acceleration=noise.wheel_acceleration,
            min_speed=min_speed,
        )
        strengths, self._areas, self._lengths = [], [], []
        for wheel, load in zip(vehicle.wheels, loads, strict=True):
            length = static_contact_length(soil, wheel, load)
            self._lengths.append(length)
            self._areas.append(wheel.width * length)
            strengths.append(soil.max_shear_stress(load / (wheel.width * length)))
        self._strengths = np.array(strengths)
        self._shear_modulus = float(soil.shear_deformation_modulus)
        # Distance until contact is quasi-static, see `traction_controller.estimation.filter_step`.
        self._settling = (
            2 * START_LENGTH * math.log(START_EXTRA) * float(self._wheels[:, RADIUS].max())
        )
        # Initial standard deviation of the drawbar: 0.3 of the weight.
        self._unknown_drawbar = 0.3 * float(loads.sum())

        self._allot()
        self._schedule: ScheduledCovariance | None = None
        self.reset()
        if self._method == Method.SCHEDULED_GAIN:
            self._schedule = ScheduledCovariance(
                self._body, self._noise, self.radar_variance, self._unknown_drawbar, noise.nominal
            )

    def _allot(self) -> None:
        """Allocate the whole state as one array, so that one copy saves or restores it."""
        n = len(self._wheels)
        m = FIRST_WHEEL + PER_WHEEL * n
        ruts = fresh_ruts(
            1 + int(self._wheels[:, TRACK].max()) if self._wheels[0, TRACK] >= 0 else 0,
            float(np.ptp(self.vehicle.wheel_positions)),
        )
        layout = np.dtype(
            [
                ('x', float, (m,)),
                ('p', float, (m, m)),
                ('wheels', WHEEL_MEMORY, (n,)),
                ('vehicle', VEHICLE_MEMORY, (1,)),
                ('sensors', SENSOR_MEMORY, (len(SpeedSensor),)),
                ('track', SPEED_TRACK, (1,)),
                ('rut_depth', float, ruts.depth.shape),
                ('rut_shear', float, ruts.depth.shape),
                ('rut_width', float, ruts.depth.shape),
            ],
            align=True,
        )
        state = np.zeros(1, layout)
        # The same memory as plain numbers, which copy fastest.
        self._state = state.view(float)
        self._x, self._p = state['x'][0], state['p'][0]
        self._wheel_memory = state['wheels'][0]
        self._vehicle_memory = state['vehicle'][0]
        self._sensors = state['sensors'][0]
        # The same memory with named fields.
        self._trip: Any = self._vehicle_memory[0]
        self._track: Any = state['track'][0][0]
        self._fresh = ruts.newest.copy()
        self._ruts = Ruts(
            state['rut_depth'][0],
            state['rut_shear'][0],
            state['rut_width'][0],
            ruts.newest,
        )
        self._readings: deque[WheelReading] = deque()
        self._spare: list[WheelReading] = []

    def __deepcopy__(self, memo: dict[int, Any]) -> 'SlipFilter':
        # The default deep copy would separate the views of the one array.
        other = copy.copy(self)
        memo[id(self)] = other
        other._allot()
        other._state[:] = self._state
        other._ruts.newest[:] = self._ruts.newest
        other._readings = copy.deepcopy(self._readings, memo)
        for name in ('slip', 'slip_variance', 'valid', 'rim_speed'):
            setattr(other, name, getattr(self, name).copy())
        return other

    @property
    def n_wheels(self) -> int:
        """Number of wheels, dimensionless."""
        return len(self._wheels)

    def reset(self) -> None:
        """Reset to the initial state: at rest, on the nominal soil."""
        n = self.n_wheels
        self.t: float | None = None
        self._state[:] = 0.0
        self._ruts.newest[:] = self._fresh
        # The first reading of the wheels sets the speed.
        self._p[SPEED, SPEED] = 1.0
        self._p[DRAWBAR, DRAWBAR] = self._unknown_drawbar**2
        for j in range(n):
            reset_soil(self._x, self._p, j, self._body.changed * self.noise.nominal**2, False)
        self._wheel_memory['held_until'] = -1.0
        self._trip['soil_changed_at'] = -math.inf
        self._trip['speed_time'] = -math.inf
        self._sensors['time'] = -math.inf
        self._track['time'] = -math.inf
        self._spare.extend(self._readings)
        self._readings.clear()
        self.slip = np.zeros(n)
        self.slip_variance = np.ones(n)
        self.valid = np.zeros(n, dtype=bool)
        self.rim_speed = np.zeros(n)

    @property
    def rolling_radius(self) -> NDArray[np.float64]:
        """Rolling radius of every wheel, m, shape (n,); initially that of the vehicle."""
        return self._wheels[:, RADIUS].copy()

    def set_rolling_radius(self, radius: ArrayLike) -> None:
        """Set the rolling radii for rim speed, slip and gross traction.

        A change by more than 1 % resets the soil factors of the wheel, since they were estimated
        with a wrong slip. `reset` keeps the radii.

        Parameters
        ----------
        radius : array_like, shape (n,)
            Rolling radii, m, above 0.

        Raises
        ------
        ValueError
            If there is not a radius above 0 for every wheel. The radii are then unchanged.
        """
        radii = self.checked('rolling radius', radius)
        if np.any(radii <= 0.0):
            raise ValueError(f'rolling radius must be above 0 m, got {radii.tolist()}')
        changed = np.abs(radii / self._wheels[:, RADIUS] - 1.0) > OTHER_RADIUS
        # Not in place: copies of this estimator keep their radii.
        self._wheels = self._wheels.copy()
        self._wheels[:, RADIUS] = radii
        self._body = self._body._replace(wheels=self._wheels)
        for j in np.flatnonzero(changed):
            reset_soil(self._x, self._p, j, self._body.changed, False)
        self._derive()

    @property
    def soil_rejected(self) -> bool:
        """True while the soil model predicts measured speeds worse than a plain filter of them.

        `v` is then that of the plain filter, see `traction_controller.estimation.speed_filter`.
        """
        return bool(self._track['preferred'])

    @property
    def v(self) -> float:
        """Speed over ground, m/s, forward positive."""
        return float((self._track['x'] if self._track['preferred'] else self._x)[SPEED])

    @property
    def v_variance(self) -> float:
        """Variance of `v`, m^2/s^2."""
        if self._track['preferred']:
            return float(self._track['p'][SPEED, SPEED])
        return float(self._p[SPEED, SPEED])

    @property
    def v_valid(self) -> bool:
        """True if the standard deviation of `v` is below 0.5 m/s."""
        return self.t is not None and self.v_variance < self._LARGEST_DEVIATION**2

    @property
    def source(self) -> Source:
        """Present source of `v`."""
        silent = self.t is None or self.t - self._trip['speed_time'] > self.radar_timeout + 1e-9
        if silent:
            return Source.WHEEL
        return Source.GROUND if self.soil_rejected else Source.BLENDED

    @property
    def gross_traction(self) -> NDArray[np.float64]:
        """Moment of the soil over the rolling radius, N, forward positive, shape (n,)."""
        return np.asarray(self._wheel_memory['moment'] / self._wheels[:, RADIUS])

    @property
    def external_resistance(self) -> float:
        """Sum of all resistances, N, positive against forward motion.

        Motion resistance of the wheels, drawbar pull, grade and air drag.
        """
        return float(self._x[DRAWBAR] + self._wheel_memory['resistance'].sum())

    @property
    def external_resistance_variance(self) -> float:
        """Variance of `external_resistance`, N^2."""
        slope = np.zeros(len(self._x))
        slope[DRAWBAR] = 1.0
        for entry, field in (
            (STRENGTH, 'resistance_by_strength'),
            (SHEAR_MODULUS, 'resistance_by_shear_modulus'),
            (SINKAGE_MODULUS, 'resistance_by_sinkage_modulus'),
        ):
            slope[FIRST_WHEEL + entry :: PER_WHEEL] = self._wheel_memory[field]
        return float(slope @ self._p @ slope)

    def _factor(self, which: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Logarithm of one soil factor at every wheel, and its variance."""
        entries = slice(FIRST_WHEEL + which, None, PER_WHEEL)
        return self._x[entries], np.diag(self._p)[entries]

    @property
    def max_shear_stress(self) -> NDArray[np.float64]:
        """Shear strength tau_max under every wheel, Pa, shape (n,).

        ``c + (W/A)*tan(phi)`` with the static load W and the area A on the nominal soil.
        """
        return np.asarray(self._strengths * np.exp(self._factor(STRENGTH)[0]))

    @property
    def max_shear_stress_variance(self) -> NDArray[np.float64]:
        """Variance of `max_shear_stress`, Pa^2, shape (n,)."""
        return np.asarray(self.max_shear_stress**2 * self._factor(STRENGTH)[1])

    @property
    def shear_deformation_modulus(self) -> NDArray[np.float64]:
        """Shear deformation modulus K under every wheel, m, shape (n,)."""
        return np.asarray(self._shear_modulus * np.exp(self._factor(SHEAR_MODULUS)[0]))

    @property
    def shear_deformation_modulus_variance(self) -> NDArray[np.float64]:
        """Variance of `shear_deformation_modulus`, m^2, shape (n,)."""
        return np.asarray(self.shear_deformation_modulus**2 * self._factor(SHEAR_MODULUS)[1])

    @property
    def sinkage(self) -> NDArray[np.float64]:
        """Sinkage of every wheel on the estimated soil, m, shape (n,).

        NaN until the wheel has moved.
        """
        z = self._wheel_memory['sinkage']
        return np.where(z > 0, z, np.nan)

    @property
    def sinkage_variance(self) -> NDArray[np.float64]:
        """Variance of `sinkage`, m^2, shape (n,); NaN until the wheel has moved."""
        by_soil = self._wheel_memory['sinkage_slope'] ** 2 * self._factor(SINKAGE_MODULUS)[1]
        return np.asarray(by_soil + (SINKAGE_OPEN * self.sinkage) ** 2)

    @property
    def strength_known(self) -> NDArray[np.bool_]:
        """True if the standard deviation of tau_max under a wheel is below 15 %, shape (n,)."""
        return np.asarray(self._factor(STRENGTH)[1] < STRENGTH_KNOWN**2)

    @property
    def mobilisation(self) -> float:
        """Gross traction of all wheels over the strength of the soil under them, dimensionless.

        NaN if the strength under a wheel is unknown. The strength is ``tau_max*A`` with static
        load and area on the nominal soil.
        """
        if not np.all(self.strength_known):
            return math.nan
        strength = float(self.max_shear_stress @ np.array(self._areas))
        return abs(float(self.gross_traction.sum())) / strength

    @property
    def slip_stiffness(self) -> NDArray[np.float64]:
        """Slope of gross traction over slip at the present slip of every wheel, N, shape (n,).

        At standstill: the slope at zero slip of a flat plate on the estimated soil.
        """
        stiffness = (
            self.max_shear_stress
            * np.array(self._areas)
            * np.array(self._lengths)
            / (2 * self.shear_deformation_modulus)
        )
        v = self.v
        for j, rim in enumerate(self.rim_speed):
            slope = self._wheel_memory['moment_slope'][j]
            if slope != 0.0:
                # d(slip)/dv: -1/rim when driving, -rim/v^2 when braking.
                per_slip = abs(rim) if abs(rim) >= abs(v) else v * v / max(abs(rim), 1e-3)
                load = self._wheels[j, STATIC_LOAD]
                stiffness[j] = max(
                    MIN_STIFFNESS * load, -slope * per_slip / self._wheels[j, RADIUS]
                )
        return np.asarray(stiffness)

    def wheel_states(
        self,
        t: float,
        omega: ArrayLike,
        torque: ArrayLike,
        pulse: ArrayLike = 0.0,
        counted: ArrayLike = 0.0,
        motion: Motion | None = None,
    ) -> None:
        """Update with a reading of all tachometers and shaft torques.

        Parameters
        ----------
        t : float
            Time of measurement, s. A reading after a younger one is inserted at its time if it is
            less than half a second older.
        omega : array_like, shape (n,)
            Wheel speeds, rad/s, forward positive.
        torque : array_like, shape (n,)
            Shaft torques, N·m, forward positive.
        pulse, counted : array_like, shape (n,) or ()
            Angle from pulse to pulse and angle counted in this reading, rad, see `Tachometers`;
            0: the tachometers do not count.
        motion : Motion, optional
            Reading of an inertial measurement unit at this time.

        Raises
        ------
        ValueError
            If a number is not finite, the number of values is wrong, or the reading is too old.
            The estimate is then unchanged.
        """
        omega = self.checked('wheel speed', omega)
        torque = self.checked('shaft torque', torque)
        if not math.isfinite(t):
            raise ValueError(f'time of measurement is not finite: {t}')
        if self.t is not None:
            if t < self.t and (self.t - t > self.LONGEST_GAP or t <= self._readings[0].t):
                raise ValueError(f'time runs backwards: {t:.6f} s after {self.t:.6f} s')
            place = bisect_right(self._readings, t + self._SAME, key=lambda other: other.t) - 1
            if abs(t - self._readings[place].t) <= self._SAME:
                raise ValueError(f'stamp does not advance: {t:.6f} s again')
            if t - self.t > self.LONGEST_GAP:
                # Unknown motion during a dropout.
                self.reset()
        reading = (
            self._spare.pop()
            if self._spare
            else WheelReading(len(self._state), len(self._fresh), self.n_wheels)
        )
        reading.t = t
        sample = reading.sample
        sample.omega[:], sample.torque[:] = omega, torque
        sample.pulse[:], sample.counted[:] = pulse, counted
        reading.motion = motion
        reading.speeds.clear()
        if self.t is None or t >= self.t:
            last = self._readings[-1] if self._readings else None
            if last is not None and last.speeds and last.speeds[-1][0] + self._SAME >= t:
                self._put(reading)
            else:
                self._readings.append(reading)
                self._update_wheels(reading)
            self.t = t
            while self._readings[0].t < t - self.HISTORY and len(self._readings) > 2:
                self._spare.append(self._readings.popleft())
        else:
            self._put(reading)
        self._derive()

    def radar(self, t: float, v: float, variance: float) -> bool:
        """Update with a radar reading.

        Parameters
        ----------
        t : float
            Stamp, s: `radar_latency` after the time of measurement.
        v : float
            Speed over ground, m/s, forward positive.
        variance : float
            Variance, m^2/s^2; 0 means `radar_variance`.

        Returns
        -------
        bool
            False if the reading was rejected: its innovation is above five standard deviations.
            If three consecutive readings agree with each other, the estimate is reset to the
            third. Also false below `radar_min_speed`, and for a reading older than all readings
            of the wheels.

        Raises
        ------
        ValueError
            If a number is not finite, the variance is negative, or the time differs from that of
            the wheels by half a second or more. The estimate is then unchanged.
        """
        return self._speed(SpeedSensor.RADAR, t, v, variance)

    def gnss(self, t: float, v: float, variance: float) -> bool:
        """Update with a speed over ground from a satellite receiver.

        Parameters
        ----------
        t : float
            Stamp, s: `gnss_latency` after the time of measurement.
        v : float
            Speed along the vehicle, m/s, forward positive.
        variance : float
            Variance, m^2/s^2; 0 means `radar_variance`.

        Returns
        -------
        bool
            False if the reading was rejected or ignored, see `radar`.

        Raises
        ------
        ValueError
            As `radar`.
        """
        return self._speed(SpeedSensor.GNSS, t, v, variance)

    def _speed(self, sensor: SpeedSensor, t: float, v: float, variance: float) -> bool:
        if not math.isfinite(t):
            raise ValueError(f'time of measurement is not finite: {t}')
        name = sensor.name.lower()
        if not (math.isfinite(v) and math.isfinite(variance) and variance >= 0):
            raise ValueError(
                f'{name} reading {v} m/s with variance {variance} m^2/s^2 is not usable'
            )
        if self.t is None:
            return False
        if abs(t - self.t) > self.LONGEST_GAP:
            raise ValueError(f'{name} reading is {t - self.t:+.3f} s off the wheels in time')
        if sensor is SpeedSensor.RADAR and abs(v) < self.radar_min_speed:
            return False
        measured = t - self._latency[sensor]
        entry = (measured, int(sensor), v, variance or self.radar_variance)
        place = (
            bisect_right(self._readings, measured + self._SAME, key=lambda reading: reading.t) - 1
        )
        if place < 0:
            return False
        reading = self._readings[place]
        if any(other[:2] == entry[:2] for other in reading.speeds):
            raise ValueError(f'stamp of {name} does not advance: {t:.6f} s again')
        if place == len(self._readings) - 1 and (
            not reading.speeds or reading.speeds[-1] <= entry
        ):
            reading.speeds.append(entry)
            accepted = self._update_speed(reading, entry)
        else:
            at = bisect_right(reading.speeds, entry)
            reading.speeds.insert(at, entry)
            accepted = self._replay(place, (place, at))
        self._derive()
        return accepted

    def _put(self, reading: WheelReading) -> None:
        """Insert a reading of the wheels at its time and repeat the updates after it."""
        place = bisect_right(self._readings, reading.t, key=lambda other: other.t)
        # The oldest reading is older than any accepted one, so there is one before it.
        before = self._readings[place - 1]
        first = bisect_right(before.speeds, reading.t, key=lambda entry: entry[0] + self._SAME)
        reading.speeds.extend(before.speeds[first:])
        del before.speeds[first:]
        self._readings.insert(place, reading)
        self._replay(place - 1)

    def _replay(self, first: int, wanted: tuple[int, int] = (-1, -1)) -> bool:
        """Repeat all updates from a reading on; true if the given speed is accepted."""
        self._state[:] = self._readings[first].before
        self._ruts.newest[:] = self._readings[first].newest
        accepted_speed = False
        for place in range(first, len(self._readings)):
            reading = self._readings[place]
            self._update_wheels(reading)
            for at, entry in enumerate(reading.speeds):
                accepted = self._update_speed(reading, entry)
                if (place, at) == wanted:
                    accepted_speed = accepted
        return accepted_speed

    def _update_wheels(self, reading: WheelReading) -> None:
        """Update with a reading of the wheels younger than the state."""
        reading.before[:] = self._state
        reading.newest[:] = self._ruts.newest
        if reading is self._readings[0]:
            initialise(
                reading.t, reading.sample, self._x, self._p, self._wheel_memory,
                self._vehicle_memory, self._body, self._noise,
            )  # fmt: skip
        elif reading.t > self._trip['time']:
            if self._schedule is not None:
                self._load_covariance(self._schedule)
            yaw_rate = 0.0 if reading.motion is None else reading.motion.yaw_rate
            reading.sample.turn[:] = self._turn(yaw_rate)
            update_wheels(
                self._method, reading.t, reading.sample, self._x, self._p, self._wheel_memory,
                self._vehicle_memory, self._ruts, self._body, self._noise,
            )  # fmt: skip
            if reading.motion is not None:
                self._update_motion(reading.t, reading.motion)
        if self._track['preferred']:
            self._keep_track(reading.t)
        rims = self._wheels[:, RADIUS] * self._wheel_memory['omega']
        if np.max(np.abs(rims)) < self.min_speed:
            self._stand_still(int(np.argmin(np.abs(rims))), reading.motion is not None)

    def _turn(self, yaw_rate: float) -> Any:
        """Ground speed of each wheel beyond that of the vehicle, m/s.

        Speed of the wheel's centre, in the direction of its path: a wheel that is not at the rear
        axle steers there.
        """
        if yaw_rate == 0.0:
            return 0.0
        v = self.v
        along = v - yaw_rate * self._offsets
        across = yaw_rate * self._positions
        return np.copysign(np.hypot(along, across), along) - v

    def _update_motion(self, t: float, motion: Motion) -> None:
        """Update with a reading of an inertial measurement unit."""
        track = self._track
        accelerate(
            track, t, motion.acceleration, motion.variance, motion.pitch_rate, motion.bias_variance
        )
        if track['time'] == -math.inf:
            return
        acceleration = motion.acceleration - float(track['x'][OFFSET])
        variance = motion.variance + float(track['p'][OFFSET, OFFSET]) + self._ACCELERATION_OPEN**2
        update_acceleration(
            self._x, self._p, self._wheel_memory, self._vehicle_memory, self._body, acceleration,
            variance,
        )  # fmt: skip

    def _load_covariance(self, schedule: ScheduledCovariance) -> None:
        """Set the covariance scheduled by speed, slip and time without measured speed."""
        trip = self._trip
        t = trip['time']
        rims = self._wheels[:, RADIUS] * self._wheel_memory['omega']
        mean = float(np.mean([abs(slip(self.v, rim)) for rim in rims]))
        # Shortly after a start the covariance of the initialisation is used.
        if abs(self.v) > self.min_speed and trip['travelled'] > 2 * self._settling:
            schedule.look_up(
                abs(self.v), mean, t - trip['speed_time'], t - trip['soil_changed_at'], self._p
            )

    def _stand_still(self, slowest: int, with_motion: bool) -> None:
        """Update at standstill of all wheels: v = 0, unless a sensor measures a speed."""
        radius, kept = self._wheels[slowest, RADIUS], self._wheel_memory[slowest]
        rim = float(radius * kept['omega'])
        trip = self._trip
        trip['travelled'] = 0.0
        self._wheel_memory['held_until'] = -1.0
        self._wheel_memory['mean_innovation'] = 0.0
        variance = float((0.02 + 0.5 * abs(rim)) ** 2 + radius**2 * kept['omega_variance'])
        measured = trip['time'] - trip['speed_time'] <= self.radar_timeout + 1e-9
        if measured and self._unlikely(rim, variance):
            # The wheels are locked and the vehicle slides.
            return
        update_speed(self._x, self._p, rim, variance)
        if self._track['preferred'] or with_motion:
            measure(self._track, float(trip['time']), rim, variance)
        if with_motion and abs(rim) < self._AT_REST:
            rest(self._track, float(trip['time']))
        # At rest resistance equals gross traction; it has no information on driving.
        reset_entry(self._p, DRAWBAR, self._unknown_drawbar**2)

    def _unlikely(self, v: float, variance: float) -> bool:
        """True if a measured speed is outside the gate."""
        return (v - self.v) ** 2 > self._GATE**2 * (self.v_variance + variance)

    def _update_speed(self, reading: WheelReading, entry: tuple[float, int, float, float]) -> bool:
        """Update with a measured speed assigned to the newest reading of the wheels."""
        t, sensor, measured, variance = entry
        trip, record, track = self._trip, self._sensors[sensor], self._track
        after = t - reading.t
        acceleration = float(trip['acceleration'])
        if track['preferred']:
            acceleration = float(track['x'][ACCELERATION])
        # Measured speed extrapolated to the time of the reading.
        v = measured - acceleration * after
        jumped = follow(record, t, v, float(trip['reckoned']), variance)
        if record['scatter'] > self._NOISIER * variance:
            variance = float(record['scatter'])
        if jumped and self._unlikely(v, variance):
            record['suspect'], record['near'], record['implausible_time'] = 1.0, 0.0, t
        if record['suspect']:
            if not self._trusted_again(sensor, t, v, variance, jumped):
                return False
            record['suspect'] = 0.0
        predicted = float(self._x[SPEED]) + acceleration * after
        # At smaller speeds slip is not used, and contact is not settled.
        if abs(measured) >= self.min_speed and compare(track, t, measured, variance, predicted):
            self._reject_soil()
        measure(track, t, measured, variance)
        if track['preferred']:
            self._follow_track(reading.t)
        elif not self._update_by(record, t, v, variance):
            return False
        record['refused_in_a_row'] = 0
        trip['speed_time'] = max(trip['speed_time'], t)
        return True

    def _update_by(self, record: Any, t: float, v: float, variance: float) -> bool:
        """Update with a speed of a trusted sensor; false if it is outside the gate."""
        trip = self._trip
        if self._unlikely(v, variance):
            off = self._GATE * math.sqrt(2 * variance)
            off += self._LARGEST_ACCELERATION * abs(t - record['refused_time'])
            agrees = record['refused_in_a_row'] > 0 and abs(v - record['refused_speed']) <= off
            record['refused_in_a_row'] = record['refused_in_a_row'] + 1 if agrees else 1
            record['refused_time'], record['refused_speed'] = t, v
            if record['refused_in_a_row'] < self._AGREEING:
                return False
            self._x[SPEED] = v
            reset_entry(self._p, SPEED, variance)
            self._reset_covariance()
            return True
        expected = math.sqrt(self.v_variance + variance)
        if trip['travelled'] > self._settling:
            normalised = (v - self.v) / expected - trip['mean_speed_innovation']
            trip['mean_speed_innovation'] += self._INNOVATION_SHARE * normalised
        if abs(trip['mean_speed_innovation']) > self._INNOVATION_LIMIT:
            # Dozens of innovations of one sign: the error is in soil or drawbar.
            self._x[SPEED] += trip['mean_speed_innovation'] * expected
            reset_entry(self._p, SPEED, self._INNOVATION_SHARE * expected**2)
            self._reset_covariance()
        update_speed(self._x, self._p, v, variance)
        return True

    def _reject_soil(self) -> None:
        """Forget soil and drawbar, which explain measured speeds worse than no model."""
        for j in range(self.n_wheels):
            reset_soil(self._x, self._p, j, self._body.changed, False)
        self._wheel_memory['held_until'] = -1.0
        self._wheel_memory['mean_innovation'] = 0.0
        self._trip['mean_speed_innovation'] = 0.0
        self._x[DRAWBAR] = 0.0

    def _keep_track(self, t: float) -> None:
        """Predict the plain filter; without measured speed return to the slip filter."""
        track = self._track
        if t - self._trip['speed_time'] <= self.radar_timeout + 1e-9:
            advance(track, t, 0.0, 0.0)
            return
        self._x[SPEED] = self.v
        # As after the first reading: the wheels may slip.
        reset_entry(self._p, SPEED, 1.0 + (0.5 * self.v) ** 2)
        track['preferred'] = track['excess'] = 0.0
        track['time'] = -math.inf

    def _follow_track(self, t: float) -> None:
        """Set speed and drawbar to those of the plain filter at the time of a reading."""
        track, trip = self._track, self._trip
        self._x[SPEED] = expected_speed(track, t)
        reset_entry(self._p, SPEED, float(track['p'][SPEED, SPEED]))
        # Drawbar with which the forces give this acceleration. Half a step, since the smoothed
        # acceleration of the model lags.
        mass = self._body.mass
        missing = mass * (trip['smooth_acceleration'] - float(track['x'][ACCELERATION]))
        limit = MAX_DRAWBAR * mass * GRAVITY
        self._x[DRAWBAR] = np.clip(self._x[DRAWBAR] + 0.5 * missing, -limit, limit)
        reset_entry(self._p, DRAWBAR, mass**2 * float(track['p'][ACCELERATION, ACCELERATION]))

    def _trusted_again(
        self, sensor: int, t: float, v: float, variance: float, jumped: bool
    ) -> bool:
        """True if a sensor that has jumped can be trusted again from this reading on."""
        record = self._sensors[sensor]
        doubt = min(self.v_variance, (self._DOUBT * (1.0 + abs(self.v))) ** 2)
        near = abs(v - self.v) <= self._NEAR * math.sqrt(doubt + variance)
        record['near'] = record['near'] + 1 if near else 0
        # Back from where it had jumped to, one reading is enough.
        if record['near'] >= (1 if jumped else self._AGREEING):
            return True
        reckoned = self._trip['reckoned']
        for another, other in enumerate(self._sensors):
            if another == sensor or other['suspect'] or t - other['time'] > self.LONGEST_GAP:
                continue
            expected = other['speed'] + reckoned - other['reckoned']
            if abs(v - expected) <= self._NEAR * math.sqrt(variance + other['scatter']):
                return True
        rims = self._wheels[:, RADIUS] * self._wheel_memory['omega']
        turns = self._wheel_memory['turn']
        slips = [slip(v + float(turn), float(rim)) for turn, rim in zip(turns, rims, strict=True)]
        if min(slips) < -self._USUAL_SLIP or max(slips) > self._USUAL_SLIP:
            record['implausible_time'] = t
        return bool(t - record['implausible_time'] >= self._TRIAL)

    def _reset_covariance(self) -> None:
        """Reset the covariance of soil and drawbar; their values are kept."""
        for j in range(self.n_wheels):
            reset_soil(self._x, self._p, j, self._body.changed, True)
        reset_entry(self._p, DRAWBAR, self._unknown_drawbar**2)
        self._p[SPEED, SPEED] += self.noise.speed**2
        self._trip['mean_speed_innovation'] = 0.0

    def _derive(self) -> None:
        """Slip of every wheel, with variance and validity, from the present speeds."""
        vehicle_v, v_variance = self.v, self.v_variance
        v_valid = self.v_valid
        for j in range(self.n_wheels):
            v = vehicle_v + self._wheel_memory['turn'][j]
            radius = self._wheels[j, RADIUS]
            rim = radius * self._wheel_memory['omega'][j]
            self.rim_speed[j] = rim
            fastest = max(abs(v), abs(rim), 1e-3)
            self.slip[j] = slip(v, rim)
            # Ratio of smaller to larger speed: errors of both contribute to its variance.
            rim_variance = radius**2 * self._wheel_memory['omega_variance'][j]
            ratio = min(abs(v), abs(rim)) / fastest
            of_v, of_rim = (1.0, ratio) if abs(rim) >= abs(v) else (ratio, 1.0)
            self.slip_variance[j] = min(
                1.0, (of_v**2 * v_variance + of_rim**2 * rim_variance) / fastest**2
            )
            self.valid[j] = is_valid(v, rim, self.min_speed) and v_valid

    def checked(self, what: str, values: ArrayLike) -> NDArray[np.float64]:
        """Array of one finite number for each wheel.

        Parameters
        ----------
        what : str
            Name of the quantity for the error, such as 'wheel speed'.
        values : array_like, shape (n,)
            Values, in any unit.

        Returns
        -------
        ndarray, shape (n,)
            Values, in their unit.

        Raises
        ------
        ValueError
            If a value is not finite, or their number is wrong.
        """
        array = np.asarray(values, dtype=float)
        if array.shape != (self.n_wheels,):
            raise ValueError(
                f'expected a {what} for each of {self.n_wheels} wheels, got {array.size}'
            )
        for name, value in zip(self.vehicle.wheel_names, array, strict=True):
            if not math.isfinite(value):
                raise ValueError(f"{what} of wheel '{name}' is {value}")
        return array
