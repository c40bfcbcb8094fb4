"""Steps of the tachometers' readings: given as pulses per turn, or found from the readings.

A tachometer that counts pulses over a period gives multiples of one step,

    step = 2*pi/(pulses*period),

and nothing in between. Readings that have a common step are counts; its size follows from a few of
them by Euclid's algorithm. Where a driver divides by the time from stamp to stamp, the angles have
a common step instead. Readings without one are taken as they are.
"""

import math

import numpy as np
from numpy.typing import NDArray

from traction_model.kernel import kernel

Array = NDArray[np.float64]

SEARCH = np.dtype(
    [
        # Step in use; 0: none that matters.
        ('step', float),
        # Step that the readings since the search began have in common, the largest multiple of it
        # that was seen, the newest one, and how often it changed.
        ('common', float),
        ('largest', float),
        ('newest', float),
        ('changes', float),
        # Readings of late that were no multiples.
        ('missed', float),
        # 1 once a search has ended, and readings since one ended without a step.
        ('decided', float),
        ('passed', float),
    ],
    align=True,
)
"""Search for the step of one tachometer, in the unit of its readings."""

# Smallest step that matters, rad/s: less is lost in a tachometer's noise. Readings up to a
# thousandth of it are no count.
FINEST = 0.01
# How far a reading may be off a multiple, as a share of the step: while it is searched, and after.
SEARCHING, FOUND = 5e-4, 5e-3
# Changes from one multiple to another that prove a step.
PROOF = 5
# Readings off the step, less one for twenty on it, after which it is searched anew.
MISSES, MISSES_HEALED = 3.0, 0.05
# Readings after which a search that ended without a step is repeated.
PATIENCE = 200.0
# Period that is taken until two readings have come, s.
USUAL_PERIOD = 0.01
# Period over its mean from which on readings are missing.
MISSING = 1.5
# Readings over which the period is averaged, at the most.
PERIODS = 1000


@kernel
def begin_search(search, size, finest):
    """Begin to search with a first reading, in place.

    Parameters
    ----------
    search : record
        Record of `SEARCH`, in the unit of the readings.
    size : float
        Magnitude of the reading, rad/s or rad.
    finest : float
        Smallest step that matters, in the unit of the reading, above 0.
    """
    search.changes, search.missed, search.passed = 0.0, 0.0, 0.0
    if size <= finest:
        # One step or more of a size that does not matter.
        search.common, search.step, search.decided = 0.0, 0.0, 1.0
        return
    search.common, search.largest, search.newest = size, 1.0, 1.0
    if search.decided == 0.0:
        search.step = size


@kernel
def find_step(search, reading, finest):
    """Search for the step of a tachometer with its next reading, in place.

    Parameters
    ----------
    search : record
        Record of `SEARCH`, in the unit of the readings.
    reading : float
        Wheel speed, rad/s, or angle, rad.
    finest : float
        Smallest step that matters, in the unit of the reading, above 0.
    """
    size = abs(reading)
    if size <= 1e-3 * finest:
        if search.common > 0.0 and search.newest != 0.0:
            search.newest = 0.0
            search.changes += 1.0
        return
    if search.common == 0.0:
        search.passed += 1.0
        if search.decided == 0.0 or search.passed >= PATIENCE:
            begin_search(search, size, finest)
        return
    multiple = round(size / search.common)
    off = abs(size - multiple * search.common)
    proved = search.changes >= PROOF
    if multiple >= 1 and off <= (FOUND if proved else SEARCHING) * search.common:
        if multiple != search.newest:
            search.newest = multiple
            search.changes += 1.0
        search.missed = max(0.0, search.missed - MISSES_HEALED)
        if multiple > search.largest:
            # The larger the multiple, the less its rounding counts.
            search.largest = multiple
            search.common = size / multiple
    elif proved:
        search.missed += 1.0
        if search.missed >= MISSES:
            begin_search(search, size, finest)
    else:
        # Euclid: the greatest common step of what it was and of this reading.
        larger, smaller = search.common, off
        if multiple == 0:
            smaller = size
        while smaller > max(SEARCHING * larger, finest):
            larger, smaller = smaller, abs(larger - round(larger / smaller) * smaller)
        if smaller > SEARCHING * larger or larger <= finest:
            larger = 0.0
        search.common = larger
        search.largest, search.newest, search.changes = 1.0, -1.0, 0.0
        search.missed, search.passed = 0.0, 0.0
        if larger == 0.0:
            search.step, search.decided = 0.0, 1.0
    if search.common > 0.0:
        if search.changes >= PROOF:
            search.decided = 1.0
        if search.decided == 0.0 or search.changes >= PROOF:
            search.step = search.common


