"""Slip-compensated odometry along the path."""


class PathOdometry:
    """Distance along the path from ground speed, with an honest variance.

    Attributes
    ----------
    x : float
        Distance, m.
    variance : float
        Its variance, m^2, growing.
    """

    # Errors of the speed estimate last about this long, s: they add up like steps of a
    # random walk of this length.
    _CORRELATION_TIME = 0.5

    def __init__(self) -> None:
        self.x = 0.0
        self.variance = 0.0

    def advance(self, dt: float, v: float, v_variance: float) -> None:
        """Move on.

        Parameters
        ----------
        dt : float
            Time, s, at least 0.
        v : float
            Speed over ground, m/s, forward positive.
        v_variance : float
            Its variance, m^2/s^2, at least 0.
        """
        self.x += v * dt
        self.variance += 2.0 * self._CORRELATION_TIME * v_variance * dt
