"""Representations of an LPV model for synthesis and for fast lookup, each with its error.

- `AffineModel`: ``A0 + sum(rho_i*A_i)``, the form that linear matrix inequalities take;
- `Polytope`: systems at the corners of a box and convex weights, the same as an affine model;
- `GridModel`: tables over operating points, interpolated linearly, for one soil.

An error is the largest difference of any entry of A, B and B_uc from the exact model over some
samples, relative to the largest magnitude that this entry has over them (dimensionless).
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_model.contact.contact import FREE, MIN_TRANSIT_SPEED
from traction_model.lpv.model import MIN_SINKAGE, LpvModel, Matrices, wheel_speed
from traction_model.lpv.scheduling import Schedule
from traction_model.soil.soil import Soil
from traction_node.closest import closest

Array = NDArray[np.float64]

Coordinates = Literal['terms', 'schedule']
"""What an affine model is affine in: the model's `LpvModel.terms`, or rho itself."""

MOST_VARYING = 16
"""Coordinates that a polytope may have; it has two corners to the power of their number."""


def _relative_error(exact: Sequence[Matrices], found: Sequence[Matrices]) -> float:
    """Largest difference of an entry over its largest magnitude."""
    worst = 0.0
    for name in ('A', 'B', 'B_uc'):
        wanted = np.array([getattr(entry, name) for entry in exact])
        got = np.array([getattr(entry, name) for entry in found])
        size = np.abs(wanted).max(axis=0)
        difference = np.abs(got - wanted).max(axis=0)
        # An entry that is always zero and is not found so has an infinite relative error.
        with np.errstate(divide='ignore'):
            relative = np.divide(difference, size, out=np.zeros_like(size), where=difference > 0)
        worst = max(worst, float(relative.max()))
    return worst


def _vector(model: LpvModel, rho: Schedule, coordinates: Coordinates) -> Array:
    """Coordinates of a scheduling vector, each in its own unit."""
    if coordinates == 'schedule':
        return rho.vector()
    return np.concatenate([*model.terms(rho).values()])


def _box(model: LpvModel, coordinates: Coordinates) -> tuple[Array, Array]:
    """Least and greatest coordinates over the ranges of the model."""
    parameters = model.parameters
    if coordinates == 'schedule':
        low = np.concatenate([entry.low for entry in parameters.values()])
        return low, np.concatenate([entry.high for entry in parameters.values()])
    # Terms are monotone in every parameter between its extremes, and those of a wheel depend
    # on no other: the corners, taken for all wheels at once, hold their extremes.
    choices = [[entry.extremes(j) for j in range(len(entry.low))] for entry in parameters.values()]
    corners = []
    for picks in itertools.product(*(range(max(map(len, per))) for per in choices)):
        values = {
            name: np.array([extremes[min(pick, len(extremes) - 1)] for extremes in per])
            for name, per, pick in zip(parameters, choices, picks, strict=True)
        }
        corners.append(_vector(model, Schedule(values), coordinates))
    return np.min(corners, axis=0), np.max(corners, axis=0)


def _labels(model: LpvModel, coordinates: Coordinates) -> tuple[str, ...]:
    """Name of every coordinate."""
    some = model.sample(1)[0]
    values = some.values if coordinates == 'schedule' else model.terms(some)
    names = model.vehicle.wheel_names
    return tuple(
        label
        for name, entries in values.items()
        for label in (
            [f'{name}_{wheel}' for wheel in names] if len(entries) == len(names) else [name]
        )
    )


