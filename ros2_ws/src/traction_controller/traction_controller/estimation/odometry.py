"""Slip-compensated odometry: distance along the path and planar pose, with covariance.

The pose is that of `base_link` in `odom` (REP 105): x forward and y left of the start, yaw
counter-clockwise. It is continuous and drifts without bound, and its covariance grows accordingly.
Three kinds of error are modelled:

- errors of the speed over ground, correlated over about half a second;
- constant errors of its scale (rolling radius, slip compensation): the error of the distance grows
  with the distance, not with its root;
- errors of the yaw rate from different slip left and right.
"""

import math

import numpy as np
from numpy.typing import NDArray

from traction_node.positive import check_positive

UNOBSERVED = 1e6
"""Variance of an unobserved value, rad^2 or m^2; finite, since other filters require it."""


def axle_yaw_rate(
    left: float,
    right: float,
    slip: float,
    track_width: float,
    rim_speed_deviation: float = 0.02,
) -> tuple[float, float]:
    """Yaw rate from the wheels of an axle that does not steer.

    Both wheels are assumed to have the same slip. Slips from one common ground speed cannot be
    used: they contain the speed difference that the yaw rate causes.

    Parameters
    ----------
    left, right : float
        Rim speeds r*omega, m/s, forward positive.
    slip : float
        Mean slip of the two, -1 to 1.
    track_width : float
        Distance between the wheels, m, above 0.
    rim_speed_deviation : float
        Standard deviation of a rim speed, m/s, above 0.

    Returns
    -------
    rate, variance : float
        rad/s, counter-clockwise positive, and rad^2/s^2. Standard deviation of the difference
        of slips: 0.3 of the slip, plus 0.005.

    Raises
    ------
    ValueError
        If a number is not finite, or track width or deviation are not above 0.
    """
    check_positive(track_width=track_width, rim_speed_deviation=rim_speed_deviation)
    if not (math.isfinite(left) and math.isfinite(right) and abs(slip) <= 1):
        raise ValueError(f'rim speeds {left} and {right} m/s with slip {slip} are not usable')
    # Ground over rim speed, driving and braking.
    ratio = 1.0 - slip if slip >= 0 else 1.0 / max(1.0 + slip, 1e-3)
    uneven = (0.3 * abs(slip) + 0.005) * max(abs(left), abs(right))
    variance = (uneven**2 + 2.0 * rim_speed_deviation**2) / track_width**2
    return ratio * (right - left) / track_width, variance


class PathOdometry:
    """Distance and planar pose from ground speed and yaw rate.

    Parameters
    ----------
    slip_share : float
        Standard deviation of the error of slip compensation, as a share of the slip,
        dimensionless, at least 0.

    Attributes
    ----------
    distance : float
        Distance along the path, m, forward positive.
    x, y : float
        Position ahead and left of the start, m; while yaw was never observed, x is the
        distance.
    yaw : float
        Heading, rad, counter-clockwise from the start, -pi to pi.
    yaw_observed : bool
        True if the yaw rate was known since the start.
    """

    # Correlation time of the errors of speed and yaw rate, s: they add up like the steps of a
    # random walk of this period. Errors of the yaw rate come from ground and load.
    _CORRELATION_TIME = 0.5
    _YAW_CORRELATION_TIME = 2.0

    def __init__(self, slip_share: float = 0.1) -> None:
        if not (math.isfinite(slip_share) and slip_share >= 0):
            raise ValueError(f'slip_share must be at least 0, got {slip_share}')
        self._slip_share = slip_share
        self.distance = 0.0
        self.x = self.y = self.yaw = 0.0
        self.yaw_observed = True
        self._random = np.zeros((3, 3))
        # Error of pose and distance for one standard deviation of the constant error of scale.
        self._lasting = np.zeros(3)
        self._lasting_distance = 0.0
        self._random_distance = 0.0

    def advance(
        self,
        dt: float,
        v: float,
        v_variance: float,
        slip: float = 0.0,
        scale_deviation: float = 0.0,
        yaw_rate: float = 0.0,
        yaw_rate_variance: float = math.inf,
    ) -> None:
        """Advance distance and pose by a time step.

        Parameters
        ----------
        dt : float
            Time, s, at least 0.
        v : float
            Speed over ground, m/s, forward positive.
        v_variance : float
            Variance of its correlated errors, m^2/s^2, at least 0.
        slip : float
            Slip compensated in it, -1 to 1; the error of the compensation is constant.
        scale_deviation : float
            Standard deviation of other constant errors, as a share of the speed, dimensionless:
            of the rolling radius or the radar's scale.
        yaw_rate : float
            rad/s, counter-clockwise positive.
        yaw_rate_variance : float
            Its variance, rad^2/s^2; infinite if unknown.

        Raises
        ------
        ValueError
            If a number is not finite, or a time, variance or deviation is negative. The state
            is then unchanged.
        """
        if not all(map(math.isfinite, (dt, v, v_variance, slip, scale_deviation, yaw_rate))):
            raise ValueError(
                f'odometry needs finite numbers, got {v} m/s (variance {v_variance}), slip '
                f'{slip}, scale deviation {scale_deviation}, {yaw_rate} rad/s over {dt} s'
            )
        if min(dt, v_variance, scale_deviation) < 0 or not yaw_rate_variance >= 0:
            raise ValueError(
                f'time {dt} s, variances {v_variance}, {yaw_rate_variance} and deviation '
                f'{scale_deviation} must be at least 0'
            )
        step = v * dt
        lasting = math.hypot(scale_deviation, self._slip_share * slip) * step
        walk = 2.0 * self._CORRELATION_TIME * v_variance * dt
        self.distance += step
        self._random_distance += walk
        self._lasting_distance += lasting
        if not math.isfinite(yaw_rate_variance):
            # No yaw at standstill.
            self.yaw_observed = self.yaw_observed and step == 0.0
            yaw_rate = yaw_walk = 0.0
        else:
            yaw_walk = 2.0 * self._YAW_CORRELATION_TIME * yaw_rate_variance * dt
        # Chord of the arc.
        middle = self.yaw + 0.5 * yaw_rate * dt
        direction = np.array([math.cos(middle), math.sin(middle), 0.0])
        move = np.eye(3)
        move[0, 2], move[1, 2] = -step * direction[1], step * direction[0]
        self._random = move @ self._random @ move.T + walk * np.outer(direction, direction)
        self._random[2, 2] += yaw_walk
        self._lasting = move @ self._lasting + lasting * direction
        self.x += step * direction[0]
        self.y += step * direction[1]
        self.yaw = math.remainder(self.yaw + yaw_rate * dt, math.tau)

    @property
    def variance(self) -> float:
        """Variance of `distance`, m^2; grows monotonically."""
        return self._random_distance + self._lasting_distance**2

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of x, y and yaw, m^2, m*rad and rad^2, shape (3, 3).

        While yaw is not observed, `UNOBSERVED` stands for the variances of y and yaw.
        """
        if not self.yaw_observed:
            return np.diag([self.variance, UNOBSERVED, UNOBSERVED])
        return np.asarray(self._random + np.outer(self._lasting, self._lasting))
