"""Certificate of a gain table: what is guaranteed for which loop, and its check by NumPy alone.

With the loop of `traction_controller.slip_loop` at slip pole p and lag, the stiffness taken for
f times what it is, and the gains that the table gives for it, the closed loop is
``x+ = A*x + E*w`` and what is weighed ``z = C*x``. The certificate holds positive definite
matrices P(p, f, lag), interpolated between the points of its grid, such that V = x'*P*x falls:

- ``hinf``: V+ - V <= gamma*w'*w - z'*z/gamma for all w: from rest, the energy of z is at most
  gamma^2 times that of w.
- ``lqr``: V+ - V <= -z'*z for w = 0, and trace(E'*P*E) <= cost: the energy of z after a unit
  jump of place and that after one of the target come to at most the cost together.

V+ is taken at every vertex of how far p, stiffness and f can have moved within a sample, so both
hold for all courses of them within the rates, and along all of them the loop is exponentially
stable. With P = L*L' either one says that a matrix N contracts, and the *margin* is
1 - its largest singular value: free of units and of the sizes of states.

Not covered: stiffness outside the range of the table or falling to zero and below (past the peak
of a thrust curve with a hump), steps of stiffness faster than its rate (they count as
disturbances before and after), limits of torque, errors of the slip estimate.
"""

import itertools
import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from traction_controller.slip_loop import (
    ERROR,
    FIRST_COMMAND,
    SLIP,
    TORQUE,
    slip_loop,
)
from traction_model.definition import Definition

Array = NDArray[np.float64]

DENSER = 10
"""By how much the independent check's grid is denser than that of the synthesis."""


class CertificateError(ValueError):
    """A certificate that does not hold; the text says which inequality, and where."""


class LoopDesign(Definition):
    """What a table of gains is designed for.

    Attributes
    ----------
    kind : {'hinf', 'lqr'}
        What is guaranteed, see the module.
    period : float
        Sampling period, s, above 0.
    delays : tuple of int
        Least and largest number of samples from a command to its arrival at the drive, at least
        1. It is not known, and stays as it is.
    lags : tuple of float
        Least and largest time constant from command to shaft torque, s, above 0. It is not
        known, and stays as it is.
    poles : tuple of float
        Grid of slip poles, 1/s, in geometric progression by the `error_steps`-th root of the
        stiffness error.
    largest_pole : float
        Up to which slip pole the guarantee goes, 1/s; above the grid the last gains stand.
    stiffness_error : float
        Factor by which the slip stiffness may be taken too low or too high, above 1.
    error_steps : int
        Steps of the grid from no error of stiffness to the largest, at least 1.
    pole_error : float
        Factor by which the slip pole may be misjudged besides, dimensionless, at least 1: the
        effect of mass and slip.
    stiffness_rate, rim_speed_rate, error_rate : float
        Bounds of ``|d ln C/dt|``, ``|d ln V/dt|`` and ``|d ln f/dt|``, 1/s, at least 0.
    error_time : float
        s: z holds the slip error times period over this time ...
    effort : float
        ... and the change of command, over the torque scale, times this, dimensionless.
    """

    kind: Literal['hinf', 'lqr'] = 'hinf'
    period: float = Field(default=0.01, gt=0)
    delays: tuple[int, int] = (2, 3)
    lags: tuple[float, float] = (0.1, 0.3)
    poles: tuple[float, ...] = Field(min_length=1)
    largest_pole: float = Field(gt=0)
    stiffness_error: float = Field(default=2.0, gt=1)
    error_steps: int = Field(default=1, ge=1)
    pole_error: float = Field(default=1.25, ge=1)
    stiffness_rate: float = Field(default=5.0, ge=0)
    rim_speed_rate: float = Field(default=2.0, ge=0)
    error_rate: float = Field(default=0.0, ge=0)
    error_time: float = Field(default=0.2, gt=0)
    effort: float = Field(default=0.5, gt=0)

    @model_validator(mode='after')
    def _ranges(self) -> 'LoopDesign':
        if not 1 <= self.delays[0] <= self.delays[1]:
            raise ValueError(f'delays must be at least 1 and not fall, got {self.delays}')
        low, high = self.lags
        if not 0 < low < high:
            raise ValueError(f'lags must be above 0 and increase, got {low} and {high} s')
        steps = np.diff(np.log(np.maximum(self.poles, 1e-300)))
        if not np.allclose(steps, self.step, rtol=1e-9):
            raise ValueError(
                f'poles must be above 0 and grow by {math.exp(self.step):.6g}, the '
                f'{self.error_steps}. root of the stiffness error'
            )
        if self.largest_pole < self.poles[-1] * (1 - 1e-9):
            raise ValueError('largest_pole lies within the grid of poles')
        return self

    @property
    def n_states(self) -> int:
        """Number of states of the loop, dimensionless."""
        return FIRST_COMMAND + self.delays[1]

    @property
    def n_gains(self) -> int:
        """Number of gains: on slip, torque, integral and every command under way."""
        return 3 + self.delays[1]

    @property
    def step(self) -> float:
        """Step of the grid over ln p and ln f, dimensionless."""
        return math.log(self.stiffness_error) / self.error_steps

    @property
    def powers(self) -> range:
        """Grid of stiffness errors: powers of the step's factor."""
        return range(-self.error_steps, self.error_steps + 1)

    @property
    def delay_range(self) -> range:
        """Numbers of samples that the delay may be."""
        return range(self.delays[0], self.delays[1] + 1)

    @property
    def pole_errors(self) -> tuple[float, ...]:
        """Factors by which the slip pole is misjudged beside the stiffness, dimensionless."""
        return tuple(sorted({1 / self.pole_error, 1.0, self.pole_error}))

    def lag_at(self, share: float) -> float:
        """Lag at a share of its range, even in 1/lag, in which models are nearly linear.

        Parameters
        ----------
        share : float
            0 at the least lag to 1 at the largest, dimensionless.

        Returns
        -------
        float
            s.
        """
        return 1 / ((1 - share) / self.lags[0] + share / self.lags[1])

    @property
    def gain_poles(self) -> tuple[float, ...]:
        """Slip poles that there are gains for, 1/s: further down, as far as stiffness errs."""
        ratio = math.exp(self.step)
        below = (self.poles[0] * ratio**k for k in range(-self.error_steps, 0))
        return (*below, *self.poles)


