"""Ground speed from the positions of a satellite receiver (GNSS), with rejection of jumps.

A Kalman filter per axis with position p and mean velocity u over the time between two fixes,

    u(k) = u(k-1) + d(r*omega)*e + noise,    p(k) = p(k-1) + u(k)*dt,

where e is the direction of travel and d(r*omega) the change of rim speed since the interval
before. Each fix is compared with the position predicted from earlier fixes and wheels. A fix
outside the gate is a jump (multipath, a change of satellites) and is rejected. If the following
fixes agree with it and with each other, the track restarts from them, with their speed. The jump
does not count as distance travelled.
"""

import math
from collections import deque
from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_node.positive import check_positive

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GnssNoise:
    """Deviations of fixes and motion in the filter of positions; all above 0.

    Attributes
    ----------
    position : float
        Standard deviation of a horizontal position relative to the fixes around it, m. It is
        much smaller than the accuracy that receivers state, whose errors change slowly.
    height : float
        The same for the height, m.
    acceleration : float
        Random walk of the velocity beyond the change of rim speed, m/s per sqrt(s).
    manoeuvre : float
        The same as a share of the speed, 1 per sqrt(s): changes of heading and slip.
    wheels : float
        Standard deviation of the change of ground speed for a change of rim speed, as a share
        of that change, dimensionless.
    """

    position: float = 0.02
    height: float = 0.04
    acceleration: float = 0.1
    manoeuvre: float = 0.1
    wheels: float = 0.5

    def __post_init__(self) -> None:
        check_positive(**{f'noise {name}': value for name, value in asdict(self).items()})


class RimTravel:
    """Rim travel of the last seconds: integral of rim speed.

    Parameters
    ----------
    memory : float
        Length of the history, s, above 0.
    """

    # Extrapolation beyond the newest reading at constant speed, s.
    _AHEAD = 0.5

    def __init__(self, memory: float) -> None:
        self._memory = memory
        self._readings: deque[tuple[float, float, float]] = deque()

    def add(self, t: float, rim_speed: float) -> None:
        """Add a reading of rim speed.

        Parameters
        ----------
        t : float
            Time, s; a time before that of the last call clears the history.
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
        """Travel at a time.

        Parameters
        ----------
        t : float
            Time, s.

        Returns
        -------
        float
            Travel from an arbitrary origin, m; NaN outside the history.
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
    """Position and mean velocity on each of d axes, with covariance.

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
        """Predict.

        Parameters
        ----------
        dt : float
            Time, s.
        change : ndarray, shape (d,)
            Change of velocity, m/s.
        growth : float
            Growth of the variance of velocity, m^2/s^2.

        Returns
        -------
        Motion
            At the end of the time, SI units.
        """
        u, uu = self.u + change, self.uu + growth
        pp = self.pp + 2 * dt * self.pu + dt * dt * uu
        return Motion(self.p + u * dt, u, pp, self.pu + dt * uu, uu)

    def off(self, kind: int, measured: Array, variance: Array) -> float:
        """Distance of a measurement in standard deviations.

        Parameters
        ----------
        kind : int
            `POSITION` or `VELOCITY`.
        measured, variance : ndarray, shape (d,)
            Measurement, m or m/s, and its variance, in the square of that unit.

        Returns
        -------
        float
            Norm of the normalised innovation, dimensionless.
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
            Measurement, m or m/s, and its variance, in the square of that unit.

        Returns
        -------
        Motion
            Updated motion, SI units.
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
            # Joseph form, expanded per axis.
            self.pp - 2 * gain_p * with_p + gain_p * gain_p * total,
            self.pu - gain_p * with_u - gain_u * with_p + gain_p * gain_u * total,
            self.uu - 2 * gain_u * with_u + gain_u * gain_u * total,
        )


