"""LPV synthesis: gains over the slip pole with their certificate, by semidefinite programming.

For the loop of `traction_controller.slip_loop` on the grid of `LoopDesign`, in two steps.

**Gains.** Matrices X(p, f, lag), slack matrices G and Y at every pole that gains are scheduled
by, and lower bounds L on all that X can become within a sample:

    [ L    A*G + B*Y    E    0            ]
    [ .    G + G' - X   0    (C*G + D*Y)' ]  >= 0,    X(after every move) >= L,    K = Y*inv(G)
    [ .    .            g*I  0            ]
    [ .    .            .    g*I          ]

(`lqr` without the third row, with I in place of the last, and [W, E'; E, X] >= 0, trace(W) <= g),
the mean of g over the grid as small as can be. G takes the place of X beside A, so gains do not
depend on X, which may differ with what the controller does not know, lag and error of stiffness:
M. C. de Oliveira, J. Bernussou and J. C. Geromel, "A new discrete-time robust stability
condition", Systems & Control Letters 37, 1999; for moving parameters J. Daafouz and J. Bernussou,
"Parameter dependent Lyapunov functions for discrete time systems with time varying parametric
uncertainties", ibid. 43, 2001. Grids over the parameters and bounds on their rates as in F. Wu,
X. H. Yang, A. Packard and G. Becker, "Induced L2-norm control for LPV systems with bounded
parameter variation rates", Int. J. Robust and Nonlinear Control 6, 1996, and P. Apkarian and
R. J. Adams, "Advanced gain-scheduling techniques for uncertain systems", IEEE Trans. Control
Systems Technology 6, 1998.

**Proof.** With the gains as they are interpolated, P(p, f, lag) and upper bounds U on all that P
can become within a sample, on a finer grid and for all errors of the pole:

    [ P - A'*U*A   -A'*U*E         C'  ]
    [ .            g*I - E'*U*E    0   ]  >= 0,    P(after every move) <= U
    [ .            .               g*I ]

(`lqr`: P - A'*U*A - C'*C >= 0, trace(E'*P*E) <= g). In between, nothing is proved by either step:
`traction_controller.certificate.check` is what tells.
"""

import itertools
import math
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from traction_controller.certificate import (
    Certificate,
    CertificateError,
    LoopDesign,
    closed_loop,
    margins,
)
from traction_controller.slip_loop import ERROR, FIRST_COMMAND, SLIP, TORQUE, slip_loop
from traction_model.definition import build

Array = NDArray[np.float64]

SLIP_JOLT = 0.3
TORQUE_JOLT = 0.3
"""Size of jolts of slip and of torque that the gains are designed for, beside unit changes of
place and target, dimensionless: without them gains rest on models that fit too well."""

# Sizes that states take, so that the solver sees numbers near 1: error, changes of slip and
# torque, changes of command.
_SIZES = (5.0, 1.0, 0.5, 3.0)
# By how much matrices are kept off the edge of what is allowed.
_EDGE = 1e-6
# Margin that the proof keeps where it looks, for what is in between.
_KEPT = 0.008
# Parts of each step of the grid of poles, and of the range of lags, that the proof looks at;
# steps of the error of stiffness it halves.
_POLE_PARTS = 4
_LAG_PARTS = 6
# By how much performance is given up so that the inequalities hold in between, tried in turn.
_RELAXED = (1.003, 1.01, 1.02, 1.05, 1.1, 1.2, 1.5, 2.0)
# How many times denser than the synthesis its own look in between is.
_LOOK = 4
# Shares of the way, over ln p, from the last point of the grid to the largest pole at which the
# proof looks, too.
_BEYOND = (0.15, 0.4, 1.0)


class SynthesisError(RuntimeError):
    """No gains were found; the text says why and what to change."""