class Certificate(Definition):
    """Gains over the slip pole with what proves them.

    Attributes
    ----------
    design : LoopDesign
        What they are for.
    gains : tuple of tuple of float
        At every one of `LoopDesign.gain_poles`: on slip, over the torque scale; on torque, 1; on
        the integral of the slip error, over the torque scale, 1/s; on the commands sent 1, 2 ...
        samples ago, 1. All as changes, see `traction_controller.gain_table`.
    performance : tuple of float
        At every one of these gamma or the cost, dimensionless.
    lyapunov : nested tuples of float
        P at every one of `poles`, stiffness error, delay and lag: the upper triangle row by row;
        dimensionless.
    """

    design: LoopDesign
    gains: tuple[tuple[float, ...], ...]
    performance: tuple[float, ...]
    lyapunov: tuple[tuple[tuple[tuple[tuple[float, ...], ...], ...], ...], ...]

    @model_validator(mode='after')
    def _shapes(self) -> 'Certificate':
        design = self.design
        poles, s = len(design.poles), design.n_states
        rows = poles + design.error_steps
        for name, value, shape in (
            ('gains', self.gains, (rows, design.n_gains)),
            ('performance', self.performance, (rows,)),
            (
                'lyapunov',
                self.lyapunov,
                (poles, len(design.powers), len(design.delay_range), 2, s * (s + 1) // 2),
            ),
        ):
            try:
                found = np.shape(value)
            except ValueError:
                found = ()
            if found != shape:
                raise ValueError(f'{name} must have shape {shape}, got {found or "ragged lists"}')
        return self

    def matrices(self) -> Array:
        """Return P as symmetric matrices.

        Returns
        -------
        ndarray, shape (poles, powers, delays, 2, s, s)
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
    """What a check found.

    Attributes
    ----------
    least : float
        Least margin: 1 less the largest singular value, dimensionless; the certificate holds
        where it is at least 0.
    where : str
        Where it is least.
    points : int
        Number of inequalities.
    """

    least: float
    where: str
    points: int


def closed_loop(
    design: LoopDesign, gains: Array, pole: Array, lag: Array, delay: int, factor: Array
) -> tuple[Array, Array, Array]:
    """Close the loop.

    Parameters
    ----------
    design : LoopDesign
        What the gains are for.
    gains : ndarray, shape (..., g)
        Gains as in `Certificate`, dimensionless and 1/s.
    pole, lag : ndarray, shape (...)
        Slip pole, 1/s, and lag, s.
    delay : int
        Number of samples.
    factor : ndarray, shape (...)
        The stiffness that the gains are scaled by over the true one, dimensionless.

    Returns
    -------
    A, E, C : ndarray
        ``x+ = A*x + E*w``, ``z = C*x``, dimensionless.
    """
    loop = slip_loop(pole, lag, design.period, delay, design.delays[1])
    feedback = np.zeros((*np.shape(pole), design.n_states))
    feedback[..., ERROR] = -gains[..., 2] * design.period * factor
    feedback[..., SLIP] = -gains[..., 0] * factor
    feedback[..., TORQUE] = -gains[..., 1]
    feedback[..., FIRST_COMMAND:] = -gains[..., 3:]
    A = loop.A + loop.B[..., :, None] * feedback[..., None, :]
    C = np.zeros((*np.shape(pole), 2, design.n_states))
    C[..., 0, ERROR] = design.period / design.error_time
    # The effort counts in the scale that the controller goes by.
    C[..., 1, :] = design.effort * feedback / factor[..., None]
    return A, loop.E, C


def check(certificate: Certificate, density: int = 1) -> Margins:
    """Check the inequalities of a certificate, by nothing but its numbers.

    Parameters
    ----------
    certificate : Certificate
        What to check.
    density : int
        How many times denser than the grid of the synthesis to look, in slip pole, stiffness
        error and lag.

    Returns
    -------
    Margins
        With the least margin, at least 0; dimensionless.

    Raises
    ------
    CertificateError
        If a matrix is not positive definite or an inequality does not hold, saying where.
    """
    found = margins(certificate, density)
    if not found.least >= 0:
        raise CertificateError(
            f'the certificate does not hold: the closed-loop inequality fails {found.where} '
            f'(margin {found.least:.3g})'
        )
    return found


def margins(certificate: Certificate, density: int = 1) -> Margins:
    """Find the least margin of a certificate, of whatever sign.

    Parameters
    ----------
    certificate : Certificate
        What to look at.
    density : int
        As in `check`.

    Returns
    -------
    Margins
        The least one, dimensionless.

    Raises
    ------
    CertificateError
        If a matrix P is not positive definite, or the density is below 1.
    """
    if density < 1:
        raise CertificateError(f'density must be at least 1, got {density}')
    design = certificate.design
    P = certificate.matrices()
    least_eigenvalues = np.linalg.eigvalsh(P)[..., 0]
    if not np.all(least_eigenvalues > 0):
        k, f, d, lag_row = np.argwhere(~(least_eigenvalues > 0))[0]
        factor = math.exp(design.powers[f] * design.step)
        raise CertificateError(
            f'the certificate does not hold: the Lyapunov matrix at slip pole '
            f'{design.poles[k]:.4g} 1/s, stiffness taken {factor:.3g} times what it is, '
            f'delay {design.delay_range[d]} samples and lag {design.lags[lag_row]} s is not '
            f'positive definite (least eigenvalue {least_eigenvalues[k, f, d, lag_row]:.3g})'
        )
    powers = np.linspace(
        -design.error_steps, design.error_steps, 2 * design.error_steps * density + 1
    )
    shares = np.linspace(0, 1, density + 1)
    lags = np.array([design.lag_at(share) for share in shares])
    # On the grid of the synthesis a move goes over into the next cell, and the corners of each
    # cell's part count; elsewhere it stays within its cell.
    directions = (-1, 0, 1) if density == 1 else (-1, 1)
    moves = [
        np.unique(rate * design.period * np.array(directions, dtype=float))
        for rate in (design.stiffness_rate, design.rim_speed_rate, design.error_rate)
    ]
    vertices = np.array(list(itertools.product(*moves)))
    least, where, points = math.inf, '', 0
    for pole, delay in itertools.product(_dense_poles(design, density), design.delay_range):
        power, lag, pole_error, vertex = (
            part.ravel()
            for part in np.meshgrid(
                powers,
                np.arange(len(lags)),
                design.pole_errors,
                np.arange(len(vertices)),
                indexing='ij',
            )
        )
        row = lag.astype(int)
        values = _contractions(
            certificate, P[:, :, delay - design.delays[0]], pole, delay, power, lags[row],
            shares[row], pole_error, vertices[vertex.astype(int)],
        )  # fmt: skip
        points += len(values)
        worst = int(np.argmin(values)) if np.all(np.isfinite(values)) else 0
        if not values[worst] >= least:
            least = float(values[worst])
            where = (
                f'at slip pole {pole:.4g} 1/s, lag {lags[row[worst]]:.3g} s, delay {delay} '
                f'samples, stiffness taken '
                f'{math.exp(power[worst] * design.step):.3g} and pole '
                f'{pole_error[worst]:.3g} times what they are'
            )
    return Margins(least, where, points)


def _dense_poles(design: LoopDesign, density: int) -> Array:
    """Slip poles to look at: the grid, made denser, and on beyond its end."""
    count = (len(design.poles) - 1) * density + 1
    poles = np.geomspace(design.poles[0], design.poles[-1], count)
    beyond = math.ceil(math.log(design.largest_pole / design.poles[-1]) / design.step - 1e-9)
    if beyond > 0:
        further = np.geomspace(design.poles[-1], design.largest_pole, beyond * density + 1)
        poles = np.concatenate([poles, further[1:]])
    return np.asarray(poles)


def _contractions(
    certificate: Certificate,
    P: Array,
    pole: float,
    delay: int,
    power: Array,
    lag: Array,
    lag_share: Array,
    pole_error: Array,
    move: Array,
) -> Array:
    """Margins at one pole and many errors, lags and vertices of the moves, shape (k,)."""
    design = certificate.design
    step, largest = design.step, design.error_steps
    factor = np.exp(power * step)
    place = math.log(pole / design.poles[0]) / step
    at = np.clip(
        place + power + np.log(pole_error) / step + largest, 0, len(design.gain_poles) - 1.0
    )
    gains = _between(np.array(certificate.gains), at)
    performance = _between(np.array(certificate.performance), at)
    A, E, C = closed_loop(design, gains, np.full(len(at), pole), lag, delay, factor)

    last = len(design.poles) - 1.0
    now = _matrix_at(P, np.full(len(at), min(place, last)), power + largest, lag_share)
    stiffness_move, speed_move, error_move = move.T
    then = _matrix_at(
        P,
        np.clip(place + (stiffness_move - speed_move) / step, 0.0, last),
        np.clip(power + error_move / step, -largest, largest) + largest,
        lag_share,
    )
    # Torques count over a torque scale that has grown with the stiffness.
    scale = np.ones((len(at), design.n_states))
    scale[:, TORQUE:] = np.exp(-stiffness_move)[:, None]
    then = then * scale[:, :, None] * scale[:, None, :]

    root_now = np.linalg.cholesky(now)
    root_then = np.swapaxes(np.linalg.cholesky(then), 1, 2)
    back = np.swapaxes(np.linalg.inv(root_now), 1, 2)
    s = design.n_states
    if design.kind == 'hinf':
        root = np.sqrt(performance)[:, None, None]
        N = np.zeros((len(at), s + 2, s + 2))
        N[:, :s, :s] = root_then @ A @ back
        N[:, :s, s:] = root_then @ E / root
        N[:, s:, :s] = C @ back / root
        return np.asarray(1 - _largest_singular(N))
    N = np.concatenate([root_then @ A @ back, C @ back], axis=1)
    spread = np.swapaxes(root_now, 1, 2) @ E
    cost = np.sum(spread**2, axis=(1, 2))
    return np.asarray(np.minimum(1 - _largest_singular(N), 1 - cost / performance))


def _largest_singular(N: Array) -> Array:
    return np.asarray(np.sqrt(np.linalg.eigvalsh(np.swapaxes(N, 1, 2) @ N)[:, -1]))


def _between(table: Array, at: Array) -> Array:
    """Linear in between, along the first axis."""
    low = np.minimum(at.astype(int), len(table) - 2)
    share = (at - low).reshape(-1, *[1] * (table.ndim - 1))
    return np.asarray((1 - share) * table[low] + share * table[low + 1])


def _matrix_at(P: Array, at: Array, error: Array, lag_share: Array) -> Array:
    """P between the points of its grid: linear in ln p, ln f and 1/lag."""
    low = np.minimum(at.astype(int), P.shape[0] - 2)
    row = np.minimum(error.astype(int), P.shape[1] - 2)
    found = np.zeros((len(at), *P.shape[-2:]))
    shares = (at - low, error - row, lag_share)
    for corner in itertools.product((0, 1), repeat=3):
        weight = np.ones(len(at))
        for bit, share in zip(corner, shares, strict=True):
            weight = weight * (share if bit else 1 - share)
        found += weight[:, None, None] * P[low + corner[0], row + corner[1], corner[2]]
    return found