@dataclass(frozen=True)
class AffineModel:
    """An LPV model as ``constant + sum(rho_i*slopes_i)``; made by `AffineModel.fit`.

    Attributes
    ----------
    model : LpvModel
        The exact model.
    coordinates : {'terms', 'schedule'}
        What rho_i are.
    names : tuple of str
        Names of the p coordinates.
    low, high : ndarray, shape (p,)
        Their least and greatest over the ranges of the model, each in its own unit.
    constant : Matrices
        A0, B0 ... in the model's units.
    slopes : Matrices
        Arrays of shape (p, ...), per unit of every coordinate.
    """

    model: LpvModel
    coordinates: Coordinates
    names: tuple[str, ...]
    low: Array
    high: Array
    constant: Matrices
    slopes: Matrices

    @classmethod
    def fit(
        cls,
        model: LpvModel,
        coordinates: Coordinates = 'terms',
        samples: Sequence[Schedule] | None = None,
    ) -> 'AffineModel':
        """Fit by least squares; in the terms of a model with wheel speeds as states, exactly.

        Parameters
        ----------
        model : LpvModel
            The exact model, its ranges narrowed to what is met.
        coordinates : {'terms', 'schedule'}
            Affine in `LpvModel.terms` or in rho itself.
        samples : sequence of Schedule, optional
            Where to fit, in the parameters' units, more than there are coordinates; ten per
            coordinate drawn from the ranges when not given.

        Returns
        -------
        AffineModel
            The fit; `error` tells how good it is. Units of the model.

        Raises
        ------
        ValueError
            On unknown coordinates or too few samples.
        """
        if coordinates not in get_args(Coordinates):
            raise ValueError(
                f'unknown coordinates {coordinates!r}'
                f'{closest(str(coordinates), get_args(Coordinates))}'
            )
        low, high = _box(model, coordinates)
        if samples is None:
            samples = model.sample(10 * (len(low) + 1))
        if len(samples) <= len(low):
            raise ValueError(f'{len(low)} coordinates need more samples than {len(samples)}')
        middle = (low + high) / 2
        half = np.where(high > low, (high - low) / 2, 1.0)
        places = np.array([_vector(model, rho, coordinates) for rho in samples])
        basis = np.column_stack([np.ones(len(samples)), (places - middle) / half])
        exact = [model.matrices(rho) for rho in samples]
        constants, slopes = [], []
        for entries in zip(*exact, strict=True):
            stacked = np.array(entries)
            flat = stacked.reshape(len(samples), -1)
            # Each entry in units of its largest, and what is not there set to nothing after.
            size = np.abs(flat).max(axis=0)
            size[size == 0] = 1.0
            solution = np.linalg.lstsq(basis, flat / size, rcond=None)[0]
            solution[np.abs(solution) < 1e-13] = 0.0
            solution *= size
            slope = solution[1:] / half[:, None]
            constant = solution[0] - middle @ slope
            constants.append(constant.reshape(stacked.shape[1:]))
            slopes.append(slope.reshape(len(low), *stacked.shape[1:]))
        return cls(
            model, coordinates, _labels(model, coordinates), low, high,
            Matrices(*constants), Matrices(*slopes),
        )  # fmt: skip

    def at(self, place: ArrayLike) -> Matrices:
        """Return the matrices at coordinates.

        Parameters
        ----------
        place : array_like, shape (p,)
            Coordinates in the order of `names`, each in its own unit.

        Returns
        -------
        Matrices
            In the units of the model.

        Raises
        ------
        ValueError
            If their number is wrong or one is not finite.
        """
        values = np.asarray(place, dtype=float)
        if values.shape != self.low.shape:
            raise ValueError(f'coordinates must be {len(self.low)}, got shape {values.shape}')
        if not np.all(np.isfinite(values)):
            name = self.names[int(np.flatnonzero(~np.isfinite(values))[0])]
            raise ValueError(f'coordinate {name} is not finite')
        return Matrices(
            *(
                constant + np.tensordot(values, slope, axes=1)
                for constant, slope in zip(self.constant, self.slopes, strict=True)
            )
        )

    def matrices(self, rho: Schedule) -> Matrices:
        """Return the matrices at a scheduling vector.

        Parameters
        ----------
        rho : Schedule
            Scheduling vector of the model, in the parameters' units.

        Returns
        -------
        Matrices
            In the units of the model.
        """
        return self.at(_vector(self.model, rho, self.coordinates))

    def error(self, samples: Sequence[Schedule]) -> float:
        """Return the largest error over samples.

        Parameters
        ----------
        samples : sequence of Schedule
            Where to compare, in the parameters' units.

        Returns
        -------
        float
            Relative to every entry's largest magnitude, dimensionless.
        """
        exact = [self.model.matrices(rho) for rho in samples]
        return _relative_error(exact, [self.matrices(rho) for rho in samples])

    def polytope(self) -> 'Polytope':
        """Return the polytope over the box of the coordinates, in the model's units.

        Returns
        -------
        Polytope
            Its convex combinations are this affine model.

        Raises
        ------
        ValueError
            If more than 16 coordinates vary: narrow the ranges of the model.
        """
        return Polytope(self)


class Polytope:
    """An affine model as the convex hull of its systems at the corners of a box.

    Parameters
    ----------
    affine : AffineModel
        The model, in its units.

    Attributes
    ----------
    varying : ndarray of int
        Which coordinates vary: bit k of a corner's number tells whether the k-th of them is
        at its greatest.

    Raises
    ------
    ValueError
        If more than 16 coordinates vary.
    """

    def __init__(self, affine: AffineModel) -> None:
        self.affine = affine
        self.varying = np.flatnonzero(affine.high > affine.low)
        if len(self.varying) > MOST_VARYING:
            raise ValueError(
                f'{len(self.varying)} coordinates vary, a polytope takes at most '
                f'{MOST_VARYING}: narrow the ranges of the model'
            )

    def __len__(self) -> int:
        return 1 << len(self.varying)

    def corner(self, number: int) -> Array:
        """Return the coordinates of a corner.

        Parameters
        ----------
        number : int
            0 to the number of corners less one.

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
        """Yield the systems at the corners, in the model's units.

        Yields
        ------
        Matrices
            Corner by corner.
        """
        for number in range(len(self)):
            yield self.affine.at(self.corner(number))

    def weights(self, rho: Schedule) -> Array:
        """Return the convex weights of the corners.

        Parameters
        ----------
        rho : Schedule
            Scheduling vector within the ranges of the model, in the parameters' units.

        Returns
        -------
        ndarray, shape (2**k,)
            Shares, none negative, of sum 1 (dimensionless).

        Raises
        ------
        ValueError
            Naming the coordinate that is outside the box.
        """
        affine = self.affine
        place = _vector(affine.model, rho, affine.coordinates)
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
        """Return the convex combination of the corners.

        Parameters
        ----------
        rho : Schedule
            Scheduling vector within the ranges of the model, in the parameters' units.

        Returns
        -------
        Matrices
            In the units of the model.

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
        """Return the largest error over samples.

        Parameters
        ----------
        samples : sequence of Schedule
            Where to compare, in the parameters' units.

        Returns
        -------
        float
            Relative to every entry's largest magnitude, dimensionless.
        """
        exact = [self.affine.model.matrices(rho) for rho in samples]
        return _relative_error(exact, [self.matrices(rho) for rho in samples])


