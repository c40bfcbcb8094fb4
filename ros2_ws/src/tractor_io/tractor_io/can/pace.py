"""Pace of periodic sending: in step with the period, without catching up."""

_EARLY = 1e-3
"""Allowed lead over the due time, s."""


class Pace:
    """Due times of a periodic event.

    Parameters
    ----------
    period : float
        Period, s, above 0.
    start : float
        First due time, s.
    """

    def __init__(self, period: float, start: float) -> None:
        self._period = period
        self._due = start

    def due(self, t: float) -> bool:
        """True if the event is due; the next due time is then one period later.

        Parameters
        ----------
        t : float
            Now, s.

        Returns
        -------
        bool
            True once per period. Missed periods are skipped.
        """
        if t < self._due - _EARLY:
            return False
        following = self._due + self._period
        self._due = following if t < following else t + self._period
        return True
