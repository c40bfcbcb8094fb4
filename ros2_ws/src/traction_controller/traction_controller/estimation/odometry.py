"""Slip-compensated odometry: distance along the path and planar pose, with honest covariance.

The pose is that of `base_link` in `odom` as of REP 105: x forward and y left of where the
vehicle started, yaw counter-clockwise; it never jumps and drifts without bound, which its
covariance tells. Three kinds of error make it grow:

- of the speed over ground, which last about half a second (its variance);
- of its scale (rolling radius, slip that is compensated), which stay, so that what they do to
  the distance grows with the distance and not with its root;
- of the yaw rate, from slip that differs between left and right.
"""

import math

import numpy as np
from numpy.typing import NDArray

UNOBSERVED = 1e6
"""Variance of what is not observed, rad^2 or m^2; finite, as filters want it."""


def axle_yaw_rate(
    left: float,
    right: float,
    slip: float,
    track_width: float,
    rim_speed_deviation: float = 0.02,
) -> tuple[float, float]:
    """Yaw rate from the wheels of an axle that does not steer.

    Both wheels are taken to slip alike. Slips found from one ground speed for both would not
    do: that takes the difference of the wheels' speeds for slip.

    Parameters
    ----------
    left, right : float
        r*omega, m/s, forward positive.
    slip : float
        Mean slip of the two, -1 to 1.
    track_width : float
        Distance between the wheels, m, above 0.
    rim_speed_deviation : float
        Standard deviation of a rim's speed, m/s, above 0.

    Returns
    -------
    rate, variance : float
        rad/s, counter-clockwise positive, and rad^2/s^2: slip may differ between the two by
        0.3 of itself and 0.005.

    Raises
    ------
    ValueError
        If a number is not finite, or track width or deviation are not above 0.
    """
    for name, value in (
        ('track_width', track_width),
        ('rim_speed_deviation', rim_speed_deviation),
    ):
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f'{name} must be above 0, got {value}')
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
        Standard deviation of the error of compensated slip, as a share of it, dimensionless,
        at least 0.

    Attributes
    ----------
    distance : float
        Along the path, m, forward positive.
    x, y : float
        Position ahead and left of the start, m; while yaw was never observed, x is the
        distance.
    yaw : float
        Heading, rad, counter-clockwise from the start, -pi to pi.
    yaw_observed : bool
        Whether the yaw rate was known all the way.
    """

    # Errors of the speed estimate last about this long, s: they add up like steps of a
    # random walk of this length. Those of the yaw rate come from ground and load.
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
        # One standard deviation of the lasting error of scale moves the pose, and the
        # distance, by so much.
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
        """Move on.

        Parameters
        ----------
        dt : float
            Time, s, at least 0.
        v : float
            Speed over ground, m/s, forward positive.
        v_variance : float
            Variance of its errors that come and go, m^2/s^2, at least 0.
        slip : float
            Slip compensated in it, -1 to 1; the error of that lasts.
        scale_deviation : float
            Standard deviation of other lasting errors, as a share of the speed, dimensionless:
            that of the rolling radius or of the radar's scale.
        yaw_rate : float
            rad/s, counter-clockwise positive.
        yaw_rate_variance : float
            Its variance, rad^2/s^2; infinite while it is not known.

        Raises
        ------
        ValueError
            If a number is not one, or a time, variance or deviation is negative; nothing is
            taken in then.
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
            # Standing still, it does not turn.
            self.yaw_observed = self.yaw_observed and step == 0.0
            yaw_rate = yaw_walk = 0.0
        else:
            yaw_walk = 2.0 * self._YAW_CORRELATION_TIME * yaw_rate_variance * dt
        # Along the chord of the arc.
        middle = self.yaw + 0.5 * yaw_rate * dt
        along = np.array([math.cos(middle), math.sin(middle), 0.0])
        move = np.eye(3)
        move[0, 2], move[1, 2] = -step * along[1], step * along[0]
        self._random = move @ self._random @ move.T + walk * np.outer(along, along)
        self._random[2, 2] += yaw_walk
        self._lasting = move @ self._lasting + lasting * along
        self.x += step * along[0]
        self.y += step * along[1]
        self.yaw = math.remainder(self.yaw + yaw_rate * dt, math.tau)

    @property
    def variance(self) -> float:
        """Variance of `distance`, m^2, growing."""
        return self._random_distance + self._lasting_distance**2

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of x, y and yaw, m^2, m*rad and rad^2, shape (3, 3).

        While yaw is not observed, `UNOBSERVED` stands for the variances of y and yaw.
        """
        if not self.yaw_observed:
            return np.diag([self.variance, UNOBSERVED, UNOBSERVED])
        return np.asarray(self._random + np.outer(self._lasting, self._lasting))
