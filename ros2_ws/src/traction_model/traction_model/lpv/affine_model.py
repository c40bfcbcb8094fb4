"""LPV model as ``A0 + sum(rho_i*A_i)``, the form for linear matrix inequalities."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_model.lpv.matrices import Matrices
from traction_model.lpv.model import LpvModel
from traction_model.lpv.relative_error import relative_error
from traction_model.lpv.scheduling import Schedule
from traction_node.closest import closest

Array = NDArray[np.float64]

Coordinates = Literal['terms', 'schedule']
"""Coordinates of an affine model: `LpvModel.terms`, or rho itself."""


def coordinates_of(model: LpvModel, rho: Schedule, coordinates: Coordinates) -> Array:
    """Coordinates of a scheduling vector.

    Parameters
    ----------
    model : LpvModel
        The exact model.
    rho : Schedule
        Scheduling vector, in the parameters' units.
    coordinates : {'terms', 'schedule'}
        Kind of coordinates.

    Returns
    -------
    ndarray, shape (p,)
        Coordinates, each in its own unit.
    """
    if coordinates == 'schedule':
        return rho.vector()
    return np.concatenate([*model.terms(rho).values()])


def _box(model: LpvModel, coordinates: Coordinates) -> tuple[Array, Array]:
    """Smallest and largest coordinates over the ranges of the model."""
    parameters = model.parameters
    if coordinates == 'schedule':
        low = np.concatenate([entry.low for entry in parameters.values()])
        return low, np.concatenate([entry.high for entry in parameters.values()])
    # Terms are monotone in every parameter between its extremes, and terms of a wheel depend on
    # that wheel only. So the corners, for all wheels at once, have the extremes.
    choices = [[entry.extremes(j) for j in range(len(entry.low))] for entry in parameters.values()]
    corners = []
    for picks in itertools.product(*(range(max(map(len, per))) for per in choices)):
        values = {
            name: np.array([extremes[min(pick, len(extremes) - 1)] for extremes in per])
            for name, per, pick in zip(parameters, choices, picks, strict=True)
        }
        corners.append(coordinates_of(model, Schedule(values), coordinates))
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
    """LPV model as ``constant + sum(rho_i*slopes_i)``; constructed by `AffineModel.fit`.

    Attributes
    ----------
    model : LpvModel
        The exact model.
    coordinates : {'terms', 'schedule'}
        Kind of rho_i.
    names : tuple of str
        Names of the p coordinates.
    low, high : ndarray, shape (p,)
        Their smallest and largest values over the ranges of the model, each in its own unit.
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
        """Fit by least squares; exact in the terms of a model with wheel speeds as states.

        Parameters
        ----------
        model : LpvModel
            The exact model, with ranges narrowed to operation.
        coordinates : {'terms', 'schedule'}
            Affine in `LpvModel.terms` or in rho itself.
        samples : sequence of Schedule, optional
            Samples for the fit, in the parameters' units, more than coordinates; default: ten per
            coordinate, drawn from the ranges.

        Returns
        -------
        AffineModel
            The fit, in the units of the model; see `error` for its accuracy.

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
        places = np.array([coordinates_of(model, rho, coordinates) for rho in samples])
        basis = np.column_stack([np.ones(len(samples)), (places - middle) / half])
        exact = [model.matrices(rho) for rho in samples]
        constants, slopes = [], []
        for entries in zip(*exact, strict=True):
            stacked = np.array(entries)
            flat = stacked.reshape(len(samples), -1)
            # Each entry is scaled by its largest value; entries without one are set to 0.
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
        """Matrices at coordinates.

        Parameters
        ----------
        place : array_like, shape (p,)
            Coordinates in the order of `names`, each in its own unit.

        Returns
        -------
        Matrices
            Matrices, in the units of the model.

        Raises
        ------
        ValueError
            If the number of coordinates is wrong or one is not finite.
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
        """Matrices at a scheduling vector.

        Parameters
        ----------
        rho : Schedule
            Scheduling vector of the model, in the parameters' units.

        Returns
        -------
        Matrices
            Matrices, in the units of the model.
        """
        return self.at(coordinates_of(self.model, rho, self.coordinates))

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
        exact = [self.model.matrices(rho) for rho in samples]
        return relative_error(exact, [self.matrices(rho) for rho in samples])
