"""Calibration of the rolling radius on firm ground at low gross traction.

Without traction a wheel turns by the angle D/r over the ground distance D, which gives its
effective rolling radius r. With traction it slips and turns further. A radius calibrated under
load would therefore contain the slip. Three conditions prevent this:

- measurements are taken only at low gross traction over load, in steady, straight motion;
- each measurement must agree with the earlier ones;
- traction can only make a wheel turn further, so a measurement below the known radius is rejected.
  Repeated measurements above it mean that the radius was calibrated too small, on soft ground; the
  calibration then restarts.

The zero condition, rolling without drawbar pull on firm ground, is that of ASABE S296 and EP496.
The remaining slip of a rolling wheel there is less than 0.005.
"""

import math
from dataclasses import asdict, dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_node.positive import check_positive

Array = NDArray[np.float64]


class Calibration(Enum):
    """State of a calibration: running, or the reason for its pause."""

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
        Smallest ground speed, m/s.
    largest_effort : float
        Largest gross traction over load of a wheel, dimensionless.
    largest_change : float
        Largest relative change of rim speed over one measurement, dimensionless.
    largest_turn : float
        Largest change of heading over one measurement, rad.
    stretch : float
        Ground distance of one measurement, m.
    distance : float
        Standard deviation of that distance, m.
    timing : float
        Standard deviation of the difference between stamps of wheels and ground speed, s.
    slip : float
        Standard deviation of the slip, dimensionless. It is common to all measurements and
        limits the accuracy of the radius.
    drift : float
        Random walk of the relative radius, 1 per sqrt(m): tyre pressure, load, wear.
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
        check_positive(**asdict(self))


class RollingRadius:
    """Calibration of the effective rolling radius of wheels against the distance over ground.

    Parameters
    ----------
    nominal : array_like, shape (n,)
        Initial radii, m, above 0: of every wheel, or one for a vehicle with averaged wheel
        angles.
    ground : FirmGround
        Conditions and deviations of a measurement.
    deviation : float
        Relative standard deviation of the nominal radii, above 0, dimensionless.

    Attributes
    ----------
    scale : ndarray, shape (n,)
        Effective over nominal radius, dimensionless.
    scale_variance : ndarray, shape (n,)
        Its variance, dimensionless.
    state : Calibration
        State after the last call.
    measured : ndarray of int, shape (n,)
        Number of measurements used so far.
    refused : ndarray of int, shape (n,)
        Number of measurements rejected so far because they contradict the radius.
    """

    # Standard deviation of a completed calibration.
    CALIBRATED = 0.01
    # Largest interval between readings, s; a longer one ends the measurement.
    _LONGEST_GAP = 2.5
    # Gate for measurements above and below the known radius, in standard deviations; slip gives
    # measurements below it.
    _GATE = 3.0
    _GATE_BELOW = 2.0
    # Limit of the influence of a measurement (Huber), in standard deviations.
    _HUBER = 1.5
    # Number of consecutive measurements above the gate that show a radius that is too small.
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
        check_positive(deviation=deviation)
        self.ground = ground
        self._deviation = deviation
        self.reset()

    def reset(self) -> None:
        """Restart from the nominal radii, for example after a change of wheels."""
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
        """True if the standard deviation of a radius is below 1 %, shape (n,)."""
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

        Call it at every reading of ground speed or position.

        Parameters
        ----------
        t : float
            Time, s.
        angle : array_like, shape (n,)
            Angle of each wheel at that time, from any origin, rad.
        distance : float
            Distance over ground at that time, from any origin, m; NaN if unknown.
        effort : array_like, shape (n,) or ()
            Gross traction over load of each wheel, or of all, since the last call,
            dimensionless; or another measure of pull with a matching `largest_effort`. A wheel
            with NaN is not calibrated.
        heading : float
            Heading, rad; NaN if unknown: motion then counts as straight.

        Raises
        ------
        ValueError
            If the number of angles is wrong, an angle or time is not finite, or time runs
            backwards. The state is then unchanged.
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
        # False for NaN, too.
        self._rolling &= np.abs(efforts) <= self.ground.largest_effort
        if not np.any(self._rolling):
            self._break_off(Calibration.PULLING)
            return
        rim = float(np.mean(np.abs(rolled) * self.nominal)) / dt
        if self._length == 0.0:
            # Effort of the previous interval, if there is one.
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
        """Start a measurement."""
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
        # Different times of wheel and ground readings give an error while speed changes.
        shifted = ground.timing * abs(last_rim - self._first_rim)
        variance = (ground.distance**2 + shifted**2) / length**2 + ground.slip**2
        for j in np.flatnonzero(self._rolling):
            self.scale_variance[j] += ground.drift**2 * length
            if self._rolled[j] * self._length <= 0.0:
                # A wheel at standstill, or turning against the motion, does not roll.
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
            # Huber function: limits the influence of outliers.
            limit = self._HUBER * math.sqrt(total)
            off = min(max(off, -limit), limit)
            gain = self.scale_variance[j] / total
            self.scale[j] += gain * off
            # Slip is common to all measurements, so it does not average out.
            left = (1 - gain) ** 2 * self.scale_variance[j] + gain**2 * variance
            self.scale_variance[j] = max(left, ground.slip**2)
            self.measured[j] += 1