def design_for(lowest: float, highest: float, settings: dict[str, Any]) -> LoopDesign:
    """Lay the grid for a range of slip poles.

    It ends where a slip has all but settled within a period (``exp(-p*h) < 1e-3``), as the loop
    hardly changes from there on.

    Parameters
    ----------
    lowest, highest : float
        Range of the slip pole, 1/s, above 0.
    settings : dict
        Entries of `LoopDesign` but for the poles, in place of their defaults, SI units.

    Returns
    -------
    LoopDesign
        With its grid from `lowest` on.

    Raises
    ------
    DefinitionError
        Naming the entry that is unknown or out of range.
    """
    # Checked first, as the grid's step follows from them.
    checked = build(LoopDesign, {**settings, 'poles': (1.0,), 'largest_pole': 1.0}, 'design')
    top = min(highest, 7.0 / checked.period)
    steps = max(1, math.ceil(math.log(top / lowest) / checked.step - 1e-9))
    poles = [lowest * math.exp(checked.step * k) for k in range(steps + 1)]
    return checked.model_copy(
        update={'poles': tuple(poles), 'largest_pole': max(highest, poles[-1])}
    )


def synthesize(design: LoopDesign, progress: Callable[[str], None] | None = None) -> Certificate:
    """Find gains and their certificate.

    Parameters
    ----------
    design : LoopDesign
        What to design for.
    progress : callable, optional
        Told what is being done.

    Returns
    -------
    Certificate
        Which holds in between the points of the grid, too, as far as a grid four times as dense
        tells; its performance is dimensionless.

    Raises
    ------
    SynthesisError
        If cvxpy is not installed, there are no such gains, the solver gives up, or the
        inequalities do not hold in between.
    """
    tell = progress or (lambda text: None)
    tell('finding gains')
    gains = _gains(design)
    tell('finding Lyapunov matrices')
    performance, P = _proof(design, gains)
    row, column = np.triu_indices(design.n_states)
    tell('looking in between')
    for relaxed in _RELAXED:
        certificate = Certificate(
            design=design,
            gains=gains.tolist(),
            performance=(relaxed * performance).tolist(),
            # A larger V leaves room for z.
            lyapunov=(P if design.kind == 'hinf' else P * relaxed)[..., row, column].tolist(),
        )
        try:
            found = margins(certificate, 1)
            if found.least > 0:
                found = margins(certificate, _LOOK)
        except CertificateError as error:
            raise SynthesisError(f'the solver was not accurate enough: {error}') from error
        if found.least > 0:
            return certificate
    raise SynthesisError(
        f'the inequalities hold on the grid but not {found.where} (margin {found.least:.3g}): '
        'take more steps per stiffness error, or lower the stiffness or pole error'
    )


def _cvxpy() -> Any:
    """Import cvxpy: late, as it takes most of a second and only synthesis needs it."""
    try:
        import cvxpy
    except ImportError as error:
        raise SynthesisError('synthesis needs cvxpy: pip install cvxpy clarabel') from error
    return cvxpy


def _sizes(design: LoopDesign) -> Array:
    return np.array([*_SIZES, *[_SIZES[-1]] * (design.delays[1] - 1)])


def _points(design: LoopDesign) -> list[tuple[int, int, int, int]]:
    """Places in the grid of poles, stiffness errors, delays and lags."""
    counts = (len(design.poles), len(design.powers), len(design.delay_range), 2)
    return list(itertools.product(*(range(count) for count in counts)))


