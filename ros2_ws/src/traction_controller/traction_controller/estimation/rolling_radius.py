"""Rolling radius, calibrated while the wheels roll on firm ground with little thrust.

A wheel that pulls nothing rolls: over the ground distance D it turns by the angle D/r, which
gives its effective rolling radius r. A wheel that pulls slips and turns further, so a radius
from hard work in the field would hide the slip there. Hence three guards: measurements are taken
only where thrust is small against the load, motion is steady and straight; each must agree with
those before; and as thrust can only make a wheel turn further, a measurement below the known
radius is refused for good, while repeated ones above it show that the radius was learnt too
small, on soft ground, and start it anew.

The zero condition, rolling without drawbar pull on firm ground, is that of ASABE S296 and
EP496. What remains is the slip that rolling itself takes there, less than 0.005.
"""

import math
from dataclasses import dataclass, fields
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class Calibration(Enum):
    """State of a calibration: that it goes on, or the reason why not."""

    CALIBRATING = 'calibrating'
    NO_GROUND_SPEED = 'no ground speed'
    TOO_SLOW = 'too slow'
    PULLING = 'pulling'
    UNSTEADY = 'unsteady'
    TURNING = 'turning'


@dataclass(frozen=True)
class FirmGround:
    """Conditions and deviations of a measurement of the rolling radius; all above 0.

    Attributes
    ----------
    min_speed : float
        Ground speed at least, m/s.
    largest_effort : float
        Thrust over load of a wheel at most, dimensionless.
    largest_change : float
        Change of rim speed over one measurement at most, as a share, dimensionless.
    largest_turn : float
        Change of heading over one measurement at most, rad.
    stretch : float
        Ground distance of one measurement, m.
    distance : float
        Standard deviation of that distance, m.
    timing : float
        By how much the stamps of wheels and ground speed may differ, s.
    slip : float
        Standard deviation of the slip there, dimensionless; what all measurements share of it
        bounds how well the radius can be known.
    drift : float
        Random walk of the radius, as a share, 1 per sqrt(m): tyre pressure, load, wear.
    """

    min_speed: float = 0.5
    largest_effort: float = 0.15
    largest_change: float = 0.1
    largest_turn: float = 0.2
    stretch: float = 2.0
    distance: float = 0.04
    timing: float = 0.1
    slip: float = 0.004
    drift: float = 1e-5

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f'{field.name} must be above 0, got {value}')


