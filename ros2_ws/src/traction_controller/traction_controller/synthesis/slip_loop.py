"""Sampled slip loop for synthesis: one wheel with lag and delay of its drive.

Slip of a driving wheel: ``i' = (1 - i)/(J*omega)*(T - M - A)``, with M the torque against the
shaft (soil and bearings) and ``A = J*omega*v'/v`` the torque for the acceleration of the vehicle.
With torques over ``G = J*omega/(1 - i)``:

    i' = q - m,   q' = (c - q)/lag,   m' = p*(q - m),   p = r*C/G

with q of the shaft, c of the delayed command and m of the soil. Rim speed gives G exactly. The
uncertain slip stiffness C appears only in the slip pole p, as damping. M and A are measured, and
commands are relative to them. So every state is 0 in steady motion on any soil, and the control
law is a constant matrix on the states. This is the slip-state form of the LPV model of Agriculture
2024, 14(3), 499, with the moment of the soil as a measured disturbance. It is not linearised in
slip: the moment may have any time course, and p is the rate at which it follows slip.

The loop does not use `traction_model.lpv.model.LpvModel`. An `LpvModel` is a whole vehicle on a
given soil, with matrices exact at each scheduling vector. A certificate must hold on any soil, so
it has one wheel and a range of the slip pole p. The laws pi and lqi use only `slip_dynamics` and
`sampled` of `traction_model.lpv`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import expm

from traction_model.vehicle.wheel import Wheel

Array = NDArray[np.float64]

ERROR, TORQUE, MOMENT, FIRST_COMMAND = range(4)
"""States: slip error i - target; then, all less the measured moment m_f and over G (1/s): shaft
torque, moment of the soil, and the commands sent 1, 2, ... samples ago."""

SOIL, TARGET = range(2)
"""Disturbances: jumps of the moment of the soil over G, 1/s, and of the target."""


class SlipLoop(NamedTuple):
    """Sampled loop ``x+ = A*x + B*u + E*w``; u is the command less the measured moment.

    Attributes
    ----------
    A : ndarray, shape (..., s, s)
        State matrix, 1 and 1/s as the states; s is 3 and the number of commands.
    B : ndarray, shape (..., s)
        Input vector, 1 and 1/s as the states.
    E : ndarray, shape (..., s, 2)
        Disturbance matrix, 1 and 1/s as the states.
    """

    A: Array
    B: Array
    E: Array


def torque_scale(wheel: Wheel, rim_speed: float, slip: float) -> float:
    """Torque per rate of slip.

    Parameters
    ----------
    wheel : Wheel
        The wheel.
    rim_speed : float
        r*omega, m/s, above 0.
    slip : float
        Slip, at least 0 and below 1.

    Returns
    -------
    float
        G, N·m·s: ``J*omega/(1 - i)``.
    """
    return wheel.inertia * rim_speed / (wheel.radius * (1.0 - slip))


def slip_pole(wheel: Wheel, rim_speed: float, stiffness: float, slip: float) -> float:
    """Slip pole of a wheel at an operating point.

    Parameters
    ----------
    wheel : Wheel
        The wheel.
    rim_speed : float
        r*omega, m/s, above 0.
    stiffness : float
        Slip stiffness C, N, at least 0.
    slip : float
        Slip, at least 0 and below 1.

    Returns
    -------
    float
        p, 1/s: ``r*C/G``.
    """
    return wheel.radius * stiffness / torque_scale(wheel, rim_speed, slip)


def slip_loop(
    pole: ArrayLike, lag: ArrayLike, period: float, delay: int, commands: int, moment_time: float
) -> SlipLoop:
    """Exactly sampled loop with commands held over the period.

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
        Number of commands in the state, at least `delay`.
    moment_time : float
        Time constant of the measured moment, s, above 0.

    Returns
    -------
    SlipLoop
        Matrices with the leading shape of `pole`; 1 and 1/s.
    """
    p, lag = np.broadcast_arrays(np.asarray(pole, dtype=float), np.asarray(lag, dtype=float))
    # Slip, shaft torque, moment, measured moment, delayed command; moment not yet subtracted.
    slope = np.zeros((*p.shape, 5, 5))
    slope[..., 0, 1], slope[..., 0, 2] = 1.0, -1.0
    slope[..., 1, 1], slope[..., 1, 4] = -1 / lag, 1 / lag
    slope[..., 2, 1], slope[..., 2, 2] = p, -p
    slope[..., 3, 2], slope[..., 3, 3] = 1 / moment_time, -1 / moment_time
    kept = expm(slope * period)
    size = 4 + commands
    plain = np.zeros((*p.shape, size, size))
    plain[..., :4, :4] = kept[..., :4, :4]
    plain[..., :4, 3 + delay] = kept[..., :4, 4]
    # The command sent now is u and the measured moment.
    plain[..., 4, 3] = 1.0
    for k in range(5, size):
        plain[..., k, k - 1] = 1.0
    # Subtract the measured moment: a common shift of all torques changes no difference.
    less = np.delete(np.eye(size), 3, axis=0)
    less[1:, 3] = -1.0
    back = np.delete(np.eye(size), 3, axis=1)
    A = less @ plain @ back
    B = np.zeros((*p.shape, size - 1))
    B[..., FIRST_COMMAND] = 1.0
    E = np.stack([A[..., MOMENT], -A[..., ERROR]], axis=-1)
    return SlipLoop(A, B, E)