def _gains(design: LoopDesign) -> Array:
    """First step: gains by `gain_poles`, shape (rows, g)."""
    cp = _cvxpy()
    s, rows = design.n_states, len(design.gain_poles)
    # The extremes lead: stiffness taken for too low and too high. What is in between, and rates
    # of the error, the proof sees to.
    points = [point for point in _points(design) if point[1] in (0, len(design.powers) - 1)]
    design = design.model_copy(update={'error_rate': 0.0})
    X = {point: cp.Variable((s, s), symmetric=True) for point in points}
    G = [cp.Variable((s, s)) for _ in range(rows)]
    Y = [cp.Variable((1, s)) for _ in range(rows)]
    performance = cp.Variable(rows)
    scaled, unscaled = np.diag(_sizes(design)), np.diag(1 / _sizes(design))
    weighed = np.zeros((2, s))
    weighed[0, ERROR] = design.period / design.error_time
    weighed = weighed @ scaled
    pushed = np.array([[0.0], [design.effort]])
    jolts = np.zeros((s, 2))
    jolts[[ERROR, SLIP], 0] = SLIP_JOLT
    jolts[TORQUE, 1] = TORQUE_JOLT
    constraints = []
    for point in points:
        k, f, d, lag = point
        L = cp.Variable((s, s), symmetric=True)
        constraints += [after - L >> 0 for after in _after_moves(design, X, k, f, d, lag, 1)]
        gain = min(k + f, rows - 1)
        factor = math.exp(design.powers[f] * design.step)
        A, B, E = slip_loop(
            design.poles[k],
            design.lags[lag],
            design.period,
            design.delay_range[d],
            design.delays[1],
        )
        A = unscaled @ A @ scaled
        B = (unscaled @ B)[:, None]
        E = unscaled @ np.hstack([E, jolts])
        # The gains' own scale of torque is `factor` times the true one.
        own = np.ones(s)
        own[TORQUE:] = factor
        slack = np.diag(own) @ G[gain] @ np.diag(own)
        command = Y[gain] @ np.diag(own)
        closed = A @ slack + factor * B @ command
        output = weighed @ slack + pushed @ command
        middle = slack + slack.T - X[point]
        none, past = np.zeros((s, 2)), np.zeros((E.shape[1], 2))
        if design.kind == 'hinf':
            disturbed = performance[gain] * np.eye(E.shape[1])
            inequality = cp.bmat(
                [
                    [L, closed, E, none],
                    [closed.T, middle, np.zeros_like(E), output.T],
                    [E.T, np.zeros_like(E.T), disturbed, past],
                    [none.T, output, past.T, performance[gain] * np.eye(2)],
                ]
            )
        else:
            inequality = cp.bmat(
                [
                    [L, closed, none],
                    [closed.T, middle, output.T],
                    [none.T, output, np.eye(2)],
                ]
            )
            W = cp.Variable((E.shape[1], E.shape[1]), symmetric=True)
            constraints += [
                cp.bmat([[W, E.T], [E, X[point]]]) >> 0,
                performance[gain] >= cp.trace(W),
            ]
        constraints.append(inequality >> _EDGE * np.eye(inequality.shape[0]))
    _solve(cp, cp.sum(performance) / rows, constraints)
    K = np.array([np.linalg.solve(g.value.T, y.value[0]) for g, y in zip(G, Y, strict=True)])
    K = K @ unscaled
    return np.column_stack(
        [-K[:, SLIP], -K[:, TORQUE], -K[:, ERROR] / design.period, -K[:, FIRST_COMMAND:]]
    )


def _proof(design: LoopDesign, gains: Array) -> tuple[Array, Array]:
    """Second step: performance by `gain_poles`; P by `poles`, stiffness error, delay and lag."""
    # The delay stays as it is, so each has a proof of its own.
    found = [_proof_at(design, gains, d) for d in range(len(design.delay_range))]
    performance = np.max([performance for performance, _ in found], axis=0)
    return performance, np.stack([P for _, P in found], axis=2)


def _proof_at(design: LoopDesign, gains: Array, d: int) -> tuple[Array, Array]:
    """Performance (rows,) and P (poles, errors, 2, s, s) at one delay."""
    cp = _cvxpy()
    s, poles, errors = design.n_states, len(design.poles), len(design.powers)
    points = [point for point in _points(design) if point[2] == d]
    P = {point: cp.Variable((s, s), symmetric=True) for point in points}
    U = {point: cp.Variable((s, s), symmetric=True) for point in points}
    performance = cp.Variable(len(gains))
    scaled, unscaled = np.diag(_sizes(design)), np.diag(1 / _sizes(design))
    beyond = math.log(design.largest_pole / design.poles[-1]) / design.step
    places = [k / _POLE_PARTS for k in range(_POLE_PARTS * (poles - 1) + 1)]
    places += [poles - 1 + beyond * share for share in _BEYOND if beyond > 0]
    # Where none of these gains is used, nothing is needed.
    constraints = [performance >= 0]
    for place, error, lag in itertools.product(
        places, np.arange(0.0, errors - 0.5, 0.5), np.linspace(0.0, 1.0, _LAG_PARTS + 1)
    ):
        cell = _shares(place, poles), _shares(error, errors), d, _shares(lag, 2)
        here, later = _interpolated(P, *cell), _interpolated(U, *cell)
        moved = _after_moves(design, P, place, error, d, lag, -1)
        constraints += [later - after >> 0 for after in moved]
        kept = (1 - _KEPT) ** 2 * here
        pole = design.poles[0] * math.exp(place * design.step)
        factor = math.exp((error - design.error_steps) * design.step)
        for pole_error in design.pole_errors:
            shares = _shares(place + error + math.log(pole_error) / design.step, len(gains))
            taken = sum(share * gains[row] for share, row in shares)
            weight = sum(share * performance[row] for share, row in shares)
            A, E, C = closed_loop(
                design,
                taken,
                np.array(pole),
                np.array(design.lag_at(lag)),
                design.delay_range[d],
                np.array(factor),
            )
            A, E, C = unscaled @ A @ scaled, unscaled @ E, C @ scaled
            if design.kind == 'hinf':
                square = np.zeros((2, 2))
                inequality = cp.bmat(
                    [
                        [kept - A.T @ later @ A, -A.T @ later @ E, C.T],
                        [-E.T @ later @ A, weight * np.eye(2) - E.T @ later @ E, square],
                        [C, square, weight * np.eye(2)],
                    ]
                )
            else:
                inequality = kept - A.T @ later @ A - C.T @ C
                constraints.append(cp.trace(E.T @ here @ E) <= weight)
            constraints.append(inequality >> _EDGE * np.eye(inequality.shape[0]))
    _solve(cp, cp.sum(performance) / len(gains), constraints)
    found = unscaled @ np.array([P[point].value for point in points]) @ unscaled
    return np.asarray(performance.value), found.reshape(poles, errors, 2, s, s)


