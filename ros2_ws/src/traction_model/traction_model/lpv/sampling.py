"""Linear models in continuous time, sampled exactly."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def sampled(
    a: NDArray[np.float64], b: NDArray[np.float64], dt: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sample a linear model exactly, its input held over the period.

    Parameters
    ----------
    a : ndarray, shape (n, n)
        State matrix, 1/s.
    b : ndarray, shape (n, m)
        Input matrix, state units per input unit and second.
    dt : float
        Sampling period, s, above 0.

    Returns
    -------
    a_d : ndarray, shape (n, n)
        State matrix of the sampled model, dimensionless up to state units.
    b_d : ndarray, shape (n, m)
        Input matrix of the sampled model, state units per input unit.
    """
    # Costly to import, and of no use to those who only simulate.
    from scipy.linalg import expm

    n, m = b.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n] = a
    block[:n, n:] = b
    transition = expm(block * dt)
    return transition[:n, :n], transition[:n, n:]
