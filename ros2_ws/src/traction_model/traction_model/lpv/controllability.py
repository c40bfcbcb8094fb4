"""Rank of the controllability matrix, whatever the units of states and inputs."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def controllability_rank(A: Array, B: Array, tolerance: float = 1e-9) -> int:
    """Rank of the controllability matrix [B, A*B, ...], whatever the units.

    Rows and columns are scaled to a largest entry of 1 in turn, which changes no rank; zero
    rows stay zero, so that a state no input reaches is never counted.

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
        # Scaled block by block, as powers of fast and slow rates soon differ by more than
        # numbers hold.
        blocks.append(_scaled(A @ blocks[-1], 0))
    reach = np.hstack(blocks)
    for _ in range(3):
        reach = _scaled(_scaled(reach, 1), 0)
    singular = np.linalg.svd(reach, compute_uv=False)
    return int(np.sum(singular > tolerance * max(singular[0], np.finfo(float).tiny)))


def _scaled(matrix: Array, axis: int) -> Array:
    """Matrix with the largest entry of every column (0) or row (1) made 1; zeros stay."""
    largest = np.abs(matrix).max(axis=axis, keepdims=True)
    return np.asarray(matrix / np.where(largest > 0, largest, 1.0))
