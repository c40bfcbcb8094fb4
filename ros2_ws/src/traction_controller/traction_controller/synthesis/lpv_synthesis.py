"""LPV synthesis: gains over the slip pole, and their certificate.

Step one computes the gains. For ``hinf`` one semidefinite program covers the grid of slip poles.
It has matrices X(p) at both ends of the lags, and slack matrices G and Y, so that the gains do not
depend on X (M. C. de Oliveira, J. Bernussou and J. C. Geromel, "A new discrete-time robust
stability condition", Systems & Control Letters 37, 1999):

    [ X(after every move)   A*G + B*Y    E    0            ]
    [ .                     G + G' - X   0    (C*G + D*Y)' ]  >= 0,   K = Y*inv(G)
    [ .                     .            g*I  0            ]
    [ .                     .            .    g*I          ]

For ``lqr`` the gains solve the Riccati equation at every pole. The law cannot measure the
difference between true and measured moment of the soil. The structure of G sets its gain to 0.

Step two computes the proof for the interpolated gains. In every cell of the unknown constants
(`traction_controller.synthesis.certificate`) matrices P(p) satisfy its inequality at the corners
and the centre of the cell, at every pole of the grid and between poles. The programs of the cells
are small and independent. Grids over parameters with bounds on their rates: F. Wu, X. H. Yang, A.
Packard and G. Becker, "Induced L2-norm control for LPV systems with bounded parameter variation
rates", Int. J. Robust and Nonlinear Control 6, 1996.
"""

import itertools
import math
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from traction_controller.synthesis.certificate import (
    Certificate,
    CertificateError,
    LoopDesign,
    cells,
    closed_loop,
    margins,
    moves,
)
from traction_controller.synthesis.slip_loop import ERROR, FIRST_COMMAND, MOMENT, TORQUE, slip_loop

Array = NDArray[np.float64]

# Distance of matrices from the boundary of the constraints.
_EDGE = 1e-7
# Extra decrease of V, as a share of its root, and number of parts of a grid step at which it is
# required, so that V decreases between grid points, too.
_KEPT = 0.008
_PARTS = 3
# Loss of performance accepted for the same reason.
_RELAXED = 1.05
# Scale of torques for a slip error of 1, so that the numbers in the solver are near 1.
_TORQUE_SIZE = 3.0


class SynthesisError(RuntimeError):
    """No gains were found; the text has the reason and a remedy."""


def synthesize(
    design: LoopDesign, progress: Callable[[str, float], None] | None = None
) -> Certificate:
    """Compute gains and their certificate.

    Parameters
    ----------
    design : LoopDesign
        Design data.
    progress : callable, optional
        Called with the name of the present step and the share done, 0 to 1.

    Returns
    -------
    Certificate
        Its inequalities hold on the grid; `traction_controller.synthesis.certificate.check` checks
        between grid points. Its performance is dimensionless.

    Raises
    ------
    SynthesisError
        If cvxpy is not installed, the problem is infeasible, or the solver fails.
    """
    report = progress or (lambda text, share: None)
    report('finding gains', 0.0)
    gains = _rounded(_hinf_gains(design) if design.kind == 'hinf' else _lqr_gains(design))
    row, column = np.triu_indices(design.n_states)
    performance = np.zeros(design.grid)
    everywhere = list(cells(design))
    packed = np.empty(
        (
            len(design.delay_range), design.lag_cells, design.error_cells, design.grid, len(row)
        )
    )  # fmt: skip
    for k, (index, delay, lags, factors) in enumerate(everywhere):
        report('proving', (k + 1) / (len(everywhere) + 1))
        found, P = _proof(design, gains, delay, lags, factors)
        performance = np.maximum(performance, found)
        packed[index] = P[:, row, column]
    certificate = Certificate(
        design=design,
        gains=gains.tolist(),
        performance=_rounded(_RELAXED * performance).tolist(),
        # A larger V allows a larger z.
        lyapunov=_rounded(
            packed if design.kind == 'hinf' else packed * math.sqrt(_RELAXED)
        ).tolist(),
    )
    try:
        found_margins = margins(certificate)
    except CertificateError as error:
        raise SynthesisError(f'the solver was not accurate enough: {error}') from error
    if found_margins.least < 0:
        raise SynthesisError(
            f'the inequalities do not hold {found_margins.where} (margin '
            f'{found_margins.least:.3g}): take more cells or a finer grid'
        )
    return certificate


