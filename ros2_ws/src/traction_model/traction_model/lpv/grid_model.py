"""LPV model of one soil as a table over operating points, with linear interpolation."""

import itertools

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_model.contact.contact import FREE, MIN_TRANSIT_SPEED
from traction_model.interpolation import GridTable
from traction_model.lpv.matrices import Matrices
from traction_model.lpv.model import MIN_SINKAGE, LpvModel
from traction_model.lpv.relative_error import relative_error
from traction_model.lpv.slip_slopes import wheel_speed
from traction_model.soil.soil import Soil

Array = NDArray[np.float64]


class GridModel:
    """LPV model of one soil with its terms in a table over slip, sinkage and speed.

    Terms are interpolated linearly. With wheel speeds as states the matrices are linear in the
    terms. With slips as states, slip and speed are exact and the other terms come from the table.
    Sinkage rate is 0.

    Parameters
    ----------
    model : LpvModel
        The exact model.
    soil : Soil
        Soil under all wheels, in SI units.
    slip, sinkage, speed : array_like, shapes (a,), (b,), (c,)
        Grid: slip of a wheel; its sinkage, m; speed, m/s, at least 0.05. At least 2 increasing
        values each.

    Raises
    ------
    ValueError
        If an axis does not increase or exceeds the range of the model.
    """

    def __init__(
        self, model: LpvModel, soil: Soil, slip: ArrayLike, sinkage: ArrayLike, speed: ArrayLike
    ) -> None:
        self.model = model
        self.soil = soil
        self.axes = {
            name: _axis(name, values, low, high)
            for name, values, low, high in (
                ('slip', slip, -0.99, 0.99),
                ('sinkage', sinkage, MIN_SINKAGE, min(w.radius for w in model.vehicle.wheels)),
                ('speed', speed, MIN_TRANSIT_SPEED, np.inf),
            )
        }
        points = [
            self._exact(v, np.full(model.n_wheels, i), np.full(model.n_wheels, z))
            for i, z, v in itertools.product(*self.axes.values())
        ]
        shape = tuple(len(axis) for axis in self.axes.values())
        # One table of all entries, with terms in the order of their names.
        self._sizes = {name: len(entries) for name, entries in points[0].items()}
        flat = [np.concatenate([*terms.values()]) for terms in points]
        self._table = GridTable([*self.axes.values()], np.reshape(flat, (*shape, -1)))

    def _exact(self, v: float, slip: Array, sinkage: Array) -> dict[str, Array]:
        """Terms at an operating point."""
        n = self.model.n_wheels
        omega = wheel_speed(v, slip, [wheel.radius for wheel in self.model.vehicle.wheels])
        free = np.full(n, FREE)
        point = self.model.at_uncoupled(v, omega, sinkage, np.zeros(n), [self.soil] * n, free)
        return self.model.terms(point.rho)

    def matrices(self, speed: float, slip: ArrayLike, sinkage: ArrayLike) -> Matrices:
        """Interpolated matrices at an operating point.

        Parameters
        ----------
        speed : float
            m/s, forward.
        slip : array_like, shape (n,)
            Slip of every wheel.
        sinkage : array_like, shape (n,)
            Sinkage of every wheel, m.

        Returns
        -------
        Matrices
            Matrices, in the units of the model.

        Raises
        ------
        ValueError
            If a value is outside the grid or has the wrong shape.
        """
        n = self.model.n_wheels
        given = {'slip': slip, 'sinkage': sinkage, 'speed': np.full(n, speed)}
        for name, values in given.items():
            entries = np.asarray(values, dtype=float)
            if entries.shape != (n,):
                raise ValueError(f'{name} must have shape ({n},), got {entries.shape}')
            axis = self.axes[name]
            # False for NaN, too.
            within = (entries >= axis[0]) & (entries <= axis[-1])
            if not np.all(within):
                j = int(np.flatnonzero(~within)[0])
                raise ValueError(
                    f"{name} at wheel '{self.model.vehicle.wheel_names[j]}' is {entries[j]:g}, "
                    f'outside the grid: {axis[0]:g} to {axis[-1]:g}'
                )
        # Terms of a wheel at its own operating point; terms of the vehicle at that of the first
        # wheel.
        found = [self._table.at(*place) for place in np.column_stack([*given.values()])]
        terms, first = {}, 0
        for name, size in self._sizes.items():
            terms[name] = np.array([found[j][first + j] for j in range(size)])
            first += size
        return self.model.assemble(terms)

    def error(self, count: int = 200, seed: int = 0) -> float:
        """Largest error over operating points drawn uniformly within the grid.

        Parameters
        ----------
        count : int
            Number of points, at least 1.
        seed : int
            Seed of the random numbers.

        Returns
        -------
        float
            Relative to every entry's largest magnitude, dimensionless.
        """
        n = self.model.n_wheels
        random = np.random.default_rng(seed)
        slips, sinkages = (
            random.uniform(self.axes[name][0], self.axes[name][-1], (count, n))
            for name in ('slip', 'sinkage')
        )
        speeds = random.uniform(self.axes['speed'][0], self.axes['speed'][-1], count)
        points = list(zip(speeds, slips, sinkages, strict=True))
        exact = [self.model.assemble(self._exact(*point)) for point in points]
        return relative_error(exact, [self.matrices(*point) for point in points])


def _axis(name: str, values: ArrayLike, low: float, high: float) -> Array:
    """Check one axis of a grid."""
    axis = np.asarray(values, dtype=float)
    if axis.ndim != 1 or axis.size < 2 or not np.all(np.diff(axis) > 0):
        raise ValueError(f'{name} of a grid must be at least 2 increasing numbers, got {axis}')
    if axis[0] < low or axis[-1] > high:
        raise ValueError(f'{name} of a grid must lie within {low:g} to {high:g}, got {axis}')
    return axis
