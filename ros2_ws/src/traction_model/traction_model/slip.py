"""Slip: definition, and smallest speed of valid slip."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_model.kernel import inlined, kernel

MIN_SPEED = 0.3
"""Speed of rim or vehicle below which slip is not valid, m/s."""


@inlined
def slip(v, rim_speed):
    """Slip of a wheel, equation (16) of Agriculture 2024, 14(3), 499.

    ``1 - v/(r*omega)`` when driving, ``r*omega/v - 1`` when braking. In reverse it has the same
    sign as forward: positive slip gives thrust in the direction of motion. Zero at standstill.

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
    """True if slip is valid at these speeds.

    Parameters
    ----------
    v : float
        Speed over ground, m/s.
    rim_speed : float
        r*omega, m/s.
    min_speed : float
        Smallest value of the larger speed, m/s, at least 0.

    Returns
    -------
    bool
        True if slip can be used.
    """
    return max(abs(v), abs(rim_speed)) >= min_speed


def checked_slip(slip: ArrayLike) -> NDArray[np.float64]:
    """Array of slips, checked.

    Parameters
    ----------
    slip : array_like
        Slip, -1 to 1, any shape.

    Returns
    -------
    ndarray
        The slips, -1 to 1.

    Raises
    ------
    ValueError
        If a value is outside -1 to 1 or not a number.
    """
    array = np.asarray(slip, dtype=float)
    wrong = array[~(np.abs(array) <= 1)]
    if wrong.size:
        raise ValueError(
            f'slip must be a share from -1 (locked) to 1 (spinning), got {wrong.flat[0]}'
        )
    return array