def _rounded(values: Array) -> Array:
    """Round to nine digits, enough for the proof and short enough for readable files."""
    size = 10.0 ** (8 - np.floor(np.log10(np.maximum(np.abs(values), 1e-300))))
    return np.asarray(np.round(values * size) / size)


def _cvxpy() -> Any:
    """Import cvxpy on demand: it takes most of a second and only synthesis needs it."""
    try:
        import cvxpy
    except ImportError as error:
        raise SynthesisError('synthesis needs cvxpy: pip install cvxpy clarabel') from error
    return cvxpy


def _open_loop(design: LoopDesign, pole: float, lag: float) -> tuple[Array, Array, Array, Array]:
    """A, B, E and sizes of states at the mean delay, torques over G and the torque factor."""
    delay = (design.delays[0] + design.delays[1]) // 2
    loop = slip_loop(pole, lag, design.period, delay, design.delays[1], design.moment_time)
    size = np.ones(design.n_states)
    size[TORQUE:] = design.torque_factor(np.array(pole))
    A = loop.A * size / size[:, None]
    # The command is over G and the torque factor, too.
    B = (loop.B / size * size[TORQUE])[:, None]
    E = loop.E / size[:, None]
    E[:, 0] *= size[MOMENT]
    return A, B, E, size


def _weights(design: LoopDesign) -> tuple[float, float]:
    """Weights of slip error and command in z."""
    return (
        math.sqrt(design.period / design.response_time),
        design.effort * math.sqrt(design.period * design.response_time),
    )


def _as_gains(design: LoopDesign, K: Array) -> Array:
    """Gains of a table from feedback over G and the torque factor, shape (grid, s)."""
    size = np.ones((design.grid, design.n_states))
    size[:, TORQUE:] = design.torque_factor(design.poles)[:, None]
    K = -K / size * size[:, TORQUE, None]
    return np.column_stack([K[:, ERROR], K[:, TORQUE], K[:, FIRST_COMMAND:]])


def _lqr_gains(design: LoopDesign) -> Array:
    """Gains of the Riccati equation at every pole, at the middle of lags and delays."""
    K = np.zeros((design.grid, design.n_states))
    weight, effort = _weights(design)
    for k, pole in enumerate(design.poles):
        A, B, _, _ = _open_loop(design, float(pole), sum(design.lags) / 2)
        q = np.zeros((design.n_states, design.n_states))
        q[ERROR, ERROR] = weight**2
        r = np.array([[effort**2]])
        riccati = solve_discrete_are(A, B, q + 1e-12 * np.eye(len(q)), r)
        K[k] = -np.linalg.solve(r + B.T @ riccati @ B, B.T @ riccati @ A)[0]
    K[:, MOMENT] = 0.0
    return _as_gains(design, K)


def _hinf_gains(design: LoopDesign) -> Array:
    """Gains of the semidefinite program over all poles."""
    cp = _cvxpy()
    s, grid = design.n_states, design.grid
    sizes = np.array([1.0, *[_TORQUE_SIZE] * (s - 1)])
    scaled, unscaled = np.diag(sizes), np.diag(1 / sizes)
    X = [[cp.Variable((s, s), symmetric=True) for _ in range(grid)] for _ in design.lags]
    known = [k for k in range(s) if k != MOMENT]
    to_known, to_moment = np.eye(s)[:, known], np.eye(s)[:, [MOMENT]]
    performance = cp.Variable(grid)
    weight, effort = _weights(design)
    weighed = np.zeros((2, s))
    weighed[0, ERROR] = weight
    pushed = np.array([[0.0], [effort]])
    constraints = []
    solved = []
    for k, pole in enumerate(design.poles):
        G = to_known @ cp.Variable((s - 1, s - 1)) @ to_known.T
        G = G + to_moment @ cp.Variable((1, s))
        Y = cp.Variable((1, s - 1))
        solved.append((G, Y))
        command = Y @ to_known.T
        places = np.array([float(k)])
        for X_lag, lag in zip(X, design.lags, strict=True):
            A, B, E, _ = _open_loop(design, float(pole), lag)
            A, B, E = unscaled @ A @ scaled, unscaled @ B, unscaled @ E
            L = cp.Variable((s, s), symmetric=True)
            for there, scale in moves(design, places):
                # X is the inverse of P: it grows when P shrinks.
                size = np.ones(s)
                size[TORQUE:] = 1 / scale[0]
                moved = np.diag(size) @ _at(X_lag, float(there[0])) @ np.diag(size)
                constraints.append(moved - L >> 0)
            closed = A @ G + B @ command
            output = weighed @ scaled @ G + pushed @ command
            none, past = np.zeros((s, 2)), np.zeros((2, 2))
            disturbed = performance[k] * np.eye(2)
            inequality = cp.bmat(
                [
                    [L, closed, E, none],
                    [closed.T, G + G.T - X_lag[k], none, output.T],
                    [E.T, none.T, disturbed, past],
                    [none.T, output, past, disturbed],
                ]
            )
            constraints.append(inequality >> _EDGE * np.eye(inequality.shape[0]))
    _solve(cp, cp.sum(performance) / grid, constraints)
    K = np.zeros((grid, s))
    for k, (G, Y) in enumerate(solved):
        inner = to_known.T @ G.value @ to_known
        K[k, known] = np.linalg.solve(inner.T, Y.value[0])
    return _as_gains(design, K @ unscaled)


