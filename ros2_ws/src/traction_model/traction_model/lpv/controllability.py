"""Rank of the controllability matrix, independent of the units of states and inputs."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def controllability_rank(A: Array, B: Array, tolerance: float = 1e-9) -> int:
    """Rank of the controllability matrix [B, A*B, ...], independent of units.

    Rows and columns are scaled to a largest entry of 1, which does not change the rank. Zero rows
    stay zero, so states without influence of an input do not count.

    Parameters
    ----------
    A : ndarray, shape (s, s)
        State matrix, state units per state unit and second.
    B : ndarray, shape (s, m)
        Input matrix, state units per input unit and second.
    tolerance : float
        Singular values below this share of the largest count as zero, dimensionless.

    Returns
    -------
    int
        The rank, 0 to s.
    """
    blocks = [_scaled(B, 0)]
    for _ in range(len(A) - 1):
        # Scaled per block, since powers of fast and slow rates differ by more than the range of
        # floats.
        blocks.append(_scaled(A @ blocks[-1], 0))
    reach = np.hstack(blocks)
    for _ in range(3):
        reach = _scaled(_scaled(reach, 1), 0)
    singular = np.linalg.svd(reach, compute_uv=False)
    return int(np.sum(singular > tolerance * max(singular[0], np.finfo(float).tiny)))


def _scaled(matrix: Array, axis: int) -> Array:
    """Matrix with columns (0) or rows (1) scaled to a largest entry of 1; zeros stay."""
    largest = np.abs(matrix).max(axis=axis, keepdims=True)
    return np.asarray(matrix / np.where(largest > 0, largest, 1.0))
