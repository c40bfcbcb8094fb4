"""Ground speed from a satellite receiver (GNSS): positions that may jump, judged by the wheels.

A Kalman filter on position p and mean velocity u over the time between two fixes, on every
axis,

    u(k) = u(k-1) + d(r*omega)*e + noise,    p(k) = p(k-1) + u(k)*dt,

with e the direction of travel and d(r*omega) by how much the wheels turned faster than in the
interval before. So a fix is compared with where earlier fixes and wheels put the vehicle. One
that is further off is a jump (multipath, a change of satellites) and is refused; should the
fixes that follow agree with it and with each other, the track goes on from there: with the
speed that they show, and without counting the jump as a way travelled.
"""

import math
from collections import deque
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GnssNoise:
    """Deviations of fixes and motion in the filter of positions; all above 0.

    Attributes
    ----------
    position : float
        Standard deviation of a horizontal position against its neighbours in time, m. Much
        less than what receivers state, most of which stays the same from fix to fix.
    height : float
        The same of the height, m.
    acceleration : float
        Random walk of the velocity that wheels do not show, m/s per sqrt(s).
    manoeuvre : float
        The same per speed, 1 per sqrt(s): changes of heading and of slip.
    wheels : float
        Standard deviation of how much of a change of the wheels' speed the vehicle follows,
        as a share of the change, dimensionless.
    """

    position: float = 0.02
    height: float = 0.04
    acceleration: float = 0.1
    manoeuvre: float = 0.1
    wheels: float = 0.5

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f'noise {field.name} must be above 0, got {value}')


class RimTravel:
    """Way that the wheels have rolled, of the last seconds.

    Parameters
    ----------
    memory : float
        How far back it is known, s, above 0.
    """

    # Beyond the newest reading the wheels are taken to turn on for this long, s.
    _AHEAD = 0.5

    def __init__(self, memory: float) -> None:
        self._memory = memory
        self._readings: deque[tuple[float, float, float]] = deque()

    def add(self, t: float, rim_speed: float) -> None:
        """Add the speed of the wheels' rims.

        Parameters
        ----------
        t : float
            Time, s; a time before that of the last call forgets everything.
        rim_speed : float
            r*omega, mean of the wheels, m/s, forward positive.
        """
        readings = self._readings
        if readings and not 0.0 <= t - readings[-1][0] <= self._memory:
            readings.clear()
        travel = 0.0
        if readings:
            last, before, speed = readings[-1]
            travel = before + 0.5 * (speed + rim_speed) * (t - last)
        readings.append((t, travel, rim_speed))
        while t - readings[0][0] > self._memory:
            readings.popleft()

    def at(self, t: float) -> float:
        """Find the travel at a time.

        Parameters
        ----------
        t : float
            Time, s.

        Returns
        -------
        float
            Travel since some moment, m; NaN where it is not known.
        """
        readings = self._readings
        if not readings or t < readings[0][0] or t > readings[-1][0] + self._AHEAD:
            return math.nan
        later = readings[-1]
        if t >= later[0]:
            return later[1] + later[2] * (t - later[0])
        for earlier in reversed(readings):
            if earlier[0] <= t:
                share = (t - earlier[0]) / (later[0] - earlier[0])
                return earlier[1] + share * (later[1] - earlier[1])
            later = earlier
        return math.nan


POSITION, VELOCITY = range(2)


