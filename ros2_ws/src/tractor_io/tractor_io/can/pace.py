"""The pace at which something is sent: in step with its period, but nothing late."""

_EARLY = 1e-3
"""By how much it may come before it is due, s."""


class Pace:
    """When something periodic is due.

    Parameters
    ----------
    period : float
        s, above 0.
    start : float
        When it is due first, s.
    """

    def __init__(self, period: float, start: float) -> None:
        self._period = period
        self._due = start

    def due(self, t: float) -> bool:
        """Whether it is due; if so it counts as done.

        Parameters
        ----------
        t : float
            Now, s.

        Returns
        -------
        bool
            True once a period; what was missed is not made up for.
        """
        if t < self._due - _EARLY:
            return False
        following = self._due + self._period
        self._due = following if t < following else t + self._period
        return True