class GnssTrack:
    """Ground speed, distance and heading from fixes, with rejection of jumps.

    Parameters
    ----------
    noise : GnssNoise
        Noise of fixes and motion.
    latency : float
        Delay of the stamp after the measurement, s, at least 0; 0 if the receiver stamps the
        time of measurement.
    min_speed : float
        Ground speed below which speed and heading are not valid, m/s, above 0. Two fixes dt
        apart give the speed with a standard deviation of sqrt(2)*position/dt: 0.3 m/s at 10 Hz.
        The filter reduces it to about 0.05 m/s.
    gate : float
        Distance from the predicted position above which a fix is rejected, in standard
        deviations, above 0, dimensionless.
    settling : float
        Time for which rejected fixes must agree with each other before the track restarts from
        them, s, above 0.

    Attributes
    ----------
    t : float or None
        Time of measurement of the newest fix, s; None before the first.
    distance : float
        Distance travelled while the speed was valid, m; negative in reverse. The sign comes from
        the wheels.
    refused : int
        Number of fixes rejected so far.
    rebased : int
        Number of restarts of the track from fixes that were rejected first.
    reading, reading_variance : float
        Speed at `speed_t` from the newest fix alone, m/s, and its variance, m^2/s^2. It is meant
        for another filter, since consecutive values of `speed` are correlated. The variance is
        infinite if the fix has no information on speed or was rejected.
    """

    # Time without a fix after which the track is reset, s.
    LONGEST_GAP = 2.0
    # Largest standard deviation of a valid speed, m/s, and that of an unknown speed.
    _LARGEST_DEVIATION = 0.5
    _UNKNOWN_SPEED = 10.0
    # Smallest number of fixes that must agree before the track restarts from them.
    _MIN_FIXES = 4
    # Standard deviation of the velocity when fixes start to be rejected, as a share of it:
    # from standstill to twice the speed lies within the gate.
    _CHANGED = 0.25

    def __init__(
        self,
        noise: GnssNoise = GnssNoise(),
        latency: float = 0.0,
        min_speed: float = 0.3,
        gate: float = 4.5,
        settling: float = 0.3,
    ) -> None:
        check_positive(min_speed=min_speed, gate=gate, settling=settling)
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
        """Reset position and speed; distance and counts are kept."""
        self.t: float | None = None
        self._motion: Motion | None = None
        self.reading, self.reading_variance = 0.0, math.inf
        self._accepted_t = -math.inf
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
        """Time of `speed`, s: the middle between the last two fixes."""
        return math.nan if self.t is None else self.t - 0.5 * self._dt

    @property
    def valid(self) -> bool:
        """True if speed and heading can be used: above `min_speed`, accurate, fixes accepted."""
        return (
            self._motion is not None
            and self.t is not None
            and abs(self.speed) >= self.min_speed
            and self.speed_variance < self._LARGEST_DEVIATION**2
            and self.t - self._accepted_t <= self.LONGEST_GAP
        )

    @property
    def heading(self) -> float:
        """Heading of the vehicle, rad, counter-clockwise from the first axis (east)."""
        if self._motion is None:
            return 0.0
        east, north = self._sense * self._motion.u[:2]
        return math.atan2(north, east)

    @property
    def position(self) -> Array:
        """Filtered position, m, shape (2,) or (3,); NaN before the first fix."""
        return np.full(2, math.nan) if self._motion is None else self._motion.p.copy()

    def wheels(self, t: float, rim_speed: float) -> None:
        """Add a reading of the wheels, for the prediction of the next fix.

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
            False if it was rejected.

        Raises
        ------
        ValueError
            If a number is not finite, there are not 2 or 3 of them or not as many as before,
            or time runs backwards. The track is then unchanged.
        """
        place = self._checked('position', position)
        variance = np.array([self.noise.position**2] * 2 + [self.noise.height**2])[: place.size]
        return self._receive(t, POSITION, place, variance)

    def velocity(self, t: float, velocity: ArrayLike, variance: float) -> bool:
        """Update with a velocity, measured by Doppler shift.

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
            False if it was rejected.

        Raises
        ------
        ValueError
            As `fix`, or if the variance is not above 0.
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
            self.t = self._accepted_t = t
            return True
        before = self._motion.p
        motion = expected = self._carry(t)
        off = motion.off(kind, measured, variance)
        # The gate widens with the time without accepted fixes. A fix nearer to the trial track
        # belongs to that.
        accepted = off <= self.gate
        if self._trial is not None:
            accepted = off <= min(self.gate / 2, self._trial.off(kind, measured, variance))
        if accepted:
            self._trial = None
            motion = motion.corrected(kind, measured, variance)
        else:
            self.refused += 1
            trial = self._try(motion, kind, measured, variance)
            if trial is not None:
                # Restart from the trial track; the jump is not distance travelled.
                before = before + trial.p - motion.p
                motion = trial
                accepted = True
                self.rebased += 1
                self._trial = None
        if accepted:
            self._accepted_t = t
        self._motion = motion
        self._read(expected, accepted)
        if self.valid:
            self.distance += self._sense * float(self._direction @ (motion.p - before))
        return accepted

    def _read(self, expected: Motion, accepted: bool) -> None:
        """Set `reading`: the information on speed that a fix has added."""
        assert self._motion is not None
        self.reading, self.reading_variance = self.speed, math.inf
        direction = self._direction
        before, after = float(direction**2 @ expected.uu), self.speed_variance
        if accepted and self.valid and after < (1.0 - 1e-9) * before:
            # Inverse of the update: the independent reading that gives the present mean.
            share = before / (before - after)
            was = self._sense * float(direction @ expected.u)
            self.reading = was + share * (self.speed - was)
            self.reading_variance = share * after

    @staticmethod
    def _start(kind: int, measured: Array, variance: Array, u: Array, deviation: float) -> Motion:
        """Start a track from its first measurement with velocity u and its deviation."""
        nothing = np.zeros(measured.size)
        if kind == VELOCITY:
            # Only differences of position matter.
            return Motion(nothing, measured, nothing + variance, nothing, variance)
        return Motion(measured, u, variance, nothing, nothing + deviation**2)

    def _carry(self, t: float) -> Motion:
        """Predict the track and the trial track at the time of a measurement."""
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
                # Direction of travel unknown.
                growth += faster**2
        self.t, self._dt = t, dt
        if self._trial is not None:
            self._trial = self._trial.carried(dt, change, growth)
        return self._motion.carried(dt, change, growth)

    def _try(self, motion: Motion, kind: int, measured: Array, variance: Array) -> Motion | None:
        """Track rejected measurements; return their track when enough of them agree."""
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
