"""PI law with fixed gains, a common controller of tractors today.

Velocity form with the proportional part on slip alone, so a new target causes no jump of torque:

    du = -k_p*(change of slip) + k_i*(target - slip)*dt

The gains are those of the SIMC rules (S. Skogestad, "Simple analytic rules for model reduction
and PID controller tuning", Journal of Process Control 13, 2003, 291-309) for the slip under
torque of `traction_model.lpv.slip_dynamics`, a lag of rate -a, behind the lag of the drive
and a delay: with the half rule the model becomes one lag and a delay theta,

    k_p = tau/(K*(tau_c + theta)),   k_i = k_p/min(tau, 4*(tau_c + theta))

with K the gain and tau the lag of the model, and tau_c the desired response time.
"""

import math

from traction_controller.control.laws.law import SlipLaw, WheelState
from traction_model.lpv.slip_dynamics import slip_dynamics
from traction_model.vehicle.vehicle import GRAVITY
from traction_model.vehicle.wheel import Wheel
from traction_node.positive import check_positive


def simc_gains(
    a: float, b: float, lag: float, delay: float, response_time: float
) -> tuple[float, float]:
    """Gains of a PI controller of slip by the SIMC rules.

    Parameters
    ----------
    a, b : float
        Slip dynamics, 1/s, at most 0, and 1/(N·m·s), above 0.
    lag : float
        Time constant from commanded to shaft torque, s, above 0.
    delay : float
        Delay in the loop, s, at least 0.
    response_time : float
        tau_c: desired time constant of the closed loop, s, above 0.

    Returns
    -------
    proportional, integral : float
        N·m and N·m/s.
    """
    # Multiplied by a: for an integrating plant (a = 0) lag and gain are infinite.
    if -a * lag < 1.0:
        # Slip is the slower lag: tau = -1/a + lag/2, K = -b/a.
        delay += lag / 2
        scaled = 1.0 - a * lag / 2
        time = math.inf if a == 0.0 else -1.0 / a + lag / 2
    else:
        delay -= 1.0 / a / 2
        scaled = 0.5 - a * lag
        time = lag - 1.0 / a / 2
    proportional = scaled / (b * (response_time + delay))
    return proportional, proportional / min(time, 4 * (response_time + delay))


class PiLaw(SlipLaw):
    """PI controller of slip with fixed gains.

    Parameters
    ----------
    wheel : Wheel
        The wheel.
    load : float
        Its static load, N, above 0.
    slip : float
        Slip at the operating point, at least 0 and below 1.
    lag : float
        Time constant from commanded to shaft torque, s, above 0.
    dt : float
        Nominal sampling period, s, above 0.
    proportional, integral : float, optional
        Gains over static load times radius, 1 and 1/s, above 0; by default from the SIMC rules
        at `rim_speed` and `stiffness`.
    rim_speed : float
        Rim speed for the SIMC rules, m/s, above 0.
    stiffness : float
        Slip stiffness for the SIMC rules, over static load, dimensionless, above 0.
    delay, response_time : float
        As for `simc_gains`, s.

    Attributes
    ----------
    gains : tuple of float
        Gains on slip, N·m, on shaft torque, always 0 (1), and on the integral, N·m/s.

    Raises
    ------
    ValueError
        If an argument is out of range.
    """

    velocity_form = True

    def __init__(
        self,
        wheel: Wheel,
        load: float,
        *,
        slip: float,
        lag: float,
        dt: float,
        proportional: float | None = None,
        integral: float | None = None,
        rim_speed: float = 1.0,
        stiffness: float = 1.0,
        delay: float = 0.03,
        response_time: float = 0.15,
    ) -> None:
        check_positive(rim_speed=rim_speed, stiffness=stiffness, response_time=response_time)
        if not (math.isfinite(delay) and delay >= 0):
            raise ValueError(f'delay must be at least 0, got {delay}')
        self._wheel, self._mass, self._slip = wheel, load / GRAVITY, slip
        self._lag, self._delay, self._response_time = lag, delay, response_time
        gains = list(self.tuned(rim_speed, stiffness * load))
        for k, (name, given) in enumerate(
            (('proportional', proportional), ('integral', integral))
        ):
            if given is not None:
                check_positive(**{name: given})
                gains[k] = given * load * wheel.radius
        self.gains = (gains[0], 0.0, gains[1])
        self._last: float | None = None

    def tuned(self, rim_speed: float, stiffness: float) -> tuple[float, float]:
        """Gains by the SIMC rules at an operating point.

        Parameters
        ----------
        rim_speed : float
            r*omega, m/s, above 0.
        stiffness : float
            Slip stiffness, N, at least 0.

        Returns
        -------
        proportional, integral : float
            N·m and N·m/s.
        """
        a, b = slip_dynamics(self._wheel, self._mass, rim_speed, stiffness, self._slip)
        return simc_gains(a, b, self._lag, self._delay, self._response_time)

    def reset(self) -> None:
        """Reset the slip of the last step."""
        self._last = None

    def torque(self, state: WheelState, target: float, sent: float, dt: float) -> float:
        """Compute the torque of one step, see `SlipLaw.torque`."""
        torque = sent + self.gains[2] * (target - state.slip) * dt
        if self._last is not None:
            torque -= self.gains[0] * (state.slip - self._last)
        self._last = state.slip
        return torque