class Motion(NamedTuple):
    """Position and mean velocity on each of d axes, and how well they are known.

    Attributes
    ----------
    p, u : ndarray, shape (d,)
        Position, m, and velocity, m/s.
    pp, pu, uu : ndarray, shape (d,)
        Variance of p, m^2, covariance of both, m^2/s, and variance of u, m^2/s^2.
    """

    p: Array
    u: Array
    pp: Array
    pu: Array
    uu: Array

    def carried(self, dt: float, change: Array, growth: float) -> 'Motion':
        """Move on.

        Parameters
        ----------
        dt : float
            Time, s.
        change : ndarray, shape (d,)
            Of velocity, m/s.
        growth : float
            Of the velocity's variance, m^2/s^2.

        Returns
        -------
        Motion
            At the end of the time, SI units.
        """
        u, uu = self.u + change, self.uu + growth
        pp = self.pp + 2 * dt * self.pu + dt * dt * uu
        return Motion(self.p + u * dt, u, pp, self.pu + dt * uu, uu)

    def off(self, kind: int, measured: Array, variance: Array) -> float:
        """Compare with a measurement.

        Parameters
        ----------
        kind : int
            `POSITION` or `VELOCITY`.
        measured, variance : ndarray, shape (d,)
            m or m/s, and its square.

        Returns
        -------
        float
            Standard deviations between the two, dimensionless.
        """
        expected, known = (self.p, self.pp) if kind == POSITION else (self.u, self.uu)
        return math.sqrt(float(np.sum((measured - expected) ** 2 / (known + variance))))

    def corrected(self, kind: int, measured: Array, variance: Array) -> 'Motion':
        """Kalman update with a measurement.

        Parameters
        ----------
        kind : int
            `POSITION` or `VELOCITY`.
        measured, variance : ndarray, shape (d,)
            m or m/s, and its square.

        Returns
        -------
        Motion
            With the measurement, SI units.
        """
        if kind == POSITION:
            off, with_p, with_u = measured - self.p, self.pp, self.pu
            total = self.pp + variance
        else:
            off, with_p, with_u = measured - self.u, self.pu, self.uu
            total = self.uu + variance
        gain_p, gain_u = with_p / total, with_u / total
        return Motion(
            self.p + gain_p * off,
            self.u + gain_u * off,
            # Joseph's form, multiplied out for every axis.
            self.pp - 2 * gain_p * with_p + gain_p * gain_p * total,
            self.pu - gain_p * with_u - gain_u * with_p + gain_p * gain_u * total,
            self.uu - 2 * gain_u * with_u + gain_u * gain_u * total,
        )


