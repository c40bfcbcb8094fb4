"""Slip in forward motion: wheel speed at a slip, slopes over speed and rim speed."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def wheel_speed(v: float, slip: ArrayLike, radius: ArrayLike) -> Array:
    """Wheel speed at a slip, in forward motion.

    Parameters
    ----------
    v : float
        Speed, m/s, at least 0.
    slip : array_like
        Slip, -1 to below 1.
    radius : array_like
        Radius of the wheel, m, above 0.

    Returns
    -------
    ndarray
        omega, rad/s.
    """
    return np.asarray(v * rim_ratio(np.asarray(slip, dtype=float)) / np.asarray(radius))


def rim_ratio(slipping: Array) -> Array:
    """Rim speed over speed at a slip, in forward motion.

    Parameters
    ----------
    slipping : ndarray
        Slip, -1 to below 1.

    Returns
    -------
    ndarray
        ``r*omega/v``, dimensionless: ``1/(1 - i)`` driving, ``1 + i`` braking.
    """
    return np.where(slipping >= 0, 1 / (1 - slipping), 1 + slipping)


def slip_slopes(v: float, slipping: Array) -> tuple[Array, Array]:
    """Slopes of slip over speed and over rim speed, s/m, in forward motion.

    Driving, i = 1 - v/(r*omega), the paper's (16): -1/(r*omega) and v/(r*omega)^2. Braking,
    i = r*omega/v - 1: -r*omega/v^2 and 1/v.

    Parameters
    ----------
    v : float
        Speed, m/s, above 0.
    slipping : ndarray
        Slip, -1 to below 1.

    Returns
    -------
    over_v, over_rim : ndarray
        Slopes, s/m.
    """
    ratio = rim_ratio(slipping)
    driving = slipping >= 0
    over_v = -np.where(driving, 1 / ratio, ratio) / v
    over_rim = np.where(driving, 1 / ratio**2, 1.0) / v
    return over_v, over_rim