def _solve(cp: Any, objective: Any, constraints: list[Any]) -> None:
    """Minimise, or say why not."""
    problem = cp.Problem(cp.Minimize(objective), constraints)
    try:
        with warnings.catch_warnings():
            # What the solver calls inaccurate is judged by the check, which does not rest on it.
            warnings.filterwarnings('ignore', message='Solution may be inaccurate')
            problem.solve(solver=cp.CLARABEL)
    except cp.error.SolverError as error:
        raise SynthesisError(
            'the solver gave up (numerical trouble): weigh the effort more, or ask for less'
        ) from error
    if problem.status in (cp.INFEASIBLE, cp.INFEASIBLE_INACCURATE):
        raise SynthesisError(
            'no gains stand all that was asked for: lower the stiffness error, the range of '
            'lags, the delay or the rates'
        )
    if problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
        raise SynthesisError(f'the solver gave up: {problem.status}')


def _after_moves(
    design: LoopDesign,
    matrices: dict[tuple[int, int, int, int], Any],
    place: float,
    error: float,
    d: int,
    lag: float,
    sign: int,
) -> list[Any]:
    """Matrices at every vertex of the moves of a sample, in the torque scale before them.

    X, of sign 1, grows with the scale of the states, P, of sign -1, falls with it.
    """
    found: dict[tuple[float, ...], Any] = {}
    poles, errors = len(design.poles), len(design.powers)
    rates = (design.stiffness_rate, design.rim_speed_rate, design.error_rate)
    for stiffness, speed, wrong in itertools.product(*(_ends(r * design.period) for r in rates)):
        scale = np.ones(design.n_states)
        scale[TORQUE:] = math.exp(sign * stiffness)
        at = _shares(place + (stiffness - speed) / design.step, poles)
        off = _shares(error + wrong / design.step, errors)
        key = (stiffness, *itertools.chain(*at, *off))
        if key not in found:
            moved = _interpolated(matrices, at, off, d, _shares(lag, 2))
            found[key] = np.diag(scale) @ moved @ np.diag(scale)
    return list(found.values())


def _interpolated(
    matrices: dict[tuple[int, int, int, int], Any],
    at: list[tuple[float, int]],
    off: list[tuple[float, int]],
    d: int,
    between: list[tuple[float, int]],
) -> Any:
    return sum(
        a * b * c * matrices[i, j, d, k]
        for (a, i), (b, j), (c, k) in itertools.product(at, off, between)
        if a * b * c > 0
    )


def _ends(move: float) -> tuple[float, ...]:
    return (-move, move) if move else (0.0,)


def _shares(at: float, count: int) -> list[tuple[float, int]]:
    """Shares of the two points of a grid around a place, held at its ends."""
    at = min(max(at, 0.0), count - 1.0)
    low = min(int(at), count - 2)
    return [(1 - (at - low), low), (at - low, low + 1)]
