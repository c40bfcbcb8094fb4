"""Slip estimation: an extended Kalman filter on speed, resistance and soil strength.

State, for n wheels: ``x = [v, d, s_1 .. s_n]`` with v the speed over ground, d all that holds
the vehicle back (drawbar pull, motion resistance, grade, air) and ``s_j = ln(tau_max_j)``,
which keeps the maximum shear stress positive. Shaft torque and tachometer give the thrust of
every wheel, ``F_j = (T_j - b_f*omega_j - J_j*omega_j')/r_j``, so that

    v' = (sum_j F_j - d)/m,   d' and s_j' random walks.

Measurements: the radar measures v; every wheel measures ``F_j = tau_max_j*g_j(i_j)`` with the
thrust curve ``g(i) = A*(1 - kappa(|i|*l/K))`` of Agriculture 2024, 14(3), 499, equations (19)
and (21). With the radar, the curve's height tau_max is learnt; without, it gives the slip that
the thrust implies. Only tachometer, torque and radar are used, so the drawbar need not be known.
"""

import math
from dataclasses import dataclass, fields
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_model.contact import Form, equilibrium_sinkage, shear_deficit
from traction_model.kernel import kernel
from traction_model.slip import LEAST_SPEED, is_valid, slip
from traction_model.soil import Soil
from traction_model.vehicle import Vehicle

# State: speed, resistance, then the logarithm of each wheel's maximum shear stress.
SPEED, RESISTANCE, FIRST_WHEEL = range(3)

# Columns of the packed wheels.
RADIUS, INERTIA, FRICTION, AREA, PATH = range(5)


# Standard deviation of ln(tau_max) when nothing is known of a changed soil, and up to which a
# wheel's curve counts as known.
CURVE_UNKNOWN = 0.5
CURVE_KNOWN = 0.15
# Thrust this many standard deviations off its curve shows that the soil has changed.
CURVE_GATE = 3.0


class Source(IntEnum):
    """What the ground speed rests on, numbered as in ISO 11783-7."""

    WHEEL = 0
    GROUND = 1
    BLENDED = 3


@dataclass(frozen=True)
class EstimatorNoise:
    """How far each part of the estimator's model is trusted; all above 0.

    Attributes
    ----------
    acceleration : float
        Random walk of the resistance, as acceleration, m/s^2 per sqrt(s).
    speed : float
        Random walk of the speed beyond the model's acceleration, m/s per sqrt(s).
    strength : float
        Random walk of ln(tau_max), 1 per sqrt(s).
    thrust : float
        Standard deviation of a wheel's thrust against its curve, as a share of its static
        load, dimensionless.
    slip : float
        Standard deviation of the slip at which a thrust is reached, dimensionless: errors
        of rolling radius and of the curve's shape, which matter most where it is steep.
    wheel_speed : float
        Standard deviation of a tachometer reading, rad/s.
    """

    acceleration: float = 0.28
    speed: float = 0.02
    strength: float = 0.04
    thrust: float = 0.04
    slip: float = 0.07
    wheel_speed: float = 0.02

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f'noise {field.name} must be above 0, got {value}')


@kernel
def predict(x, p, impulse, mass, q_speed, q_resistance, q_strength, dt):
    """Carry the estimate forward in time, in place.

    Parameters
    ----------
    x : ndarray, shape (2 + n,)
        State: m/s, N, ln(Pa).
    p : ndarray, shape (2 + n, 2 + n)
        Its covariance, in products of these units.
    impulse : float
        Thrust of all wheels over the time, N*s.
    mass : float
        kg.
    q_speed, q_resistance, q_strength : float
        Process noise, (m/s)^2, N^2 and 1 per second.
    dt : float
        Time, s, at least 0.
    """
    x[SPEED] += (impulse - x[RESISTANCE] * dt) / mass
    # Transition: v depends on d; all else stays. Rows, then columns.
    c = -dt / mass
    size = x.size
    for k in range(size):
        p[SPEED, k] += c * p[RESISTANCE, k]
    for k in range(size):
        p[k, SPEED] += c * p[k, RESISTANCE]
    p[SPEED, SPEED] += q_speed * dt
    p[RESISTANCE, RESISTANCE] += q_resistance * dt
    for k in range(FIRST_WHEEL, size):
        p[k, k] += q_strength * dt


