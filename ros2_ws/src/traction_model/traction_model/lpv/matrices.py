"""Matrices of a linear model at one scheduling vector."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Matrices(NamedTuple):
    """Linear model at one scheduling vector; s states, n torques, k uncontrolled inputs.

    Attributes
    ----------
    A : ndarray, shape (s, s)
        State units per state unit and second.
    B : ndarray, shape (s, n)
        Torques: state units per N·m and second.
    B_uc : ndarray, shape (s, k)
        Inputs that cannot be controlled: state units per input unit and second.
    C : ndarray, shape (p, s)
        Outputs, in units of the states.
    D : ndarray, shape (p, n)
        Zero, as there is no direct feedthrough; output units per N·m.
    """

    A: Array
    B: Array
    B_uc: Array
    C: Array
    D: Array

    def combined(self) -> tuple[Array, Array, Array, Array]:
        """Matrices with all inputs in one B, ``[u; u_uc]``, as for Kalman filters.

        Returns
        -------
        A, B, C, D : ndarray
            Shapes (s, s), (s, n + k), (p, s), (p, n + k); units as in `Matrices`.
        """
        none = np.zeros((len(self.C), self.B_uc.shape[1]))
        return self.A, np.hstack([self.B, self.B_uc]), self.C, np.hstack([self.D, none])
