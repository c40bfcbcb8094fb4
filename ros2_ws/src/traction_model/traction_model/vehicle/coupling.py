"""Coupling of wheels: locked differentials and coupled axles as linear constraints.

Couplings ``G @ omega = 0`` leave ``g`` of ``n`` wheel speeds independent; all of them follow as
``omega = P @ omega_r`` with a constraint matrix P, and inertia, friction and torque act on
``omega_r`` as ``P.T @ J @ P``, ``P.T @ b_f @ P`` and ``P.T @ T`` (the constraints do no work).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from traction_node.closest import closest


@dataclass(frozen=True)
class Coupling:
    """The mean speed of some wheels is a fixed multiple of the mean speed of others.

    ``Coupling(('rl',), ('rr',))`` locks the rear differential;
    ``Coupling(('rl', 'rr'), ('fl', 'fr'), 1.35)`` drives a front axle, its differential open,
    from a rear one at 1.35 times its speed. A locked axle with more wheels, or a combination,
    needs several couplings.

    Attributes
    ----------
    leading : tuple of str
        Names of the wheels that set the speed, at least one.
    following : tuple of str
        Names of the wheels that follow, at least one, none of them leading.
    ratio : float
        Mean speed of the following over that of the leading wheels, dimensionless, not 0.
    """

    leading: tuple[str, ...]
    following: tuple[str, ...]
    ratio: float = 1.0

    def __post_init__(self) -> None:
        for side in ('leading', 'following'):
            if isinstance(getattr(self, side), str) or not getattr(self, side):
                raise ValueError(
                    f'{side} wheels of a coupling must be a tuple of at least one name, '
                    f'got {getattr(self, side)!r}'
                )
        names = (*self.leading, *self.following)
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"wheel '{twice[0]}' is named twice in one coupling")
        if not math.isfinite(self.ratio) or self.ratio == 0:
            raise ValueError(f'ratio of a coupling must be finite and not 0, got {self.ratio}')

    def equation(self, wheel_names: Sequence[str]) -> NDArray[np.float64]:
        """Row of G in ``G @ omega = 0``.

        Parameters
        ----------
        wheel_names : sequence of str
            Names of the vehicle's wheels, in order.

        Returns
        -------
        ndarray, shape (n,)
            Coefficient of every wheel's speed, dimensionless.

        Raises
        ------
        ValueError
            If a name is unknown.
        """
        row = np.zeros(len(wheel_names))
        for names, coefficient in (
            (self.leading, self.ratio / len(self.leading)),
            (self.following, -1 / len(self.following)),
        ):
            for name in names:
                if name not in wheel_names:
                    raise ValueError(f"unknown wheel '{name}'{closest(name, wheel_names)}")
                row[list(wheel_names).index(name)] = coefficient
        return row


def constraint_matrix(
    wheel_names: Sequence[str], couplings: Sequence[Coupling]
) -> tuple[NDArray[np.float64], tuple[int, ...]]:
    """Matrix P and independent wheels with ``omega = P @ omega[independent]``.

    Parameters
    ----------
    wheel_names : sequence of str
        Names of the vehicle's wheels, in order.
    couplings : sequence of Coupling
        Couplings of the wheels.

    Returns
    -------
    P : ndarray, shape (n, g)
        Speed of every wheel per speed of the independent ones, dimensionless.
    independent : tuple of int
        Indices of the g independent wheels, ascending; the first ones possible.

    Raises
    ------
    ValueError
        If a coupling repeats or contradicts the others, or names an unknown wheel.
    """
    n = len(wheel_names)
    # Gauss-Jordan elimination in the order of the couplings: each eliminates the speed of one
    # wheel, the last one possible.
    rows: list[NDArray[np.float64]] = []
    dependent: list[int] = []
    for coupling in couplings:
        row = coupling.equation(wheel_names)
        size = np.abs(row).max()
        for other, wheel in zip(rows, dependent, strict=True):
            row = row - row[wheel] * other
        # A dependent equation leaves only rounding errors.
        left = np.flatnonzero(np.abs(row) > 1e-9 * size)
        if left.size == 0:
            raise ValueError(f'{coupling} follows from the other couplings: leave it out')
        pivot = int(left[-1])
        row = row / row[pivot]
        rows = [other - other[pivot] * row for other in rows]
        rows.append(row)
        dependent.append(pivot)
    independent = tuple(j for j in range(n) if j not in dependent)
    if not independent:
        raise ValueError('the couplings leave no wheel free to turn')
    P = np.zeros((n, len(independent)))
    P[list(independent), range(len(independent))] = 1.0
    for row, wheel in zip(rows, dependent, strict=True):
        P[wheel] = -row[list(independent)]
    if np.any(np.all(np.abs(P) < 1e-9, axis=1)):
        stuck = int(np.flatnonzero(np.all(np.abs(P) < 1e-9, axis=1))[0])
        raise ValueError(f"the couplings hold wheel '{wheel_names[stuck]}' still")
    return P, independent