@kernel
def forget(p, entry, variance):
    """Give up what is known of one entry of the state but its value, in place.

    Parameters
    ----------
    p : ndarray, shape (m, m)
        Covariance, in products of the state's units.
    entry : int
        Index of the entry.
    variance : float
        Its new variance, in the square of its unit.
    """
    p[entry, :] = 0.0
    p[:, entry] = 0.0
    p[entry, entry] = variance


@kernel
def take_in(x, p, h, gain, innovation, variance):
    """Take in one scalar measurement by any gain, in place; the Joseph form suits them all.

    Parameters
    ----------
    x : ndarray, shape (m,)
        State, each entry in its own unit.
    p : ndarray, shape (m, m)
        Its covariance, in products of these units.
    h : ndarray, shape (m,)
        Derivative of the measurement with respect to the state, in their units.
    gain : ndarray, shape (m,)
        Change of state per innovation, in their units.
    innovation : float
        Measured minus expected value, in the measurement's unit.
    variance : float
        Variance of the measurement, in the square of its unit, above 0.
    """
    x += gain * innovation
    left = np.eye(x.size) - np.outer(gain, h)
    p[:] = left @ p @ left.T + variance * np.outer(gain, gain)


@kernel
def thrust_curve(slipping, area, path):
    """Thrust per maximum shear stress, and its slope.

    Parameters
    ----------
    slipping : float
        Slip, -1 to 1.
    area : float
        Contact area A, m^2.
    path : float
        l/K: contact length over shear deformation modulus, dimensionless.

    Returns
    -------
    g, slope : float
        m^2, and m^2 per unit slip. Odd in slip.
    """
    y = abs(slipping) * path
    kappa = shear_deficit(y)
    g = math.copysign(area * (1.0 - kappa), slipping)
    # d(1 - kappa)/dy = (kappa - exp(-y))/y, which tends to 1/2 - y/3.
    slope = 0.5 - y / 3.0 if y < 1e-4 else (kappa - math.exp(-y)) / y
    return g, area * path * slope


@kernel
def update_thrusts(x, p, omega, thrust, wheels, variances, slip_deviation, least_speed, measured):
    """Take in the thrust of every wheel that slips measurably, in place.

    While the speed is measured, a wheel whose curve is not known well, or whose thrust lies
    far off it (its soil has changed), is used to learn the curve only, with a Schmidt gain.

    Parameters
    ----------
    x : ndarray, shape (2 + n,)
        State: m/s, N, ln(Pa).
    p : ndarray, shape (2 + n, 2 + n)
        Its covariance, in products of these units.
    omega : ndarray, shape (n,)
        Wheel speeds, rad/s.
    thrust : ndarray, shape (n,)
        Thrust from shaft torque, N.
    wheels : ndarray, shape (n, 5)
        r, J, b_f, A, l/K of each wheel, SI units.
    variances : ndarray, shape (n,)
        Variance of each thrust, N^2.
    slip_deviation : float
        Standard deviation of the curve along the slip axis, dimensionless.
    least_speed : float
        Speed below which slip is not used, m/s.
    measured : bool
        Whether a sensor measures the speed at present.
    """
    h = np.zeros(x.size)
    for j in range(omega.size):
        rim = wheels[j, RADIUS] * omega[j]
        v = x[SPEED]
        if not is_valid(v, rim, least_speed) or v * rim < 0.0:
            continue
        entry = FIRST_WHEEL + j
        heading = 1.0 if rim >= 0.0 else -1.0
        i = slip(v, rim)
        g, slope = thrust_curve(i, wheels[j, AREA], wheels[j, PATH])
        strength = math.exp(x[entry])
        expected = heading * strength * g
        # Slip over v: of 1 - v/rim when driving, of rim/v - 1 when braking.
        slip_per_v = -1.0 / rim if abs(rim) >= abs(v) else -rim / (v * v)
        h[:] = 0.0
        h[SPEED] = heading * strength * slope * slip_per_v
        # A thrust against the slip tells of speed, not of strength.
        h[entry] = expected if expected * thrust[j] > 0.0 else 0.0
        innovation = thrust[j] - expected
        variance = variances[j] + (strength * slope * slip_deviation) ** 2
        ph = p @ h
        total = h @ ph + variance
        learn_only = False
        if measured:
            if innovation * innovation > CURVE_GATE**2 * total:
                forget(p, entry, CURVE_UNKNOWN**2)
                ph = p @ h
                total = h @ ph + variance
                learn_only = True
            elif p[entry, entry] > CURVE_KNOWN**2:
                learn_only = True
        gain = ph / total
        if learn_only:
            learnt = gain[entry]
            gain[:] = 0.0
            gain[entry] = learnt
        take_in(x, p, h, gain, innovation, variance)


