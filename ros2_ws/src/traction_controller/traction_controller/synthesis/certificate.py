"""Certificate of a gain table: proof of stability and performance, and its check with NumPy.

The loop of `traction_controller.synthesis.slip_loop` with the gains of the table is the closed
loop ``x+ = A*x + E*w`` with performance output ``z = C*x``. Unknown constants are the lag, the
delay and the factor f, estimated over true slip stiffness. Their ranges are cut into cells. For
each cell the certificate has positive definite matrices P over the slip pole, interpolated between
grid points, such that V = x'*P*x decreases:

    V+ - V <= gamma*w'*w - z'*z/gamma   for all w

(kind ``hinf``: from rest, the energy of z is at most gamma^2 times that of w), or

    V+ - V <= -z'*z   for w = 0,   and   e'*P*e <= cost for each column e of E

(kind ``lqr``: the energy of z after a unit jump of either disturbance is at most the cost). V+ is
computed at every vertex of the changes of stiffness and rim speed within a sample. So the
guarantee holds for all their time courses within the rate bounds, and the loop is exponentially
stable along all of them. With P = L*L' each inequality is equivalent to a norm bound on a matrix
N. The *margin* is 1 less the largest singular value of N, which is independent of units and
scaling of the states.

Not covered: negative stiffness (past the peak of a traction curve), jumps of stiffness (they count
as disturbances; the guarantee restarts after them), torque limits, and errors of the estimated
slip, moment and acceleration.
"""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from traction_controller.synthesis.slip_loop import ERROR, FIRST_COMMAND, MOMENT, TORQUE, slip_loop
from traction_model.definition import Definition

Array = NDArray[np.float64]

DENSER = 10
"""Density of the grid of the independent check, as a multiple of that of the synthesis."""

_KNEE = 1.0
"""Slip pole below which the grid is uniform in p, and above in ln p, 1/s."""


class CertificateError(ValueError):
    """A certificate does not hold; the text names inequality and place."""


class LoopDesign(Definition):
    """Design data of a gain table: the loop, its uncertainty and the weights.

    Attributes
    ----------
    kind : {'hinf', 'lqr'}
        Kind of guarantee, see the module.
    period : float
        Sampling period, s, above 0.
    delays : tuple of int
        Smallest and largest delay from a command to its arrival at the drive, samples, at least 1.
    lags : tuple of float
        Smallest and largest time constant from command to shaft torque, s, above 0.
    lag_cells : int
        Number of cells of the lag, uniform over its inverse, at least 1.
    largest_pole : float
        Upper end of the range of the slip pole, 1/s, above 0; the lower end is 0.
    grid : int
        Points of the grid over the slip pole, uniform over ln(1 + p), at least 2.
    stiffness_error : float
        Largest factor between estimated and true slip stiffness, both ways, at least 1.
    error_cells : int
        Number of cells of this factor, uniform over its logarithm, at least 1.
    stiffness_rate, rim_speed_rate : float
        Bounds of ``|d ln C/dt|`` and ``|d ln V/dt|``, 1/s, at least 0.
    moment_time : float
        Time constant of the measured moment in the loop, s, above 0. The slip filter smooths
        shaft torque and wheel acceleration by one and the same low-pass, of 0.04 s
        (`traction_controller.estimation.filter_step.FILTER`), and their difference is the
        measured moment. The default, 0.05 s, is longer by one period of 0.01 s. The guarantee
        holds for the value given; other values are not checked.
    response_time : float
        Desired time constant of slip, s, above 0: weight of slip error against effort.
    effort : float
        Weight of the command in z, over the command for a slip error of 1, dimensionless.
    """

    kind: Literal['hinf', 'lqr'] = 'hinf'
    period: float = Field(default=0.01, gt=0)
    delays: tuple[int, int] = (2, 2)
    lags: tuple[float, float] = (0.1, 0.3)
    lag_cells: int = Field(default=3, ge=1)
    largest_pole: float = Field(default=13000.0, gt=0)
    grid: int = Field(default=28, ge=2)
    stiffness_error: float = Field(default=2.0, ge=1)
    error_cells: int = Field(default=4, ge=1)
    stiffness_rate: float = Field(default=5.0, ge=0)
    rim_speed_rate: float = Field(default=2.0, ge=0)
    moment_time: float = Field(default=0.05, gt=0)
    response_time: float = Field(default=0.3, gt=0)
    effort: float = Field(default=20.0, gt=0)

    @model_validator(mode='after')
    def _ranges(self) -> 'LoopDesign':
        for name, (low, high) in (('lags', self.lags), ('delays', self.delays)):
            if not 0 < low <= high:
                raise ValueError(f'{name} must be above 0 and not fall, got {low} and {high}')
        return self

    @property
    def n_states(self) -> int:
        """Number of states of the loop, dimensionless."""
        return FIRST_COMMAND + self.delays[1]

    @property
    def n_gains(self) -> int:
        """Number of gains: on slip error, torque, and every delayed command."""
        return 2 + self.delays[1]

    @property
    def step(self) -> float:
        """Step of the grid over ln(1 + p), dimensionless."""
        return math.log1p(self.largest_pole / _KNEE) / (self.grid - 1)

    @property
    def poles(self) -> Array:
        """Grid of slip poles, 1/s, shape (grid,)."""
        return self.pole_at(np.arange(float(self.grid)))

    def pole_at(self, place: NDArray[np.float64]) -> Array:
        """Slip pole at a fractional grid index.

        Parameters
        ----------
        place : ndarray
            Indices, 0 at the first point, 1 at the second, dimensionless.

        Returns
        -------
        ndarray, of the shape of `place`
            1/s.
        """
        return np.asarray(_KNEE * np.expm1(place * self.step))

    def place_of(self, pole: NDArray[np.float64]) -> Array:
        """Fractional grid index of a slip pole, clipped to the grid.

        Parameters
        ----------
        pole : ndarray
            1/s, at least 0.

        Returns
        -------
        ndarray, of the shape of `pole`
            Indices, dimensionless.
        """
        return np.asarray(np.clip(np.log1p(pole / _KNEE) / self.step, 0.0, self.grid - 1.0))

    @property
    def delay_range(self) -> range:
        """Delays, samples."""
        return range(self.delays[0], self.delays[1] + 1)

    @property
    def lag_edges(self) -> Array:
        """Edges of the cells of lag, s, falling, shape (lag_cells + 1,)."""
        return np.asarray(1 / np.linspace(1 / self.lags[1], 1 / self.lags[0], self.lag_cells + 1))

    @property
    def error_edges(self) -> Array:
        """Edges of the cells of f, dimensionless, shape (error_cells + 1,)."""
        error = math.log(self.stiffness_error)
        return np.asarray(np.exp(np.linspace(-error, error, self.error_cells + 1)))

    def torque_factor(self, pole: NDArray[np.float64]) -> Array:
        """Torque per rate of slip, over G: ``1 + p*t``.

        Parameters
        ----------
        pole : ndarray
            Slip pole, 1/s.

        Returns
        -------
        ndarray, of the shape of `pole`
            Dimensionless, at least 1. The moment of the soil follows slip with the pole p. During
            t, the sum of mean lag, mean delay and `moment_time`, it takes part of the torque.
        """
        late = sum(self.lags) / 2 + sum(self.delays) / 2 * self.period + self.moment_time
        return np.asarray(1.0 + pole * late)


