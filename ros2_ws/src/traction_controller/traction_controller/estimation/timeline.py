"""Timeline of a sensor: a clock that was set, or a second publisher with another clock.

After a clock was set, all stamps are on the new time. From a second publisher they alternate with
those of the first. So stamps far from the newest are rejected, until only such ones have come for
a while.
"""

import math


class Timeline:
    """Check of the stamps of successive readings.

    Parameters
    ----------
    longest_gap : float
        Largest distance of a stamp from the newest one on the same timeline, s, above 0.

    Attributes
    ----------
    newest : float or None
        Newest stamp on the timeline, s; None before the first.
    """

    # Time that readings on another timeline must cover without any on this one, s, and their
    # number.
    _CONFIRMATION = 0.1
    _READINGS = 3

    def __init__(self, longest_gap: float) -> None:
        self._longest_gap = longest_gap
        self.reset()

    def reset(self) -> None:
        """Forget all stamps."""
        self.newest: float | None = None
        self._forget_other()

    def _forget_other(self) -> None:
        self._other_since = self._other_newest = -math.inf
        self._others = 0

    def add(self, t: float) -> float:
        """Add the stamp of a reading.

        Parameters
        ----------
        t : float
            Stamp, s, finite.

        Returns
        -------
        float
            Jump of time with this reading, s, positive forward: 0 unless the timeline has changed.

        Raises
        ------
        ValueError
            If the stamp is not on the timeline.
        """
        if self.newest is None:
            self.newest = t
            return 0.0
        off = t - self.newest
        if abs(off) < self._longest_gap:
            self.newest = max(self.newest, t)
            self._forget_other()
            return 0.0
        if 0.0 < t - self._other_newest < self._longest_gap:
            self._others += 1
        else:
            self._other_since, self._others = t, 1
        self._other_newest = t
        if self._others >= self._READINGS and t - self._other_since >= self._CONFIRMATION:
            self.newest = t
            self._forget_other()
            return off
        raise ValueError(
            f'stamp is {off:+.1f} s off the last one: a gap of {self._longest_gap:g} s or more, '
            'or a second clock'
        )