class RollingRadius:
    """Calibrates the effective rolling radius of wheels against the distance over ground.

    Parameters
    ----------
    nominal : array_like, shape (n,)
        Radii to start from, m, above 0: of every wheel, or one for a whole vehicle whose
        wheels' angles are averaged.
    ground : FirmGround
        When and how much a measurement counts.
    deviation : float
        Standard deviation of the nominal radii, as a share, above 0, dimensionless.

    Attributes
    ----------
    scale : ndarray, shape (n,)
        Effective over nominal radius, dimensionless.
    scale_variance : ndarray, shape (n,)
        Its variance, dimensionless.
    state : Calibration
        What went on at the last call.
    measured : ndarray of int, shape (n,)
        Number of measurements taken in so far.
    refused : ndarray of int, shape (n,)
        Number of measurements refused so far as contradicting the radius.
    """

    # A calibration is done at this standard deviation.
    CALIBRATED = 0.01
    # Readings further apart than this, s, do not belong together.
    _LONGEST_GAP = 2.5
    # Standard deviations beyond which a measurement is refused: above, and below the known
    # radius, where slip can put it ...
    _GATE = 3.0
    _GATE_BELOW = 2.0
    # ... and beyond which it counts no more than one at this limit.
    _HUBER = 1.5
    # That many above, one after the other, show that the radius is too small.
    _TELLING = 3

    _slowest: float
    _fastest: float
    _heading: float

    def __init__(
        self,
        nominal: ArrayLike,
        ground: FirmGround = FirmGround(),
        deviation: float = 0.05,
    ) -> None:
        self.nominal = np.atleast_1d(np.asarray(nominal, dtype=float))
        if self.nominal.ndim != 1 or not np.all(np.isfinite(self.nominal) & (self.nominal > 0)):
            raise ValueError(f'nominal radii must be above 0 m, got {nominal!r}')
        if not (math.isfinite(deviation) and deviation > 0):
            raise ValueError(f'deviation must be above 0, got {deviation}')
        self.ground = ground
        self._deviation = deviation
        self.reset()

    def reset(self) -> None:
        """Start from the nominal radii: after other wheels were put on."""
        n = self.nominal.size
        self.scale = np.ones(n)
        self.scale_variance = np.full(n, self._deviation**2)
        self.measured = np.zeros(n, dtype=int)
        self.refused = np.zeros(n, dtype=int)
        self.state = Calibration.NO_GROUND_SPEED
        self._above = np.zeros(n, dtype=int)
        self._t = math.nan
        self._angle = np.zeros(n)
        self._distance = math.nan
        self._rim = math.nan
        self._begin()

    @property
    def radius(self) -> Array:
        """Effective rolling radius, m, shape (n,)."""
        return self.nominal * self.scale

    @property
    def calibrated(self) -> NDArray[np.bool_]:
        """True where a radius is known to 1 % (standard deviation), shape (n,)."""
        return np.asarray(self.scale_variance <= self.CALIBRATED**2)

    def advance(
        self,
        t: float,
        angle: ArrayLike,
        distance: float,
        effort: ArrayLike,
        heading: float = math.nan,
    ) -> None:
        """Update with the angle of the wheels and the distance of the vehicle.

        To be called at every reading of the ground speed or position.

        Parameters
        ----------
        t : float
            Time, s.
        angle : array_like, shape (n,)
            Angle that each wheel has turned since some moment, rad, at that time.
        distance : float
            Distance over ground since some moment, m, at that time; NaN while not known.
        effort : array_like, shape (n,) or ()
            Thrust over load of each wheel, or of all, since the last call, dimensionless; or
            another measure of pull, with a `largest_effort` that fits. NaN where not known:
            such a wheel is not calibrated.
        heading : float
            Heading, rad; NaN where not known, then driving counts as straight.

        Raises
        ------
        ValueError
            If there are not as many angles as radii, an angle or time is not finite, or time
            runs backwards; nothing is taken in then.
        """
        n = self.nominal.size
        turned = np.asarray(angle, dtype=float)
        if turned.shape != (n,) or not np.all(np.isfinite(turned)):
            raise ValueError(f'angles of {n} wheels must be finite numbers, got {angle!r}')
        efforts = np.broadcast_to(np.asarray(effort, dtype=float), (n,))
        if not math.isfinite(t) or t < self._t:
            raise ValueError(f'time of measurement {t} s is not finite or before {self._t} s')
        dt = t - self._t
        rolled = turned - self._angle
        covered = distance - self._distance
        self._t, self._angle, self._distance = t, turned.copy(), distance
        if not (math.isfinite(covered) and 0.0 < dt <= self._LONGEST_GAP):
            self._rim = math.nan
            self._break_off(Calibration.NO_GROUND_SPEED)
            return
        if abs(covered) < self.ground.min_speed * dt:
            self._break_off(Calibration.TOO_SLOW)
            return
        # Written so that NaN is no small effort.
        self._rolling &= np.abs(efforts) <= self.ground.largest_effort
        if not np.any(self._rolling):
            self._break_off(Calibration.PULLING)
            return
        rim = float(np.mean(np.abs(rolled) * self.nominal)) / dt
        if self._length == 0.0:
            # Of the interval before, that is, where there was one.
            self._first_rim = rim if math.isnan(self._rim) else self._rim
        self._rim = rim
        self._slowest = min(self._slowest, rim)
        self._fastest = max(self._fastest, rim)
        if self._fastest - self._slowest > self.ground.largest_change * self._fastest:
            self._break_off(Calibration.UNSTEADY)
            return
        if math.isfinite(heading):
            if math.isnan(self._heading):
                self._heading = heading
            if abs(math.remainder(heading - self._heading, math.tau)) > self.ground.largest_turn:
                self._break_off(Calibration.TURNING)
                return
        self.state = Calibration.CALIBRATING
        self._rolled += rolled
        self._length += covered
        if abs(self._length) >= self.ground.stretch:
            self._measure(rim)
            self._begin()

    def _begin(self) -> None:
        """Begin a measurement."""
        n = self.nominal.size
        self._rolled = np.zeros(n)
        self._length = 0.0
        self._rolling = np.ones(n, dtype=bool)
        self._slowest = math.inf
        self._fastest = 0.0
        self._first_rim = 0.0
        self._heading = math.nan

    def _break_off(self, state: Calibration) -> None:
        self.state = state
        self._begin()

    def _measure(self, last_rim: float) -> None:
        ground = self.ground
        length = abs(self._length)
        # Wheels and ground seen at different times: an error while speed changes.
        shifted = ground.timing * abs(last_rim - self._first_rim)
        variance = (ground.distance**2 + shifted**2) / length**2 + ground.slip**2
        for j in np.flatnonzero(self._rolling):
            self.scale_variance[j] += ground.drift**2 * length
            if self._rolled[j] * self._length <= 0.0:
                # A wheel that stands or turns against the motion does not roll.
                self.refused[j] += 1
                continue
            off = self._length / (self.nominal[j] * self._rolled[j]) - self.scale[j]
            total = self.scale_variance[j] + variance
            gate = (self._GATE if off > 0 else self._GATE_BELOW) * math.sqrt(total)
            if abs(off) > gate:
                self.refused[j] += 1
                self._above[j] = self._above[j] + 1 if off > 0 else 0
                if self._above[j] < self._TELLING:
                    continue
                self.scale_variance[j] = self._deviation**2
                total = self.scale_variance[j] + variance
            self._above[j] = 0
            # Huber's function: what is far off counts no more than what is nearer.
            spread = self._HUBER * math.sqrt(total)
            off = min(max(off, -spread), spread)
            gain = self.scale_variance[j] / total
            self.scale[j] += gain * off
            # Slip there is alike from measurement to measurement: it does not average out.
            left = (1 - gain) ** 2 * self.scale_variance[j] + gain**2 * variance
            self.scale_variance[j] = max(left, ground.slip**2)
            self.measured[j] += 1
