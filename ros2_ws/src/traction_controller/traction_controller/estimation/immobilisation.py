"""Warning of immobilisation before the vehicle stands.

A wheel that spins at standstill digs itself in. So the warning must come while the vehicle still
moves and the driver can act: raise the hitch, reduce draft, lock the differentials. Three signs
are extrapolated at their present rate to the time of standstill:

- *stalling*: ground speed falls at constant torque, as resistance exceeds gross traction;
- *digging in*: wheel speed rises while ground speed falls, as the strength of the soil is
exhausted; - *sinking*: sinkage grows steadily, and motion resistance with it.

A fourth sign has no rate. *Slipping*: most of the power is lost in slip. Slip of all driven wheels
is the share of power lost, ``1 - v*sum(T/r)/sum(T*omega)``.
"""

import math
from collections import deque
from dataclasses import asdict, dataclass
from enum import Enum, IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_node.positive import check_positive

Array = NDArray[np.float64]


class Level(IntEnum):
    """Degree of immobilisation."""

    NONE = 0
    WARNING = 1
    IMMOBILISED = 2


class Reason(Enum):
    """Cause of a warning."""

    NONE = ''
    STALLING = 'ground speed falls though torque goes on'
    DIGGING_IN = 'wheels speed up while ground speed falls'
    SLIPPING = 'most of the power is lost in slip'
    SINKING = 'wheels sink in steadily'
    STUCK = 'stands though torque goes on'


@dataclass(frozen=True)
class WarningLimits:
    """Thresholds of the warnings; all above 0.

    Attributes
    ----------
    horizon : float
        Time to standstill at the present rate below which a warning is given, s.
    min_speed : float
        Ground speed below which the vehicle counts as standing, m/s.
    slip : float
        Share of power lost in slip above which a warning is given, dimensionless.
    digging_slip : float
        Share above which falling ground speed and rising wheel speed mean digging in.
    mobilised : float
        Gross traction over the strength of the soil above which the strength counts as
        exhausted, dimensionless; `digging_slip` is then halved.
    effort : float
        Drive torque over rolling radius and weight, below which no warning is given,
        dimensionless.
    sinkage : float
        Sinkage over radius at which a wheel counts as stuck, dimensionless.
    confirmation : float
        Time for which a sign must last, s.
    release : float
        Time without signs before a warning is withdrawn, s.
    """

    horizon: float = 1.5
    min_speed: float = 0.3
    slip: float = 0.6
    digging_slip: float = 0.3
    mobilised: float = 0.95
    effort: float = 0.05
    sinkage: float = 0.8
    confirmation: float = 0.1
    release: float = 1.0

    def __post_init__(self) -> None:
        check_positive(**{f'limit {name}': value for name, value in asdict(self).items()})


class _Trend:
    """A smoothed value and its rate."""

    def __init__(self) -> None:
        self.value = math.nan
        self.rate = 0.0

    def follow(self, value: float, share: float, dt: float) -> None:
        if math.isnan(self.value) or not math.isfinite(value):
            # An unknown value has no rate.
            self.value, self.rate = value, 0.0
            return
        change = share * (value - self.value)
        self.value += change
        self.rate += share * (change / dt - self.rate)


