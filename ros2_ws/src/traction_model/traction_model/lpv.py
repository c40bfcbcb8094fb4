"""The LPV model of slip: how slip of one wheel answers torque, scheduled by what changes it.

With slip as the state (paper, section 2.4; see ``docs/theory.md``) both slip and speed can
be controlled. From ``i = 1 - v/(r*omega)`` and the equations of motion,

    i' = [-(F - R - D)/m + (1 - i)*r*(T - b_f*omega - M)/J] / (r*omega)

and, with ``M = r*F`` and the slip stiffness ``C = dF/di``, for small changes

    i' = a*i + b*T,   a = -C*(1/m + (1 - i)*r^2/J)/(r*omega),   b = (1 - i)/(J*omega)

so that rho = (r*omega, C) schedules both: b changes tenfold with speed.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from traction_model.wheel import Wheel


def slip_dynamics(
    wheel: Wheel, mass: float, rim_speed: float, slip_stiffness: float, slip: float
) -> tuple[float, float]:
    """Linear model of slip under torque at one operating point.

    Parameters
    ----------
    wheel : Wheel
        The wheel.
    mass : float
        Mass that it propels, kg, above 0.
    rim_speed : float
        r*omega, m/s, above 0.
    slip_stiffness : float
        C = dF/di, N, at least 0.
    slip : float
        Slip at the operating point when driving, at least 0 and below 1.

    Returns
    -------
    a, b : float
        1/s and 1/(N*m*s): ``i' = a*i + b*T`` for changes from the operating point.

    Raises
    ------
    ValueError
        Naming the argument that is out of range.
    """
    for name, value, allowed in (
        ('mass', mass, mass > 0),
        ('rim_speed', rim_speed, rim_speed > 0),
        ('slip_stiffness', slip_stiffness, slip_stiffness >= 0),
        ('slip', slip, 0 <= slip < 1),
    ):
        if not (math.isfinite(value) and allowed):
            raise ValueError(f'{name} is out of range: {value}')
    r = wheel.radius
    a = -slip_stiffness * (1 / mass + (1 - slip) * r * r / wheel.inertia) / rim_speed
    b = (1 - slip) * r / (wheel.inertia * rim_speed)
    return a, b


def sampled(
    a: NDArray[np.float64], b: NDArray[np.float64], dt: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sample a linear model exactly, its input held over the period.

    Parameters
    ----------
    a : ndarray, shape (n, n)
        State matrix, 1/s.
    b : ndarray, shape (n, m)
        Input matrix, state units per input unit and second.
    dt : float
        Sampling period, s, above 0.

    Returns
    -------
    a_d : ndarray, shape (n, n)
        State matrix of the sampled model, dimensionless up to state units.
    b_d : ndarray, shape (n, m)
        Input matrix of the sampled model, state units per input unit.
    """
    n, m = b.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n] = a
    block[:n, n:] = b
    transition = expm(block * dt)
    return transition[:n, :n], transition[:n, n:]