class Certificate(Definition):
    """Gains over the slip pole with their proof.

    Attributes
    ----------
    design : LoopDesign
        Design data of the gains.
    gains : tuple of tuple of float
        Gains at every pole of the grid: on slip error, 1/s; on shaft torque and on the commands
        sent 1, 2, ... samples ago, all less the measured moment, dimensionless.
    performance : tuple of float
        Gamma or cost at every pole, for all cells, dimensionless.
    lyapunov : nested tuples of float
        P in every cell of delay, lag and f, at every pole: upper triangle by rows; torques over G
        and over `LoopDesign.torque_factor`, dimensionless.
    """

    design: LoopDesign
    gains: tuple[tuple[float, ...], ...]
    performance: tuple[float, ...]
    lyapunov: tuple[tuple[tuple[tuple[tuple[float, ...], ...], ...], ...], ...]

    @model_validator(mode='after')
    def _shapes(self) -> 'Certificate':
        design = self.design
        s = design.n_states
        cells = len(design.delay_range), design.lag_cells, design.error_cells
        for name, value, shape in (
            ('gains', self.gains, (design.grid, design.n_gains)),
            ('performance', self.performance, (design.grid,)),
            ('lyapunov', self.lyapunov, (*cells, design.grid, s * (s + 1) // 2)),
        ):
            try:
                found = np.shape(value)
            except ValueError:
                found = ()
            if found != shape:
                raise ValueError(f'{name} must have shape {shape}, got {found or "ragged lists"}')
        return self

    def matrices(self) -> Array:
        """P as symmetric matrices.

        Returns
        -------
        ndarray, shape (delays, lag_cells, error_cells, grid, s, s)
            Dimensionless.
        """
        s = self.design.n_states
        row, column = np.triu_indices(s)
        packed = np.array(self.lyapunov)
        P = np.empty((*packed.shape[:-1], s, s))
        P[..., row, column] = packed
        P[..., column, row] = packed
        return P


@dataclass(frozen=True)
class Margins:
    """Result of a check.

    Attributes
    ----------
    least : float
        Smallest margin: 1 less the largest singular value, dimensionless. The certificate holds
        if it is at least 0.
    where : str
        Place of the smallest margin.
    points : int
        Number of inequalities.
    """

    least: float
    where: str
    points: int


def closed_loop(
    design: LoopDesign, gains: Array, place: Array, lag: Array, delay: int, factor: Array
) -> tuple[Array, Array, Array]:
    """Matrices of the closed loop.

    Parameters
    ----------
    design : LoopDesign
        Design data of the gains.
    gains : ndarray, shape (grid, g)
        Gains as in `Certificate`, 1/s and dimensionless.
    place : ndarray, shape (...)
        Fractional grid index of the slip pole, dimensionless.
    lag : ndarray, shape (...)
        Lag, s.
    delay : int
        Delay, in samples.
    factor : ndarray, shape (...)
        Estimated stiffness, at which gains are interpolated, over the true one, dimensionless.

    Returns
    -------
    A, E, C : ndarray
        ``x+ = A*x + E*w``, ``z = C*x``, dimensionless: torques and the disturbance of the soil are
        over G and `LoopDesign.torque_factor`.
    """
    place, lag, factor = np.broadcast_arrays(place, lag, factor)
    pole = design.pole_at(place)
    loop = slip_loop(pole, lag, design.period, delay, design.delays[1], design.moment_time)
    taken = _between(gains, design.place_of(factor * pole))
    feedback = np.zeros((*place.shape, design.n_states))
    feedback[..., ERROR] = -taken[..., 0]
    feedback[..., TORQUE] = -taken[..., 1]
    feedback[..., FIRST_COMMAND:] = -taken[..., 2:]
    A = loop.A + loop.B[..., :, None] * feedback[..., None, :]
    size = np.ones((*place.shape, design.n_states))
    size[..., TORQUE:] = design.torque_factor(pole)[..., None]
    A = A * size[..., None, :] / size[..., :, None]
    E = loop.E / size[..., :, None]
    E[..., 0] *= size[..., MOMENT, None]
    C = np.zeros((*place.shape, 2, design.n_states))
    C[..., 0, ERROR] = math.sqrt(design.period / design.response_time)
    weight = design.effort * math.sqrt(design.period * design.response_time)
    C[..., 1, :] = weight * feedback * size / size[..., TORQUE, None]
    return A, E, C


def cells(design: LoopDesign) -> Iterator[tuple[tuple[int, int, int], int, Array, Array]]:
    """Cells of the unknown constants.

    Parameters
    ----------
    design : LoopDesign
        Design data with the ranges.

    Yields
    ------
    index : tuple of int
        Indices of delay, lag and f.
    delay : int
        Delay, samples.
    lags, factors : ndarray, shape (2,)
        Edges of the cell, s and dimensionless.
    """
    lags, factors = design.lag_edges, design.error_edges
    for d, i, j in itertools.product(
        range(len(design.delay_range)), range(design.lag_cells), range(design.error_cells)
    ):
        yield (d, i, j), design.delay_range[d], lags[i : i + 2], factors[j : j + 2]


def moves(design: LoopDesign, place: Array) -> Iterator[tuple[Array, Array]]:
    """Grid indices that a slip pole can reach within a sample, by vertex of the rates.

    Parameters
    ----------
    design : LoopDesign
        Design data with the rates.
    place : ndarray, shape (k,)
        Fractional grid indices, dimensionless.

    Yields
    ------
    there : ndarray, shape (k,)
        Fractional grid indices, clipped to the grid, dimensionless.
    scale : ndarray, shape (k,)
        Factor of the torques for the move, dimensionless.
    """
    pole = design.pole_at(place)
    for stiffness, speed in itertools.product((-1.0, 1.0), (-1.0, 1.0)):
        stiffer = stiffness * design.stiffness_rate * design.period
        faster = speed * design.rim_speed_rate * design.period
        there = design.place_of(pole * math.exp(stiffer - faster))
        # G grows with rim speed, and the torque factor with the pole.
        factor = design.torque_factor(pole) / design.torque_factor(design.pole_at(there))
        yield there, factor * math.exp(-faster)


def check(certificate: Certificate, density: int = 1) -> Margins:
    """Check the inequalities of a certificate from its numbers alone.

    Parameters
    ----------
    certificate : Certificate
        Certificate to check.
    density : int
        Density of the check in slip pole, stiffness error and lag, as a multiple of the grid of
        the synthesis.

    Returns
    -------
    Margins
        Smallest margin, at least 0, dimensionless.

    Raises
    ------
    CertificateError
        If a matrix is not positive definite or an inequality does not hold; the text has the
        place.
    """
    found = margins(certificate, density)
    if not found.least >= 0:
        raise CertificateError(
            f'the certificate does not hold: the closed-loop inequality fails {found.where} '
            f'(margin {found.least:.3g})'
        )
    return found


def margins(certificate: Certificate, density: int = 1) -> Margins:
    """Smallest margin of a certificate, of either sign.

    Parameters
    ----------
    certificate : Certificate
        Certificate to check.
    density : int
        As for `check`.

    Returns
    -------
    Margins
        Smallest margin, dimensionless.

    Raises
    ------
    CertificateError
        If a matrix P is not positive definite, or the density is below 1.
    """
    if density < 1:
        raise CertificateError(f'density must be at least 1, got {density}')
    design = certificate.design
    P = certificate.matrices()
    min_eigenvalues = np.linalg.eigvalsh(P)[..., 0]
    if not np.all(min_eigenvalues > 0):
        *_, k = index = np.argwhere(~(min_eigenvalues > 0))[0]
        raise CertificateError(
            f'the certificate does not hold: the Lyapunov matrix at slip pole '
            f'{design.poles[k]:.4g} 1/s is not positive definite '
            f'(least eigenvalue {min_eigenvalues[tuple(index)]:.3g})'
        )
    places = np.linspace(0, design.grid - 1, (design.grid - 1) * density + 1)
    gains, performance = np.array(certificate.gains), np.array(certificate.performance)
    least, where, points = math.inf, '', 0
    for index, delay, lags, factors in cells(design):
        lag, factor = np.meshgrid(
            1 / np.linspace(1 / lags[0], 1 / lags[1], density + 1),
            np.geomspace(factors[0], factors[1], density + 1),
        )
        values = _contractions(
            design, gains, performance, P[index], places[:, None], lag.ravel(), delay,
            factor.ravel(),
        )  # fmt: skip
        points += values.size * 4
        worst = np.unravel_index(np.argmin(np.nan_to_num(values, nan=-np.inf)), values.shape)
        if not values[worst] >= least:
            least = float(values[worst])
            where = (
                f'at slip pole {float(design.pole_at(places[worst[0]])):.4g} 1/s, delay {delay} '
                f'samples, lag {lag.ravel()[worst[1]]:.3g} s, stiffness taken '
                f'{factor.ravel()[worst[1]]:.3g} times what it is'
            )
    return Margins(least, where, points)


def _contractions(
    design: LoopDesign,
    gains: Array,
    performance: Array,
    P: Array,
    place: Array,
    lag: Array,
    delay: int,
    factor: Array,
) -> Array:
    """Smallest margins over the vertices of the moves, shape (places, k); P of the cell."""
    A, E, C = closed_loop(design, gains, place, lag, delay, factor)
    column = place[:, 0]
    here = _between(P, column)
    back = np.swapaxes(np.linalg.inv(np.linalg.cholesky(here)), 1, 2)
    root = np.sqrt(_between(performance, column))[:, None, None, None]
    s = design.n_states
    least = np.full(A.shape[:2], np.inf)
    for there, scale in moves(design, column):
        sizes = np.ones((len(column), s))
        sizes[:, TORQUE:] = scale[:, None]
        moved = _between(P, there) * sizes[:, :, None] * sizes[:, None, :]
        up = np.swapaxes(np.linalg.cholesky(moved), 1, 2)
        if design.kind == 'hinf':
            N = np.zeros((*A.shape[:2], s + 2, s + 2))
            N[..., :s, :s] = up[:, None] @ A @ back[:, None]
            N[..., :s, s:] = up[:, None] @ E / root
            N[..., s:, :s] = C @ back[:, None] / root
        else:
            N = np.concatenate([up[:, None] @ A @ back[:, None], C @ back[:, None]], axis=2)
        least = np.minimum(least, 1 - _largest_singular(N))
    if design.kind == 'lqr':
        jump = np.swapaxes(np.linalg.cholesky(here), 1, 2)[:, None] @ E
        cost = np.max(np.sum(jump**2, axis=2), axis=2)
        least = np.minimum(least, 1 - np.sqrt(cost) / root[..., 0, 0])
    return least


def _largest_singular(N: Array) -> Array:
    """Largest singular value of each matrix, from the eigenvalues of N'*N, which is faster."""
    square = np.swapaxes(N, -1, -2) @ N
    return np.asarray(np.sqrt(np.linalg.eigvalsh(square)[..., -1]))


def _between(values: Array, at: Array) -> Array:
    """Interpolate rows linearly at fractional places within them."""
    low = np.minimum(at.astype(int), len(values) - 2)
    share = (at - low).reshape(at.shape + (1,) * (values.ndim - 1))
    return np.asarray((1 - share) * values[low] + share * values[low + 1])