class SlipEstimation:
    """Estimates slip, ground speed and soil strength from tachometers, torque and radar.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle, SI units.
    soil : Soil
        Nominal soil: gives contact area and shape of the thrust curve. Its strength is only
        where the estimate starts.
    noise : EstimatorNoise
        How far the model is trusted.
    least_speed : float
        Speed of rim or vehicle below which slip is not valid, m/s, above 0.
    radar_timeout : float
        Silence after which the ground speed no longer counts as measured, s, above 0.
    radar_variance : float
        Variance of a radar reading that does not state one, m^2/s^2, above 0.

    Attributes
    ----------
    t : float or None
        Time of the newest measurement, s; None before the first.
    slip, slip_variance : ndarray, shape (n,)
        Slip of every wheel, -1 to 1, and its variance.
    valid : ndarray of bool, shape (n,)
        Whether each slip means anything.
    rim_speed : ndarray, shape (n,)
        r*omega, m/s.
    thrust : ndarray, shape (n,)
        Thrust from shaft torque, N.
    """

    # A longer time between readings of the wheels, or between wheels and radar, s, means that
    # one of them was away or that a clock was set.
    LONGEST_GAP = 0.5
    # Time constant of the filter that thrust is found with, s: long against the sampling
    # period, short against the soil.
    _FILTER = 0.06
    # Innovations beyond this many standard deviations are not believed ...
    _GATE = 5.0
    # ... unless they go on for this long, s: then it is the estimate that is wrong.
    _LONGEST_DISBELIEF = 0.5
    # Weight of the newest radar reading in the mean innovation, and how large that mean may
    # grow, in standard deviations of one innovation (a third of which is its own).
    _SURPRISE_SHARE = 0.2
    _SURPRISE_LIMIT = 1.0
    # Ground speed is valid up to this standard deviation, m/s.
    _LARGEST_DEVIATION = 0.5

    def __init__(
        self,
        vehicle: Vehicle,
        soil: Soil,
        noise: EstimatorNoise = EstimatorNoise(),
        least_speed: float = LEAST_SPEED,
        radar_timeout: float = 0.5,
        radar_variance: float = 0.0025,
    ) -> None:
        for name, value in (
            ('least_speed', least_speed),
            ('radar_timeout', radar_timeout),
            ('radar_variance', radar_variance),
        ):
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f'{name} must be above 0, got {value}')
        self.vehicle = vehicle
        self.noise = noise
        self.least_speed = least_speed
        self.radar_timeout = radar_timeout
        self.radar_variance = radar_variance
        self._mass = vehicle.mass

        loads = vehicle.static_loads()
        rows = []
        strengths = []
        for wheel, load in zip(vehicle.wheels, loads, strict=True):
            z = equilibrium_sinkage(
                int(Form.CONTACT), 0.0, 0.0, load, soil.packed(wheel), wheel.radius, wheel.width
            )
            length = wheel.radius * math.acos(1 - z / wheel.radius)
            area = wheel.width * length
            rows.append(
                [
                    wheel.radius,
                    wheel.inertia,
                    wheel.viscous_friction,
                    area,
                    length / soil.shear_deformation_modulus,
                ]
            )
            strengths.append(math.log(soil.max_shear_stress(load / area)))
        self._wheels = np.array(rows)
        self._strengths = np.array(strengths)
        # What holds the vehicle back is at first unknown by 0.3 of its weight.
        self._unknown_resistance = 0.3 * float(loads.sum())
        self._thrust_variances = (noise.thrust * loads) ** 2
        self.reset()

    @property
    def n_wheels(self) -> int:
        """Number of wheels, dimensionless."""
        return len(self._wheels)

    def reset(self) -> None:
        """Forget everything measured: at rest, on the nominal soil."""
        n = self.n_wheels
        self.t: float | None = None
        self._x = np.concatenate([[0.0, 0.0], self._strengths])
        # Strength unknown by 40 %; speed is found with the first reading of the wheels.
        self._p = np.diag([1.0, self._unknown_resistance**2, *[0.4**2] * n])
        self._radar_t = -math.inf
        self._disbelieved_since: float | None = None
        self._surprise = 0.0
        self._smooth_omega = np.zeros(n)
        self._smooth_drive = np.zeros(n)
        self._omega = np.zeros(n)
        self.thrust = np.zeros(n)
        self.slip = np.zeros(n)
        self.slip_variance = np.ones(n)
        self.valid = np.zeros(n, dtype=bool)
        self.rim_speed = np.zeros(n)

    @property
    def v(self) -> float:
        """Speed over ground, m/s, forward positive."""
        return float(self._x[SPEED])

    @property
    def v_variance(self) -> float:
        """Variance of `v`, m^2/s^2."""
        return float(self._p[SPEED, SPEED])

    @property
    def v_valid(self) -> bool:
        """Whether `v` is known to better than 0.5 m/s (standard deviation)."""
        return self.t is not None and self.v_variance < self._LARGEST_DEVIATION**2

    @property
    def source(self) -> Source:
        """What `v` rests on at present."""
        silent = self.t is None or self.t - self._radar_t > self.radar_timeout
        return Source.WHEEL if silent else Source.BLENDED

    @property
    def resistance(self) -> float:
        """All that holds the vehicle back, N, positive against forward motion."""
        return float(self._x[RESISTANCE])

    @property
    def resistance_variance(self) -> float:
        """Variance of `resistance`, N^2."""
        return float(self._p[RESISTANCE, RESISTANCE])

    @property
    def max_shear_stress(self) -> NDArray[np.float64]:
        """tau_max over the nominal contact area of every wheel, Pa, shape (n,)."""
        return np.asarray(np.exp(self._x[FIRST_WHEEL:]))

    @property
    def max_shear_stress_variance(self) -> NDArray[np.float64]:
        """Variance of `max_shear_stress`, Pa^2, shape (n,)."""
        return np.asarray(self.max_shear_stress**2 * np.diag(self._p)[FIRST_WHEEL:])

    @property
    def strength_known(self) -> NDArray[np.bool_]:
        """Whether each wheel has slipped enough to tell its tau_max to 15 %, shape (n,)."""
        return np.asarray(np.diag(self._p)[FIRST_WHEEL:] < CURVE_KNOWN**2)

    @property
    def slip_stiffness(self) -> NDArray[np.float64]:
        """Slope of thrust over slip at the present slip of every wheel, N, shape (n,)."""
        slopes = [
            thrust_curve(i, wheel[AREA], wheel[PATH])[1]
            for i, wheel in zip(self.slip, self._wheels, strict=True)
        ]
        return np.asarray(self.max_shear_stress * slopes)

    def wheel_states(self, t: float, omega: ArrayLike, torque: ArrayLike) -> None:
        """Take in a reading of all tachometers and shaft torques.

        Parameters
        ----------
        t : float
            Time of measurement, s.
        omega : array_like, shape (n,)
            Wheel speeds, rad/s, forward positive.
        torque : array_like, shape (n,)
            Shaft torques, N*m, forward positive.

        Raises
        ------
        ValueError
            If a number is not finite, their count is not that of the wheels, or time runs
            backwards; nothing is taken in then.
        """
        omega = self._checked('wheel speed', omega)
        torque = self._checked('shaft torque', torque)
        dt = self._elapsed(t)
        if dt > self.LONGEST_GAP:
            # Whatever happened meanwhile, it is not known.
            self.reset()
            dt = 0.0
        drive = torque - self._wheels[:, FRICTION] * omega
        radii = self._wheels[:, RADIUS]
        if self.t is None:
            self._smooth_omega = omega.copy()
            self._smooth_drive = drive.copy()
            self._omega = omega.copy()
            # Rolling, give or take half of it: the wheels may be slipping already.
            rim = float(np.median(radii * omega))
            self._x[SPEED] = rim
            forget(self._p, SPEED, 1.0 + (0.5 * rim) ** 2)
            self.thrust = drive / radii
        elif dt > 0.0:
            # One and the same filter on torque and on the wheel's acceleration, so that their
            # difference is the filtered thrust.
            share = 1.0 - math.exp(-dt / self._FILTER)
            acceleration = share / dt * (omega - self._smooth_omega)
            self._smooth_omega += share * (omega - self._smooth_omega)
            self._smooth_drive += share * (drive - self._smooth_drive)
            self.thrust = (self._smooth_drive - self._wheels[:, INERTIA] * acceleration) / radii
        # The impulse needs no filter: a tachometer's errors cancel from reading to reading.
        impulse = (drive * dt - self._wheels[:, INERTIA] * (omega - self._omega)) / radii
        self._advance(t, dt, float(np.sum(impulse)))
        self._omega = omega
        self.rim_speed = radii * omega

        update_thrusts(
            self._x, self._p, omega, self.thrust, self._wheels, self._thrust_variances,
            self.noise.slip, self.least_speed, self.source != Source.WHEEL,
        )  # fmt: skip
        if np.max(np.abs(self.rim_speed)) < self.least_speed:
            self._stand_still()
        self._derive()

    def radar(self, t: float, v: float, variance: float) -> bool:
        """Take in a radar reading.

        Parameters
        ----------
        t : float
            Time of measurement, s.
        v : float
            Speed over ground, m/s, forward positive.
        variance : float
            Its variance, m^2/s^2; 0 stands for `radar_variance`.

        Returns
        -------
        bool
            False where the reading was not believed: more than five standard deviations
            from what is expected. If that goes on for half a second, the estimate is given
            up for the reading. False too before the first reading of the wheels.

        Raises
        ------
        ValueError
            If a number is not finite, the variance is negative, or the time is half a second
            or more off that of the wheels; nothing is taken in.
        """
        if not math.isfinite(t):
            raise ValueError(f'time of measurement is not finite: {t}')
        if not (math.isfinite(v) and math.isfinite(variance) and variance >= 0):
            raise ValueError(
                f'radar reading {v} m/s with variance {variance} m^2/s^2 is not usable'
            )
        if self.t is None:
            return False
        if abs(t - self.t) > self.LONGEST_GAP:
            raise ValueError(f'radar reading is {t - self.t:+.3f} s off the wheels in time')
        variance = variance or self.radar_variance
        # It counts as of the newest reading of the wheels: the delay of a radar is short against
        # the changes of speed of a tractor.
        now = self.t
        if self._unlikely(v, variance):
            if self._disbelieved_since is None:
                self._disbelieved_since = now
            if now - self._disbelieved_since < self._LONGEST_DISBELIEF:
                return False
            self._x[SPEED] = v
            forget(self._p, SPEED, variance)
            self._doubt()
        else:
            self._surprise *= 1.0 - self._SURPRISE_SHARE
            expected = math.sqrt(self.v_variance + variance)
            self._surprise += self._SURPRISE_SHARE * (v - self.v) / expected
            if abs(self._surprise) > self._SURPRISE_LIMIT:
                # Several readings on the same side: the soil has changed.
                self._doubt()
            self._measure_speed(v, variance)
        self._disbelieved_since = None
        self._radar_t = now
        self._derive()
        return True

    def _stand_still(self) -> None:
        """Below the least speed of all wheels: nothing better is known than the slowest rim."""
        rim = float(self.rim_speed[np.argmin(np.abs(self.rim_speed))])
        variance = (0.02 + 0.5 * abs(rim)) ** 2
        if self.source is not Source.WHEEL and self._unlikely(rim, variance):
            # Wheels that are locked, not a vehicle that stands.
            return
        self._measure_speed(rim, variance)
        # At rest resistance is whatever thrust is, and says nothing about driving.
        forget(self._p, RESISTANCE, self._unknown_resistance**2)

    def _unlikely(self, v: float, variance: float) -> bool:
        """Whether a measured speed is too far from the estimate to be believed."""
        return (v - self.v) ** 2 > self._GATE**2 * (self.v_variance + variance)

    def _measure_speed(self, v: float, variance: float) -> None:
        h = np.zeros(len(self._x))
        h[SPEED] = 1.0
        gain = self._p[:, SPEED] / (self.v_variance + variance)
        take_in(self._x, self._p, h, gain, v - self.v, variance)

    def _doubt(self) -> None:
        """Keep the values of soil strength and resistance, but trust them little."""
        for entry in range(FIRST_WHEEL, len(self._x)):
            forget(self._p, entry, CURVE_UNKNOWN**2)
        forget(self._p, RESISTANCE, self._unknown_resistance**2)
        self._p[SPEED, SPEED] += self.noise.speed**2
        self._surprise = 0.0

    def _elapsed(self, t: float) -> float:
        if not math.isfinite(t):
            raise ValueError(f'time of measurement is not finite: {t}')
        if self.t is None:
            return 0.0
        if t < self.t:
            raise ValueError(f'time runs backwards: {t:.6f} s after {self.t:.6f} s')
        return t - self.t

    def _advance(self, t: float, dt: float, impulse: float) -> None:
        noise = self.noise
        predict(
            self._x, self._p, impulse, self._mass,
            noise.speed**2, (noise.acceleration * self._mass) ** 2, noise.strength**2, dt,
        )  # fmt: skip
        self.t = t

    def _derive(self) -> None:
        """Slip of every wheel, with variance and validity, from the present speeds."""
        v, v_variance = self.v, self.v_variance
        for j, rim in enumerate(self.rim_speed):
            fastest = max(abs(v), abs(rim), 1e-3)
            self.slip[j] = slip(v, rim)
            # The smaller speed over the larger: an error of either one counts by the other.
            rim_variance = (self._wheels[j, RADIUS] * self.noise.wheel_speed) ** 2
            ratio = min(abs(v), abs(rim)) / fastest
            of_v, of_rim = (1.0, ratio) if abs(rim) >= abs(v) else (ratio, 1.0)
            self.slip_variance[j] = min(
                1.0, (of_v**2 * v_variance + of_rim**2 * rim_variance) / fastest**2
            )
            self.valid[j] = is_valid(v, rim, self.least_speed) and self.v_valid

    def _checked(self, what: str, values: ArrayLike) -> NDArray[np.float64]:
        array = np.asarray(values, dtype=float)
        if array.shape != (self.n_wheels,):
            raise ValueError(
                f'expected a {what} for each of {self.n_wheels} wheels, got {array.size}'
            )
        for name, value in zip(self.vehicle.wheel_names, array, strict=True):
            if not math.isfinite(value):
                raise ValueError(f"{what} of wheel '{name}' is {value}")
        return array
