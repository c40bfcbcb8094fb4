"""Exact sampling of linear models in continuous time."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def sampled(
    a: NDArray[np.float64], b: NDArray[np.float64], dt: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Exactly sampled linear model with input held over the period.

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
    # Imported on demand: the import is slow and simulation does not need it.
    from scipy.linalg import expm

    n, m = b.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n] = a
    block[:n, n:] = b
    transition = expm(block * dt)
    return transition[:n, :n], transition[:n, n:]