@kernel
def find_steps(searches, readings, finest):
    """Search for the steps of all tachometers with their next readings, in place.

    Parameters
    ----------
    searches : ndarray of `SEARCH`, shape (n,)
        One of each tachometer, in the unit of the readings.
    readings : ndarray, shape (n,)
        Wheel speeds, rad/s, or angles, rad.
    finest : float
        Smallest step that matters, in the unit of the readings, above 0.
    """
    for j in range(readings.size):
        find_step(searches[j], readings[j], finest)


class Tachometers:
    """Angle from pulse to pulse of every wheel's tachometer.

    Parameters
    ----------
    n_wheels : int
        Number of wheels.
    pulses_per_turn : float
        Pulses of a turn of the wheel, at least 0; 0: to be found from the readings.

    Attributes
    ----------
    step : ndarray, shape (n,)
        Smallest change of a reading, rad/s; 0 where readings have no steps that matter.
    pulse : ndarray, shape (n,)
        Angle from pulse to pulse, rad; 0 where readings have no steps that matter.
    counted : ndarray, shape (n,)
        Angle counted in the newest reading, rad, forward positive.

    Raises
    ------
    ValueError
        If `pulses_per_turn` is negative or not finite.
    """

    def __init__(self, n_wheels: int, pulses_per_turn: float = 0.0) -> None:
        if not (math.isfinite(pulses_per_turn) and pulses_per_turn >= 0):
            raise ValueError(f'tachometer_pulses must be at least 0, got {pulses_per_turn}')
        self._given = 2.0 * math.pi / pulses_per_turn if pulses_per_turn else 0.0
        # Counted over equal periods, readings have a common step; counted from stamp to stamp,
        # angles have.
        self._speeds, self._angles = np.zeros((2, n_wheels), SEARCH)
        self._angles['decided'] = 1.0
        self._angles['passed'] = PATIENCE
        self.reset()

    def reset(self) -> None:
        """Forget the readings; a step that was found stays."""
        n = len(self._speeds)
        self._t: float | None = None
        self._period, self._periods = USUAL_PERIOD, 0
        self.step, self.pulse, self.counted = np.zeros(n), np.zeros(n), np.zeros(n)

    def update(self, t: float, omega: Array) -> None:
        """Update with a reading of all tachometers.

        Parameters
        ----------
        t : float
            Time of measurement, s; of a reading older than the last, only `counted` is used.
        omega : ndarray, shape (n,)
            Wheel speeds, rad/s, finite, forward positive.
        """
        dt = self._period if self._t is None else t - self._t
        usual = 0.0 < dt < MISSING * self._period
        if dt > 0.0:
            if self._t is not None and (usual or not self._periods):
                self._periods = min(self._periods + 1, PERIODS)
                self._period += (dt - self._period) / self._periods
            self._t = t
            if not self._given:
                find_steps(self._speeds, omega, FINEST)
                find_steps(self._angles, omega * dt, FINEST * self._period)
        # Stamps jitter, the period that was counted over does not; but over a gap nobody counts.
        self.counted[:] = omega * (self._period if usual else dt)
        if self._given:
            self.pulse[:] = self._given
            self.step[:] = self._given / self._period
            return
        self.step[:] = self._speeds['step']
        self.pulse[:] = self.step * self._period
        from_stamps = (self.step == 0.0) & (self._angles['step'] > 0.0)
        if from_stamps.any():
            self.pulse[from_stamps] = self._angles['step'][from_stamps]
            self.step[from_stamps] = self.pulse[from_stamps] / self._period
            self.counted[from_stamps] = omega[from_stamps] * dt

    @property
    def pulses_per_turn(self) -> float:
        """Pulses of a turn of the wheel as given or found, the mean of the wheels; 0 for none."""
        counting = self.pulse[self.pulse > 0.0]
        return float(np.mean(2.0 * math.pi / counting)) if len(counting) else 0.0