def _proof(
    design: LoopDesign, gains: Array, delay: int, lags: Array, factors: Array
) -> tuple[Array, Array]:
    """Performance (grid,) and P (grid, s, s) in one cell."""
    cp = _cvxpy()
    s, grid = design.n_states, design.grid
    P = [cp.Variable((s, s), symmetric=True) for _ in range(grid)]
    performance = cp.Variable(grid)
    sizes = np.array([1.0, *[_TORQUE_SIZE] * (s - 1)])
    scaled, unscaled = np.diag(sizes), np.diag(1 / sizes)
    middle = 2 / (1 / lags[0] + 1 / lags[1]), math.sqrt(factors[0] * factors[1])
    corners = [middle, *itertools.product(lags, factors)]
    constraints = []
    for place in np.linspace(0, grid - 1, _PARTS * (grid - 1) + 1):
        here, weight = _at(P, float(place)), _at(performance, float(place))
        U = cp.Variable((s, s), symmetric=True)
        for there, scale in moves(design, np.array([place])):
            size = np.ones(s)
            size[TORQUE:] = scale[0]
            constraints.append(U - np.diag(size) @ _at(P, float(there[0])) @ np.diag(size) >> 0)
        kept = (1 - _KEPT) ** 2 * here
        for lag, factor in corners:
            A, E, C = closed_loop(
                design, gains, np.array(place), np.array(lag), delay, np.array(factor)
            )
            A, E, C = unscaled @ A @ scaled, unscaled @ E, C @ scaled
            if design.kind == 'hinf':
                square = np.zeros((2, 2))
                inequality = cp.bmat(
                    [
                        [kept - A.T @ U @ A, -A.T @ U @ E, C.T],
                        [-E.T @ U @ A, weight * np.eye(2) - E.T @ U @ E, square],
                        [C, square, weight * np.eye(2)],
                    ]
                )
            else:
                inequality = kept - A.T @ U @ A - C.T @ C
                constraints += [column @ here @ column <= weight for column in E.T]
            constraints.append(inequality >> _EDGE * np.eye(inequality.shape[0]))
    _solve(cp, cp.sum(performance) / grid, constraints)
    found = unscaled @ np.array([matrix.value for matrix in P]) @ unscaled
    return np.asarray(performance.value), found


def _solve(cp: Any, objective: Any, constraints: list[Any]) -> None:
    """Minimise; raises SynthesisError with the reason."""
    problem = cp.Problem(cp.Minimize(objective), constraints)
    try:
        with warnings.catch_warnings():
            # The check decides on inaccurate solutions; it does not depend on the solver.
            warnings.filterwarnings('ignore', message='Solution may be inaccurate')
            problem.solve(
                solver=cp.CLARABEL,
                tol_gap_abs=1e-5,
                tol_gap_rel=1e-5,
                tol_feas=1e-7,
                accept_unknown=True,
            )
    except cp.error.SolverError as error:
        raise SynthesisError(
            'the solver gave up (numerical trouble): ask for a slower response, or less'
        ) from error
    if problem.status in (cp.INFEASIBLE, cp.INFEASIBLE_INACCURATE):
        raise SynthesisError(
            'no gains stand all that was asked for: take a longer response time, or lower the '
            'stiffness error, the range of lags, the delay or the rates'
        )
    if problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
        raise SynthesisError(f'the solver gave up: {problem.status}')


def _at(values: Any, place: float) -> Any:
    """Interpolate variables linearly at a fractional index."""
    low = min(int(place), _length(values) - 2)
    share = place - low
    if share < 1e-12:
        return values[low]
    return (1 - share) * values[low] + share * values[low + 1]


def _length(values: Any) -> int:
    return len(values) if isinstance(values, list) else int(values.shape[0])
