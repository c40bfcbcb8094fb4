"""Polytopic LPV model: systems at the corners of a box with convex weights."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from traction_model.lpv.affine_model import AffineModel, coordinates_of
from traction_model.lpv.matrices import Matrices
from traction_model.lpv.relative_error import relative_error
from traction_model.lpv.scheduling import Schedule

Array = NDArray[np.float64]

MAX_VARYING = 16
"""Largest number of varying coordinates; a polytope has 2 to this power corners."""


class Polytope:
    """Affine model as the convex hull of its systems at the corners of a box.

    Parameters
    ----------
    affine : AffineModel
        Affine model, in its units.

    Attributes
    ----------
    varying : ndarray of int
        Indices of the varying coordinates. Bit k of the number of a corner is 1 if the k-th of
        them is at its largest value.

    Raises
    ------
    ValueError
        If more than 16 coordinates vary.
    """

    def __init__(self, affine: AffineModel) -> None:
        self.affine = affine
        self.varying = np.flatnonzero(affine.high > affine.low)
        if len(self.varying) > MAX_VARYING:
            raise ValueError(
                f'{len(self.varying)} coordinates vary, a polytope takes at most '
                f'{MAX_VARYING}: narrow the ranges of the model'
            )

    def __len__(self) -> int:
        return 1 << len(self.varying)

    def corner(self, number: int) -> Array:
        """Coordinates of a corner.

        Parameters
        ----------
        number : int
            Number of the corner, 0 to the number of corners less one.

        Returns
        -------
        ndarray, shape (p,)
            Each in its own unit.
        """
        if not 0 <= number < len(self):
            raise ValueError(f'corner must be 0 to {len(self) - 1}, got {number}')
        place = self.affine.low.copy()
        up = (number >> np.arange(len(self.varying))) & 1 == 1
        place[self.varying[up]] = self.affine.high[self.varying[up]]
        return place

    def vertices(self) -> Iterator[Matrices]:
        """Systems at the corners, in the units of the model.

        Yields
        ------
        Matrices
            Corner by corner.
        """
        for number in range(len(self)):
            yield self.affine.at(self.corner(number))

    def weights(self, rho: Schedule) -> Array:
        """Convex weights of the corners.

        Parameters
        ----------
        rho : Schedule
            Scheduling vector within the ranges of the model, in the parameters' units.

        Returns
        -------
        ndarray, shape (2**k,)
            Non-negative weights with sum 1 (dimensionless).

        Raises
        ------
        ValueError
            If a coordinate is outside the box.
        """
        affine = self.affine
        place = coordinates_of(affine.model, rho, affine.coordinates)
        room = 1e-9 * np.maximum(np.abs(affine.low), np.abs(affine.high))
        outside = (place < affine.low - room) | (place > affine.high + room)
        if np.any(outside):
            k = int(np.flatnonzero(outside)[0])
            raise ValueError(
                f'{affine.names[k]} is {place[k]:g}, outside the polytope: '
                f'{affine.low[k]:g} to {affine.high[k]:g}'
            )
        weights = np.ones(1)
        shares = (place - affine.low)[self.varying] / (affine.high - affine.low)[self.varying]
        for share in np.clip(shares, 0.0, 1.0):
            weights = np.concatenate([weights * (1 - share), weights * share])
        return weights

    def matrices(self, rho: Schedule) -> Matrices:
        """Convex combination of the corners.

        Parameters
        ----------
        rho : Schedule
            Scheduling vector within the ranges of the model, in the parameters' units.

        Returns
        -------
        Matrices
            Matrices, in the units of the model.

        Raises
        ------
        ValueError
            As `weights`.
        """
        total = [np.zeros_like(entry) for entry in self.affine.constant]
        for weight, vertex in zip(self.weights(rho), self.vertices(), strict=True):
            for sum_, entry in zip(total, vertex, strict=True):
                sum_ += weight * entry
        return Matrices(*total)

    def error(self, samples: Sequence[Schedule]) -> float:
        """Largest error over samples.

        Parameters
        ----------
        samples : sequence of Schedule
            Samples of the comparison, in the parameters' units.

        Returns
        -------
        float
            Relative to every entry's largest magnitude, dimensionless.
        """
        exact = [self.affine.model.matrices(rho) for rho in samples]
        return relative_error(exact, [self.matrices(rho) for rho in samples])
