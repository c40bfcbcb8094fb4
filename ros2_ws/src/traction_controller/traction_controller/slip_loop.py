"""The slip loop that gains are designed for: one wheel, its drive's lag and delay, sampled.

Small changes of slip i and shaft torque T at rim speed V and slip stiffness C follow
`traction_model.lpv.slip_dynamics`. Counted in the torque that a slip takes in steady motion,
``T = S*q`` with ``S = -a/b``, they are

    i' = p*(q - i),   q' = (u - q)/lag,   p = -a

so that rim speed, stiffness and wheel enter in two numbers only: the slip pole p, which shapes
the loop, and the torque scale S, which all torques are multiplied by. Gains need a grid over p
alone, and one grid serves all wheels.

The loop is taken in velocity form: its state is the slip error and the changes, from sample to
sample, of slip, torque and the commands under way. That is the plant linearised along its
trajectory (D. J. Leith and W. E. Leithead, "Gain-scheduled controller design: an analytic
framework directly incorporating non-equilibrium plant dynamics", Int. J. Control 70, 1998), not
only around points of rest, and the controller's law is a constant matrix on it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_model.lpv import slip_dynamics
from traction_model.wheel import Wheel

Array = NDArray[np.float64]

ERROR, SLIP, TORQUE, FIRST_COMMAND = range(4)
"""The state: slip error i - target; changes of slip and torque; then of the commands sent 1, 2,
... samples ago. Slips and torques over the torque scale, dimensionless."""

PLACE, TARGET = range(2)
"""The disturbances, both as changes from sample to sample, dimensionless: what the soil does, as
the slip that it would lead to in steady motion; the target."""


class SlipLoop(NamedTuple):
    """The sampled loop ``x+ = A*x + B*u + E*w``, u the change of command.

    Attributes
    ----------
    A : ndarray, shape (..., s, s)
        State matrix, dimensionless; s is 3 and the commands held.
    B : ndarray, shape (..., s)
        Input vector, dimensionless.
    E : ndarray, shape (..., s, 2)
        What the disturbances do, dimensionless.
    """

    A: Array
    B: Array
    E: Array


def slip_pole(wheel: Wheel, mass: float, rim_speed: float, stiffness: float, slip: float) -> float:
    """Slip pole p of a wheel at an operating point.

    Parameters
    ----------
    wheel : Wheel
        The wheel.
    mass : float
        Mass that it propels, kg, above 0.
    rim_speed : float
        r*omega, m/s, above 0.
    stiffness : float
        Slip stiffness C, N, at least 0.
    slip : float
        Slip, at least 0 and below 1.

    Returns
    -------
    float
        p, 1/s: ``C*(1/m + (1 - i)*r^2/J)/V``.
    """
    return -slip_dynamics(wheel, mass, rim_speed, stiffness, slip)[0]


def torque_scale(wheel: Wheel, mass: float, stiffness: float, slip: float) -> float:
    """Torque per slip in steady motion.

    Parameters
    ----------
    wheel : Wheel
        The wheel.
    mass : float
        Mass that it propels, kg, above 0.
    stiffness : float
        Slip stiffness C, N, at least 0.
    slip : float
        Slip, at least 0 and below 1.

    Returns
    -------
    float
        S, N*m: ``r*C*(1 + J/(m*(1 - i)*r^2))``.
    """
    a, b = slip_dynamics(wheel, mass, 1.0, stiffness, slip)
    return -a / b


def slip_loop(
    pole: ArrayLike, lag: ArrayLike, period: float, delay: int, commands: int
) -> SlipLoop:
    """Sample the loop exactly, commands held over the period.

    In closed form, for many operating points at a time.

    Parameters
    ----------
    pole : array_like
        Slip pole p, 1/s, at least 0.
    lag : array_like, of the shape of `pole`
        Time constant from command to shaft torque, s, above 0.
    period : float
        Sampling period, s, above 0.
    delay : int
        Samples from a command to its arrival at the drive, at least 1.
    commands : int
        Number of commands that the state holds, at least `delay`.

    Returns
    -------
    SlipLoop
        With the leading shape of `pole`; dimensionless.
    """
    p, lag = np.broadcast_arrays(np.asarray(pole, dtype=float), np.asarray(lag, dtype=float))
    h = period
    s = FIRST_COMMAND + commands
    arriving = FIRST_COMMAND + delay - 1
    slip_kept = np.exp(-p * h)
    torque_kept = np.exp(-h / lag)
    # p*(exp(-h/lag) - exp(-p*h))/(p - 1/lag), also where both rates are the same.
    apart = (p - 1 / lag) * h
    near = np.abs(apart) < 1e-9
    passed_on = p * h * torque_kept * np.where(
        near, 1 - apart / 2, -np.expm1(-apart) / np.where(near, 1.0, apart)
    )  # fmt: skip
    A = np.zeros((*p.shape, s, s))
    A[..., SLIP, SLIP] = slip_kept
    A[..., SLIP, TORQUE] = passed_on
    A[..., TORQUE, TORQUE] = torque_kept
    A[..., SLIP, arriving] = 1 - slip_kept - passed_on
    A[..., TORQUE, arriving] = 1 - torque_kept
    A[..., ERROR, :] = A[..., SLIP, :]
    A[..., ERROR, ERROR] = 1.0
    for k in range(FIRST_COMMAND, s - 1):
        A[..., k + 1, k] = 1.0
    B = np.zeros((*p.shape, s))
    B[..., FIRST_COMMAND] = 1.0
    E = np.zeros((*p.shape, s, 2))
    E[..., ERROR, PLACE] = E[..., SLIP, PLACE] = 1 - slip_kept
    E[..., ERROR, TARGET] = -1.0
    return SlipLoop(A, B, E)