class Immobilisation:
    """Warning of immobilisation from speeds, slip, traction and sinkage.

    Parameters
    ----------
    radii : array_like, shape (n,)
        Rolling radii, m, above 0.
    weight : float
        Weight of the vehicle, N, above 0.
    limits : WarningLimits
        Thresholds of the warnings.

    Attributes
    ----------
    level : Level
        Degree of immobilisation.
    reason : Reason
        Cause while `level` is not NONE.
    time_left : float
        Time to standstill at the present rate, s; infinite without signs, 0 when stuck.
    slip : float
        Share of the power lost in slip, 0 to 1.
    """

    # Time constant of the trends, s: short against the horizon, long against sensor noise and
    # vibration from the lugs.
    _TREND = 0.3
    # Torque counts as constant while it is at least this share of its maximum of the last seconds.
    _GOES_ON = 0.85
    _TORQUE_MEMORY = 4.0
    # Time of constant torque before its effect on speed and trend is complete, s.
    _FOLLOWED = 0.5
    # Largest interval between readings, s; a longer one restarts the trends.
    _LONGEST_GAP = 0.5
    # Time at standstill with torque before the vehicle counts as stuck, s: moving off takes as
    # long.
    _STANDING = 1.5

    def __init__(
        self, radii: ArrayLike, weight: float, limits: WarningLimits = WarningLimits()
    ) -> None:
        self._radii = np.atleast_1d(np.asarray(radii, dtype=float))
        if self._radii.ndim != 1 or not np.all(np.isfinite(self._radii) & (self._radii > 0)):
            raise ValueError(f'radii must be above 0 m, got {radii!r}')
        if not (math.isfinite(weight) and weight > 0):
            raise ValueError(f'weight must be above 0 N, got {weight}')
        self._weight = weight
        self.limits = limits
        self.reset()

    def reset(self) -> None:
        """Reset to the initial state: no warning."""
        self.level = Level.NONE
        self.reason = Reason.NONE
        self.time_left = math.inf
        self.slip = 0.0
        self._t: float | None = None
        self._reset_trends()
        self._signs_since: float | None = None
        self._well_since: float | None = None
        self._standing_since: float | None = None

    def _reset_trends(self) -> None:
        self._speed, self._rim, self._depth = _Trend(), _Trend(), _Trend()
        # Falling torques of the last seconds: the first is the maximum.
        self._pulls: deque[tuple[float, float]] = deque()
        self._goes_on_since = math.inf

    def step(
        self,
        t: float,
        v: float,
        omega: ArrayLike,
        torque: ArrayLike,
        mobilised: float = math.nan,
        sinkage: ArrayLike = math.nan,
        asked: bool = True,
    ) -> Level:
        """Update with one reading.

        Parameters
        ----------
        t : float
            Time, s.
        v : float
            Speed over ground, m/s, forward positive.
        omega : array_like, shape (n,)
            Wheel speeds, rad/s, forward positive.
        torque : array_like, shape (n,)
            Shaft torques, N·m, forward positive.
        mobilised : float
            Gross traction of all driven wheels over the strength of the soil, dimensionless; NaN
            if unknown.
        sinkage : array_like, shape (n,) or ()
            Sinkage of every wheel, m; NaN if unknown.
        asked : bool
            False if no torque is asked for: torque then does not drive the vehicle, such as that
            of an engine that turns an implement.

        Returns
        -------
        Level
            The new `level`.

        Raises
        ------
        ValueError
            If a number is not finite (except `mobilised` and `sinkage`), the number of values is
            wrong, or time runs backwards. The state is then unchanged.
        """
        speeds, torques = self._checked('wheel speed', omega), self._checked('torque', torque)
        if not (math.isfinite(t) and math.isfinite(v)):
            raise ValueError(f'speed {v} m/s at {t} s is not usable')
        if self._t is not None and t < self._t:
            raise ValueError(f'time runs backwards: {t:.6f} s after {self._t:.6f} s')
        dt = 0.0 if self._t is None else t - self._t
        self._t = t
        if dt > self._LONGEST_GAP:
            self._reset_trends()
        if math.isinf(self._goes_on_since):
            self._goes_on_since = t
        # Signs relative to the direction of pull.
        pulls = torques / self._radii
        direction = 1.0 if float(pulls.sum()) >= 0 else -1.0
        driven = np.maximum(direction * pulls, 0.0)
        pull = float(driven.sum())
        rim = direction * float(driven @ (self._radii * speeds)) / pull if pull > 0 else 0.0
        speed = direction * v
        depths = np.broadcast_to(np.asarray(sinkage, dtype=float), self._radii.shape)
        depth = float(np.max(depths / self._radii))
        if dt > 0 or math.isnan(self._speed.value):
            share = 1.0 - math.exp(-dt / self._TREND)
            for trend, value in ((self._speed, speed), (self._rim, rim), (self._depth, depth)):
                trend.follow(value, share, dt)
        # From smoothed speeds: a single reading of a coarse tachometer is too noisy for slip.
        ahead, turning = self._speed.value, self._rim.value
        self.slip = min(1.0, max(0.0, 1.0 - ahead / turning)) if turning > 0 else 0.0
        while self._pulls and self._pulls[-1][1] <= pull:
            self._pulls.pop()
        self._pulls.append((t, pull))
        while self._pulls[0][0] < t - self._TORQUE_MEMORY:
            self._pulls.popleft()
        trying = asked and pull >= self.limits.effort * self._weight
        if not (trying and pull >= self._GOES_ON * self._pulls[0][1]):
            self._goes_on_since = t
        goes_on = t - self._goes_on_since >= self._FOLLOWED
        self._decide(t, speed, rim, trying, goes_on, mobilised)
        return self.level

    def _decide(
        self, t: float, speed: float, rim: float, trying: bool, goes_on: bool, mobilised: float
    ) -> None:
        limits = self.limits
        standing = trying and speed < limits.min_speed and (goes_on or rim > limits.min_speed)
        # Both against the torque: it brakes.
        standing = standing and max(speed, rim) > -limits.min_speed
        if not standing:
            self._standing_since = None
        elif self._standing_since is None:
            self._standing_since = t
        if self._standing_since is not None and t - self._standing_since >= self._STANDING:
            self.level, self.reason, self.time_left = Level.IMMOBILISED, Reason.STUCK, 0.0
            self._well_since = None
            return
        reason, self.time_left = self._sign(speed, rim, trying, goes_on, mobilised)
        if reason is not Reason.NONE:
            self._well_since = None
            if self._signs_since is None:
                self._signs_since = t
            if t - self._signs_since >= limits.confirmation:
                self.level, self.reason = Level.WARNING, reason
            return
        self._signs_since = None
        # A warning stays at standstill, and while a sign is near.
        if self.level is Level.NONE or standing or self.time_left < 2.0 * limits.horizon:
            self._well_since = None
        elif self._well_since is None:
            self._well_since = t
        if self._well_since is not None and t - self._well_since >= limits.release:
            self.level, self.reason = Level.NONE, Reason.NONE

    def _sign(
        self, speed: float, rim: float, trying: bool, goes_on: bool, mobilised: float
    ) -> tuple[Reason, float]:
        """Most urgent sign and its time to standstill."""
        limits = self.limits
        found = (Reason.NONE, math.inf)
        if not trying:
            return found
        rate = self._speed.rate
        falling = rate < 0.0 and speed > limits.min_speed
        left = (speed - limits.min_speed) / -rate if falling else math.inf
        min_slip = limits.digging_slip * (0.5 if mobilised >= limits.mobilised else 1.0)
        digging = falling and self._rim.rate > 0.0 and self.slip >= min_slip
        if digging and left < 2.0 * limits.horizon:
            found = (Reason.DIGGING_IN, left)
        elif falling and goes_on:
            found = (Reason.STALLING if left < limits.horizon else Reason.NONE, left)
        if self._depth.rate > 0.0:
            below = (limits.sinkage - self._depth.value) / self._depth.rate
            # At the edge of soft soil wheels sink fast, but only briefly and not to their axles.
            if below < min(limits.horizon, found[1]) and self._depth.value > limits.sinkage / 2:
                found = (Reason.SINKING, max(below, 0.0))
        # While the vehicle moves off, its speed grows.
        slipping = self.slip >= limits.slip and rim > limits.min_speed and rate <= 0.0
        if found[0] is Reason.NONE and slipping:
            found = (Reason.SLIPPING, found[1])
        return found

    def _checked(self, what: str, values: ArrayLike) -> Array:
        array = np.asarray(values, dtype=float)
        if array.shape != self._radii.shape or not np.all(np.isfinite(array)):
            raise ValueError(
                f'expected a finite {what} for each of {self._radii.size} wheels, got {values!r}'
            )
        return array
