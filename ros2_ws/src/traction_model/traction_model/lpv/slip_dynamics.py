"""Slip of one wheel under torque, linearised at an operating point, for the synthesis of gains.

It is the row of slip in `traction_model.lpv.slip_model.SlipLpvModel` for one driven wheel. Speed,
sinkage, motion resistance and drawbar are disturbances, so slip is the only state. The synthesis
of slip control (`traction_controller.synthesis`) uses this model, not a model of the vehicle.
"""

import math

from traction_model.vehicle.wheel import Wheel


def slip_dynamics(
    wheel: Wheel, mass: float, rim_speed: float, slip_stiffness: float, slip: float
) -> tuple[float, float]:
    """Linear model of slip under torque at one operating point.

    From ``i = 1 - v/(r*omega)`` and the equations of motion,

        i' = [-(F - R - D)/m + (1 - i)*r*(T - b_f*omega - M)/J] / (r*omega)

    and, with ``M = r*F`` and the slip stiffness ``C = dF/di``, for small changes

        i' = a*i + b*T,   a = -C*(1/m + (1 - i)*r^2/J)/(r*omega),   b = (1 - i)/(J*omega)

    so that rho = (r*omega, C) schedules both: b changes tenfold with speed.

    Parameters
    ----------
    wheel : Wheel
        The wheel.
    mass : float
        Mass moved by the wheel, kg, above 0.
    rim_speed : float
        r*omega, m/s, above 0.
    slip_stiffness : float
        C = dF/di, N, at least 0.
    slip : float
        Slip at the operating point when driving, at least 0 and below 1.

    Returns
    -------
    a, b : float
        1/s and 1/(N·m·s): ``i' = a*i + b*T`` for changes from the operating point.

    Raises
    ------
    ValueError
        If an argument is out of range.
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
