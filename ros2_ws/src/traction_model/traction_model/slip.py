"""Slip: its definition, and the speed below which it means nothing."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_model.kernel import inlined, kernel

MIN_SPEED = 0.3
"""Speed below which slip is not valid, m/s, of the wheel rim or the vehicle."""


@inlined
def slip(v, rim_speed):
    """Slip of a wheel, equation (16) of Agriculture 2024, 14(3), 499.

    ``1 - v/(r*omega)`` when driving, ``r*omega/v - 1`` when braking; in reverse as when
    going forward, so that positive slip always goes with thrust along the motion. Zero at
    standstill.

    Parameters
    ----------
    v : float
        Speed of the wheel's centre over ground, m/s, forward positive.
    rim_speed : float
        r*omega, m/s, forward positive.

    Returns
    -------
    float
        Slip, -1 (locked, or turning against a faster motion) to 1 (spinning at standstill,
        or turning against a slower motion).
    """
    fastest = max(abs(v), abs(rim_speed))
    if fastest == 0.0:
        return 0.0
    direction = 1.0
    if abs(v) > abs(rim_speed):
        if v < 0.0:
            direction = -1.0
    elif rim_speed < 0.0:
        direction = -1.0
    value = direction * (rim_speed - v) / fastest
    return min(1.0, max(-1.0, value))


@kernel
def slips(v, rim_speeds):
    """Slip of every wheel at every sample.

    Parameters
    ----------
    v : ndarray, shape (k,)
        Speed over ground, m/s, forward positive.
    rim_speeds : ndarray, shape (k, n)
        r*omega, m/s, forward positive.

    Returns
    -------
    ndarray, shape (k, n)
        Slip, -1 to 1, see `slip`.
    """
    values = np.empty(rim_speeds.shape)
    for k in range(rim_speeds.shape[0]):
        for j in range(rim_speeds.shape[1]):
            values[k, j] = slip(v[k], rim_speeds[k, j])
    return values


@inlined
def is_valid(v, rim_speed, min_speed):
    """Tell whether slip means anything at these speeds.

    Parameters
    ----------
    v : float
        Speed over ground, m/s.
    rim_speed : float
        r*omega, m/s.
    min_speed : float
        Speed that one of them must reach, m/s, at least 0.

    Returns
    -------
    bool
        True when slip is defined well enough to act on.
    """
    return max(abs(v), abs(rim_speed)) >= min_speed


def checked_slip(slip: ArrayLike) -> NDArray[np.float64]:
    """Refuse what is not a slip.

    Parameters
    ----------
    slip : array_like
        Slip, -1 to 1, any shape.

    Returns
    -------
    ndarray
        The same as numbers, -1 to 1.

    Raises
    ------
    ValueError
        If one of them is not a number from -1 to 1.
    """
    array = np.asarray(slip, dtype=float)
    wrong = array[~(np.abs(array) <= 1)]
    if wrong.size:
        raise ValueError(
            f'slip must be a share from -1 (locked) to 1 (spinning), got {wrong.flat[0]}'
        )
    return array