class GridModel:
    """An LPV model of one soil, its terms tabulated over slip, sinkage and speed.

    Between grid points the terms are interpolated linearly. With wheel speeds as states the
    matrices are linear in them, so that matrices are interpolated; with slips as states slip
    and speed enter exactly and the other terms from the table. Sinkage is taken to be steady.

    Parameters
    ----------
    model : LpvModel
        The exact model.
    soil : Soil
        Under all wheels, in SI units.
    slip, sinkage, speed : array_like, shapes (a,), (b,), (c,)
        Grid: slip of a wheel; its sinkage, m; speed, m/s, at least 0.05. Each increases, of at
        least 2 values.

    Raises
    ------
    ValueError
        Naming the axis that does not increase or leaves the model's range.
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
        # Costly to import, and of no use to those who only simulate.
        from scipy.interpolate import RegularGridInterpolator

        points = [
            self._exact(v, np.full(model.n_wheels, i), np.full(model.n_wheels, z))
            for i, z, v in itertools.product(*self.axes.values())
        ]
        shape = tuple(len(axis) for axis in self.axes.values())
        self._tables = {
            name: [
                RegularGridInterpolator(
                    tuple(self.axes.values()),
                    np.reshape([terms[name][j] for terms in points], shape),
                )
                for j in range(len(points[0][name]))
            ]
            for name in points[0]
        }

    def _exact(self, v: float, slip: Array, sinkage: Array) -> dict[str, Array]:
        """Terms at an operating point."""
        n = self.model.n_wheels
        omega = wheel_speed(v, slip, [wheel.radius for wheel in self.model.vehicle.wheels])
        free = np.full(n, FREE)
        point = self.model.at_uncoupled(v, omega, sinkage, np.zeros(n), [self.soil] * n, free)
        return self.model.terms(point.rho)

    def matrices(self, speed: float, slip: ArrayLike, sinkage: ArrayLike) -> Matrices:
        """Return the interpolated matrices at an operating point.

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
            In the units of the model.

        Raises
        ------
        ValueError
            Naming what is outside the grid or of the wrong length.
        """
        n = self.model.n_wheels
        given = {'slip': slip, 'sinkage': sinkage, 'speed': np.full(n, speed)}
        for name, values in given.items():
            entries = np.asarray(values, dtype=float)
            if entries.shape != (n,):
                raise ValueError(f'{name} must have shape ({n},), got {entries.shape}')
            axis = self.axes[name]
            # Not so for NaN either.
            within = (entries >= axis[0]) & (entries <= axis[-1])
            if not np.all(within):
                j = int(np.flatnonzero(~within)[0])
                raise ValueError(
                    f"{name} at wheel '{self.model.vehicle.wheel_names[j]}' is {entries[j]:g}, "
                    f'outside the grid: {axis[0]:g} to {axis[-1]:g}'
                )
        places = np.column_stack([*given.values()])
        return self.model.assemble(
            {
                name: np.array([float(table(places[j])[0]) for j, table in enumerate(tables)])
                for name, tables in self._tables.items()
            }
        )

    def error(self, count: int = 200, seed: int = 0) -> float:
        """Return the largest error over operating points drawn evenly within the grid.

        Parameters
        ----------
        count : int
            How many points, at least 1.
        seed : int
            Of the random numbers.

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
        return _relative_error(exact, [self.matrices(*point) for point in points])


def _axis(name: str, values: ArrayLike, low: float, high: float) -> Array:
    """Check one axis of a grid."""
    axis = np.asarray(values, dtype=float)
    if axis.ndim != 1 or axis.size < 2 or not np.all(np.diff(axis) > 0):
        raise ValueError(f'{name} of a grid must be at least 2 increasing numbers, got {axis}')
    if axis[0] < low or axis[-1] > high:
        raise ValueError(f'{name} of a grid must lie within {low:g} to {high:g}, got {axis}')
    return axis
