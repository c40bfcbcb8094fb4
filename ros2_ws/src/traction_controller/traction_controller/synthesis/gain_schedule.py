"""Gain schedule: an LQI regulator of slip at every point of a grid over the LPV model.

The model at a grid point has slip driven by shaft torque (`traction_model.lpv.slip_dynamics`),
shaft torque driven by commanded torque (a first-order lag), and the integral of the slip error:

    i' = a*i + b*T,   T' = (u - T)/tau_a,   z' = i_target - i

sampled exactly. The gains minimise the sum over samples of
``(i/i_s)^2 + (z/(i_s*t_s))^2 + (u/u_s)^2``. Between grid points gains are interpolated linearly
over the logarithms of rim speed and slip stiffness, as the model depends on their ratios.
"""

import math
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from traction_model.interpolation import GridTable
from traction_model.lpv.sampling import sampled
from traction_model.lpv.slip_dynamics import slip_dynamics
from traction_model.vehicle.wheel import Wheel
from traction_node.positive import check_positive


@dataclass(frozen=True)
class ControlWeights:
    """Weights of the regulator; all above 0.

    Attributes
    ----------
    slip : float
        i_s: slip error with the same weight as a torque of `torque`, dimensionless.
    integral_time : float
        t_s, s: time after which the integral of a slip error i_s has the same weight.
    torque : float
        u_s over static load times radius, dimensionless.
    """

    slip: float = 0.1
    integral_time: float = 0.5
    torque: float = 0.3

    def __post_init__(self) -> None:
        check_positive(**{f'weight {name}': value for name, value in asdict(self).items()})


def lqi_gains(
    a: float, b: float, lag: float, dt: float, weights: ControlWeights, torque_scale: float
) -> NDArray[np.float64]:
    """Gains of the LQI regulator at one operating point.

    Parameters
    ----------
    a, b : float
        Slip dynamics, 1/s and 1/(N·m·s).
    lag : float
        Time constant from commanded to shaft torque, s, above 0.
    dt : float
        Sampling period, s, above 0.
    weights : ControlWeights
        Weights of slip, its integral and torque.
    torque_scale : float
        u_s, N·m, above 0.

    Returns
    -------
    ndarray, shape (3,)
        Gain on slip, N·m; on shaft torque, 1; on the integral of the slip error, N·m/s:
        ``u = -k[0]*i - k[1]*T + k[2]*z``.
    """
    # Scaled by slip i_s and torque u_s, for a well-conditioned Riccati equation.
    b_scaled = b * torque_scale / weights.slip
    a_d, b_d = sampled(
        np.array([[a, b_scaled, 0.0], [0.0, -1.0 / lag, 0.0], [-1.0, 0.0, 0.0]]),
        np.array([[0.0], [1.0 / lag], [0.0]]),
        dt,
    )
    q = np.diag([1.0, 1e-9, 1.0 / weights.integral_time**2])
    r = np.array([[1.0]])
    riccati = solve_discrete_are(a_d, b_d, q, r)
    gain = np.linalg.solve(r + b_d.T @ riccati @ b_d, b_d.T @ riccati @ a_d)[0]
    per_slip = torque_scale / weights.slip
    return np.array([gain[0] * per_slip, gain[1], -gain[2] * per_slip])


class GainSchedule:
    """Gains of one wheel over rim speed and slip stiffness.

    Parameters
    ----------
    wheel : Wheel
        The wheel.
    load : float
        Its static load, N, above 0.
    slip : float
        Slip at which the model is linearised, at least 0 and below 1: the target.
    lag : float
        Time constant from commanded to shaft torque, s, above 0.
    dt : float
        Sampling period, s, above 0.
    weights : ControlWeights
        Weights of slip, its integral and torque.
    gravity : float
        m/s^2; load over gravity is the mass that the wheel propels.

    Attributes
    ----------
    rim_speeds : ndarray, shape (p,)
        Grid of rim speeds, m/s, increasing.
    stiffnesses : ndarray, shape (q,)
        Grid of slip stiffnesses, N, increasing.
    gains : ndarray, shape (p, q, 3)
        Gains at the grid points in the units of `lqi_gains`.
    """

    def __init__(
        self,
        wheel: Wheel,
        load: float,
        slip: float,
        lag: float,
        dt: float,
        weights: ControlWeights = ControlWeights(),
        gravity: float = 9.81,
    ) -> None:
        check_positive(load=load, lag=lag, dt=dt)
        # From walking pace to road speed; from soil near failure to hard ground.
        self.rim_speeds = np.geomspace(0.3, 12.0, 9)
        self.stiffnesses = load * np.geomspace(0.2, 50.0, 9)
        torque_scale = weights.torque * load * wheel.radius
        self.gains = np.empty((len(self.rim_speeds), len(self.stiffnesses), 3))
        for p, rim_speed in enumerate(self.rim_speeds):
            for q, stiffness in enumerate(self.stiffnesses):
                a, b = slip_dynamics(wheel, load / gravity, rim_speed, stiffness, slip)
                self.gains[p, q] = lqi_gains(a, b, lag, dt, weights, torque_scale)
        self._table = GridTable([np.log(self.rim_speeds), np.log(self.stiffnesses)], self.gains)

    def at(self, rim_speed: float, stiffness: float) -> tuple[float, float, float]:
        """Interpolate the gains; outside the grid the values at its edge.

        Parameters
        ----------
        rim_speed : float
            r*omega, m/s; only its magnitude matters.
        stiffness : float
            Slip stiffness, N, at least 0.

        Returns
        -------
        slip_gain, torque_gain, integral_gain : float
            N·m, 1, N·m/s.
        """
        gains = self._table.at(math.log(max(abs(rim_speed), 1e-6)), math.log(max(stiffness, 1e-6)))
        slip_gain, torque_gain, integral_gain = gains.tolist()
        return slip_gain, torque_gain, integral_gain
