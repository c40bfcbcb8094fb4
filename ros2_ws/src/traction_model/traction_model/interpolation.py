"""Multilinear interpolation in a table over a grid of any number of axes."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_model.kernel import kernel

Array = NDArray[np.float64]


@kernel
def _interpolate(coordinates, ends, rows, place, found):
    """Weighted sum of the corners of the cell around a place."""
    axes = ends.size - 1
    cells = np.empty(axes, dtype=np.int64)
    shares = np.empty(axes)
    for k in range(axes):
        axis = coordinates[ends[k] : ends[k + 1]]
        cell = min(max(np.searchsorted(axis, place[k]) - 1, 0), axis.size - 2)
        share = (place[k] - axis[cell]) / (axis[cell + 1] - axis[cell])
        cells[k] = cell
        shares[k] = min(max(share, 0.0), 1.0)
    found[:] = 0.0
    for corner in range(1 << axes):
        weight = 1.0
        row = 0
        for k in range(axes):
            up = corner >> k & 1
            weight *= shares[k] if up else 1.0 - shares[k]
            row = row * (ends[k + 1] - ends[k]) + cells[k] + up
        if weight > 0.0:
            for i in range(found.size):
                found[i] += weight * rows[row, i]


class GridTable:
    """Table over a grid, linear between grid points, constant beyond the ends.

    Parameters
    ----------
    axes : sequence of array_like, shapes (a,), (b,), ...
        Increasing coordinates of the grid points, at least 2 along each axis, each in its own
        unit.
    values : array_like, shape (a, b, ..., *s)
        Values at the grid points, each entry in its own unit.

    Raises
    ------
    ValueError
        If an axis has fewer than 2 coordinates or does not increase, or the shape of the values
        does not match the grid.
    """

    def __init__(self, axes: Sequence[ArrayLike], values: ArrayLike) -> None:
        grid = [np.asarray(axis, dtype=float) for axis in axes]
        for k, axis in enumerate(grid):
            if axis.ndim != 1 or axis.size < 2 or not np.all(np.diff(axis) > 0):
                raise ValueError(f'axis {k} must be at least 2 increasing numbers, got {axis}')
        table = np.asarray(values, dtype=float)
        lengths = tuple(axis.size for axis in grid)
        if table.shape[: len(grid)] != lengths:
            raise ValueError(f'values must have shape {lengths} and more, got {table.shape}')
        self._coordinates = np.concatenate(grid)
        self._ends = np.cumsum([0, *lengths])
        self._shape = table.shape[len(grid) :]
        self._rows = np.ascontiguousarray(table.reshape(int(np.prod(lengths)), -1))

    def at(self, *place: float) -> Array:
        """Value at a place.

        Parameters
        ----------
        *place : float
            One coordinate along every axis, in its unit.

        Returns
        -------
        ndarray, shape s
            Value, in the unit of the values.

        Raises
        ------
        ValueError
            If the number of coordinates is wrong.
        """
        if len(place) != len(self._ends) - 1:
            raise ValueError(f'place must be {len(self._ends) - 1} numbers, got {len(place)}')
        found = np.empty(self._rows.shape[1])
        _interpolate(self._coordinates, self._ends, self._rows, np.array(place), found)
        return found.reshape(self._shape)