class GnssTrack:
    """Ground speed, distance and heading from fixes, with jumps taken out.

    Parameters
    ----------
    noise : GnssNoise
        How far fixes and motion are trusted.
    latency : float
        By how much a stamp is later than the measurement, s, at least 0; 0 where the receiver
        stamps the time of measurement.
    min_speed : float
        Ground speed below which speed and heading are not valid, m/s, above 0. Two fixes dt
        apart tell the speed to sqrt(2)*position/dt, whatever it is: 0.3 m/s at 10 Hz, which
        the filter brings down to about 0.05.
    gate : float
        Standard deviations from the expected place beyond which a fix is refused, above 0,
        dimensionless.
    settling : float
        For how long refused fixes must agree with each other before the track goes on from
        them, s, above 0.

    Attributes
    ----------
    t : float or None
        Time of measurement of the newest fix, s; None before the first.
    distance : float
        Way along the ground while the speed was valid, m; negative in reverse, which only
        wheels can tell.
    refused : int
        Number of fixes refused so far.
    rebased : int
        Number of times that the track went on from fixes first refused.
    reading, reading_variance : float
        What the newest fix alone says about the speed at `speed_t`, m/s, and its variance,
        m^2/s^2: for another filter, to which `speed` would tell the same again and again.
        Variance is infinite where the fix says nothing, or nothing that can be believed.
    """

    # Without a fix for this long, s, what was known of position and speed is given up.
    LONGEST_GAP = 2.0
    # Standard deviation of speed up to which it is valid, m/s, and that of one not known.
    _LARGEST_DEVIATION = 0.5
    _UNKNOWN_SPEED = 10.0
    # That many fixes at least must agree before the track goes on from them.
    _MIN_FIXES = 4
    # Standard deviation of the velocity where fixes begin to be refused, as a share of it:
    # within the gate the vehicle may stand, or go twice as fast.
    _CHANGED = 0.25

    def __init__(
        self,
        noise: GnssNoise = GnssNoise(),
        latency: float = 0.0,
        min_speed: float = 0.3,
        gate: float = 4.5,
        settling: float = 0.3,
    ) -> None:
        for name, value in (
            ('min_speed', min_speed),
            ('gate', gate),
            ('settling', settling),
        ):
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f'{name} must be above 0, got {value}')
        if not (math.isfinite(latency) and latency >= 0):
            raise ValueError(f'latency must be at least 0 s, got {latency}')
        self.noise = noise
        self.latency = latency
        self.min_speed = min_speed
        self.gate = gate
        self.settling = settling
        self.distance = 0.0
        self.refused = 0
        self.rebased = 0
        self._rim = RimTravel(self.LONGEST_GAP + latency + 1.0)
        self.reset()

    def reset(self) -> None:
        """Forget position and speed; distance and counts stay."""
        self.t: float | None = None
        self._motion: Motion | None = None
        self.reading, self.reading_variance = 0.0, math.inf
        self._believed_t = -math.inf
        self._dt = 0.0
        self._rim_speed = math.nan
        self._trial: Motion | None = None
        self._trial_since = 0.0
        self._trial_score = 0

    @property
    def speed(self) -> float:
        """Ground speed, m/s, negative in reverse; mean over the time before the newest fix."""
        if self._motion is None:
            return 0.0
        return self._sense * float(np.linalg.norm(self._motion.u))

    @property
    def speed_variance(self) -> float:
        """Variance of `speed`, m^2/s^2."""
        if self._motion is None:
            return self._UNKNOWN_SPEED**2
        return float(self._direction**2 @ self._motion.uu)

    @property
    def speed_t(self) -> float:
        """Time at which `speed` was the vehicle's, s: the middle between the last two fixes."""
        return math.nan if self.t is None else self.t - 0.5 * self._dt

    @property
    def valid(self) -> bool:
        """True where speed and heading can be used: fast enough, known, fixes not all refused."""
        return (
            self._motion is not None
            and self.t is not None
            and abs(self.speed) >= self.min_speed
            and self.speed_variance < self._LARGEST_DEVIATION**2
            and self.t - self._believed_t <= self.LONGEST_GAP
        )

    @property
    def heading(self) -> float:
        """Where the vehicle's front points, rad, counter-clockwise from the first axis (east)."""
        if self._motion is None:
            return 0.0
        east, north = self._sense * self._motion.u[:2]
        return math.atan2(north, east)

    @property
    def heading_variance(self) -> float:
        """Variance of `heading`, rad^2; infinite at standstill."""
        speed = 0.0 if self._motion is None else float(np.linalg.norm(self._motion.u[:2]))
        if speed == 0.0 or self._motion is None:
            return math.inf
        return float(np.max(self._motion.uu[:2])) / speed**2

    @property
    def position(self) -> Array:
        """Filtered position, m, shape (2,) or (3,); NaN before the first fix."""
        return np.full(2, math.nan) if self._motion is None else self._motion.p.copy()

    def wheels(self, t: float, rim_speed: float) -> None:
        """Note the speed of the wheels, which tells what the next fix should be.

        Parameters
        ----------
        t : float
            Time of measurement, s.
        rim_speed : float
            r*omega, mean of the driven wheels, m/s, forward positive.

        Raises
        ------
        ValueError
            If a number is not finite.
        """
        if not (math.isfinite(t) and math.isfinite(rim_speed)):
            raise ValueError(f'rim speed {rim_speed} m/s at {t} s is not usable')
        self._rim.add(t, rim_speed)

    def fix(self, t: float, position: ArrayLike) -> bool:
        """Update with a position.

        Parameters
        ----------
        t : float
            Stamp, s.
        position : array_like, shape (2,) or (3,)
            East, north and, if known, up, m, in any fixed frame.

        Returns
        -------
        bool
            False where it was refused.

        Raises
        ------
        ValueError
            If a number is not finite, there are not 2 or 3 of them or not as many as before,
            or time runs backwards; nothing is taken in then.
        """
        place = self._checked('position', position)
        variance = np.array([self.noise.position**2] * 2 + [self.noise.height**2])[: place.size]
        return self._receive(t, POSITION, place, variance)

    def velocity(self, t: float, velocity: ArrayLike, variance: float) -> bool:
        """Update with a velocity, as receivers measure it by the Doppler shift.

        Parameters
        ----------
        t : float
            Stamp, s.
        velocity : array_like, shape (2,) or (3,)
            East, north and, if known, up, m/s.
        variance : float
            Its variance on every axis, m^2/s^2, above 0.

        Returns
        -------
        bool
            False where it was refused.

        Raises
        ------
        ValueError
            As of `fix`, or if the variance is not above 0.
        """
        if not (math.isfinite(variance) and variance > 0):
            raise ValueError(f'variance of velocity must be above 0, got {variance} m^2/s^2')
        speeds = self._checked('velocity', velocity)
        return self._receive(t, VELOCITY, speeds, np.full(speeds.size, variance))

    @property
    def _sense(self) -> float:
        return -1.0 if self._rim_speed < 0 else 1.0

    @property
    def _direction(self) -> Array:
        """Unit vector of travel."""
        assert self._motion is not None
        u = self._motion.u
        length = float(np.linalg.norm(u))
        return u / length if length > 0 else np.full(u.size, 1 / math.sqrt(u.size))

    def _receive(self, t: float, kind: int, measured: Array, variance: Array) -> bool:
        if not math.isfinite(t):
            raise ValueError(f'time of measurement is not finite: {t}')
        t -= self.latency
        if self.t is not None and t < self.t:
            raise ValueError(f'time runs backwards: {t:.6f} s after {self.t:.6f} s')
        if self._motion is not None and self._motion.p.size != measured.size:
            raise ValueError(
                f'measurement has {measured.size} axes, those before had {self._motion.p.size}'
            )
        if self.t is None or self._motion is None or t - self.t > self.LONGEST_GAP:
            self.reset()
            still = np.zeros(measured.size)
            self._motion = self._start(kind, measured, variance, still, self._UNKNOWN_SPEED)
            self.t = self._believed_t = t
            return True
        before = self._motion.p
        motion = expected = self._carry(t)
        off = motion.off(kind, measured, variance)
        # The longer fixes are refused, the less a place is known: one that fits the track on
        # trial better belongs to that.
        believed = off <= self.gate
        if self._trial is not None:
            believed = off <= min(self.gate / 2, self._trial.off(kind, measured, variance))
        if believed:
            self._trial = None
            motion = motion.corrected(kind, measured, variance)
        else:
            self.refused += 1
            trial = self._try(motion, kind, measured, variance)
            if trial is not None:
                # It goes on from there; what lies between is no way travelled.
                before = before + trial.p - motion.p
                motion = trial
                believed = True
                self.rebased += 1
                self._trial = None
        if believed:
            self._believed_t = t
        self._motion = motion
        self._read(expected, believed)
        if self.valid:
            self.distance += self._sense * float(self._direction @ (motion.p - before))
        return believed

    def _read(self, expected: Motion, believed: bool) -> None:
        """Find what a fix has added to what was known of the speed."""
        assert self._motion is not None
        self.reading, self.reading_variance = self.speed, math.inf
        along = self._direction
        before, after = float(along**2 @ expected.uu), self.speed_variance
        if believed and self.valid and after < (1.0 - 1e-9) * before:
            # As of two independent readings whose mean is the present speed.
            share = before / (before - after)
            was = self._sense * float(along @ expected.u)
            self.reading = was + share * (self.speed - was)
            self.reading_variance = share * after

    @staticmethod
    def _start(kind: int, measured: Array, variance: Array, u: Array, deviation: float) -> Motion:
        """Begin a track with its first measurement, the velocity being u or so."""
        nothing = np.zeros(measured.size)
        if kind == VELOCITY:
            # Only differences of position count.
            return Motion(nothing, measured, nothing + variance, nothing, variance)
        return Motion(measured, u, variance, nothing, nothing + deviation**2)

    def _carry(self, t: float) -> Motion:
        """Carry the track, and the one on trial, to the time of a measurement."""
        assert self.t is not None
        assert self._motion is not None
        dt = t - self.t
        if dt == 0.0:
            return self._motion
        between = 0.5 * (dt + (self._dt or dt))
        rim = (self._rim.at(t) - self._rim.at(self.t)) / dt
        faster = rim - self._rim_speed
        self._rim_speed = rim
        u = self._motion.u
        speed = float(np.linalg.norm(u))
        change = np.zeros(u.size)
        growth = self.noise.acceleration**2 + (self.noise.manoeuvre * speed) ** 2
        growth *= between
        if math.isfinite(faster):
            if speed >= self.min_speed:
                change = self._sense * faster * self._direction
                growth += (self.noise.wheels * faster) ** 2
            else:
                # It is not known which way it goes.
                growth += faster**2
        self.t, self._dt = t, dt
        if self._trial is not None:
            self._trial = self._trial.carried(dt, change, growth)
        return self._motion.carried(dt, change, growth)

    def _try(self, motion: Motion, kind: int, measured: Array, variance: Array) -> Motion | None:
        """Follow refused measurements, and return their track once it can be trusted."""
        assert self.t is not None
        trial = self._trial
        fits = trial is not None and trial.off(kind, measured, variance) <= self.gate
        self._trial_score += 1 if fits else -1
        if trial is None or self._trial_score <= 0:
            deviation = self._CHANGED * max(float(np.linalg.norm(motion.u)), self.min_speed)
            self._trial = self._start(kind, measured, variance, motion.u, deviation)
            self._trial_since = self.t
            self._trial_score = 1
        elif fits:
            self._trial = trial.corrected(kind, measured, variance)
            lasted = self.t - self._trial_since >= self.settling - 1e-9
            if lasted and self._trial_score >= self._MIN_FIXES:
                return self._trial
        return None

    @staticmethod
    def _checked(what: str, values: ArrayLike) -> Array:
        array = np.asarray(values, dtype=float)
        if array.shape not in ((2,), (3,)):
            raise ValueError(f'{what} needs 2 or 3 entries (east, north, up), got {array.size}')
        if not np.all(np.isfinite(array)):
            raise ValueError(f'{what} is not finite: {array}')
        return array
