"""PI laws: what a tractor may have today, with fixed gains, and with gains that follow the soil.

In velocity form, with the proportional part on slip alone, so that a new target makes no bump:

    du = -k_p*(change of slip) + k_i*(target - slip)*dt

The gains are those of the SIMC rules (S. Skogestad, "Simple analytic rules for model reduction
and PID controller tuning", Journal of Process Control 13, 2003, 291-309) for the slip under
torque of `traction_model.lpv.slip_dynamics`, a lag of rate -a, behind the lag of the drive
and a delay: with the half rule the model becomes one lag and a delay theta,

    k_p = tau/(K*(tau_c + theta)),   k_i = k_p/min(tau, 4*(tau_c + theta))

with K the gain, tau the lag of the model and tau_c the response time wanted.
"""

import math

from traction_controller.control.laws.law import Reading
from traction_model.lpv.slip_dynamics import slip_dynamics
from traction_model.vehicle.vehicle import GRAVITY
from traction_model.vehicle.wheel import Wheel


def simc_gains(
    a: float, b: float, lag: float, delay: float, response_time: float
) -> tuple[float, float]:
    """Gains of a PI controller of slip by the SIMC rules.

    Parameters
    ----------
    a, b : float
        Slip dynamics, 1/s, at most 0, and 1/(N*m*s), above 0.
    lag : float
        Time constant from commanded to shaft torque, s, above 0.
    delay : float
        Delay in the loop, s, at least 0.
    response_time : float
        tau_c: time constant wanted of the closed loop, s, above 0.

    Returns
    -------
    proportional, integral : float
        N*m and N*m/s.
    """
    # Times a, as slip may integrate (a = 0): then its lag is infinite and its gain with it.
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


def _checked(name: str, value: float, allowed: bool) -> float:
    if not (math.isfinite(value) and allowed):
        raise ValueError(f'{name} is out of range: {value}')
    return value


class PiLaw:
    """PI controller of slip with fixed gains.

    Parameters
    ----------
    wheel : Wheel
        The wheel.
    load : float
        Its static load, N, above 0.
    slip : float
        Slip that it is made for, at least 0 and below 1.
    lag : float
        Time constant from commanded to shaft torque, s, above 0.
    dt : float
        Nominal sampling period, s, above 0.
    proportional, integral : float, optional
        Gains as shares of the static load times radius, 1 and 1/s, above 0; the SIMC rules give
        them for `rim_speed` and `stiffness` where they are not given.
    rim_speed : float
        m/s, above 0: where the rules are applied.
    stiffness : float
        Slip stiffness there, as a share of the static load, dimensionless, above 0.
    delay, response_time : float
        As for `simc_gains`, s.

    Attributes
    ----------
    gains : tuple of float
        Gains on slip, N*m, on shaft torque, always 0 (1), and on the integral, N*m/s.

    Raises
    ------
    ValueError
        Naming the argument that is out of range.
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
        _checked('rim_speed', rim_speed, rim_speed > 0)
        _checked('stiffness', stiffness, stiffness > 0)
        _checked('delay', delay, delay >= 0)
        _checked('response_time', response_time, response_time > 0)
        self._wheel, self._mass, self._slip = wheel, load / GRAVITY, slip
        self._lag, self._delay, self._response_time = lag, delay, response_time
        gains = list(self._tuned(rim_speed, stiffness * load))
        for k, (name, given) in enumerate(
            (('proportional', proportional), ('integral', integral))
        ):
            if given is not None:
                gains[k] = _checked(name, given, given > 0) * load * wheel.radius
        self.gains: tuple[float, ...] = (gains[0], 0.0, gains[1])
        self._last: float | None = None

    def _tuned(self, rim_speed: float, stiffness: float) -> tuple[float, float]:
        """Gains by the SIMC rules at an operating point."""
        a, b = slip_dynamics(self._wheel, self._mass, rim_speed, stiffness, self._slip)
        return simc_gains(a, b, self._lag, self._delay, self._response_time)

    def reset(self) -> None:
        """Forget the slip of the last step."""
        self._last = None

    def torque(self, reading: Reading, target: float, sent: float, dt: float) -> float:
        """Find the torque of one step; see `traction_controller.control.laws.law.SlipLaw`.

        Parameters
        ----------
        reading : Reading
            The wheel as it is, SI units.
        target : float
            Slip to reach, 0.01 to 0.9.
        sent : float
            Torque that was really sent at the last step, N*m.
        dt : float
            Time since the last step, s, at least 0.

        Returns
        -------
        float
            Torque wanted, N*m, before limits.
        """
        slip = reading.slip
        torque = sent + self.gains[2] * (target - slip) * dt
        if self._last is not None:
            torque -= self.gains[0] * (slip - self._last)
        self._last = slip
        return torque


class ScheduledPiLaw(PiLaw):
    """PI controller of slip, its gains by the SIMC rules at the present speed and stiffness.

    Parameters
    ----------
    wheel : Wheel
        The wheel.
    load : float
        Its static load, N, above 0.
    slip : float
        Slip at which the model is linearised, at least 0 and below 1.
    lag : float
        Time constant from commanded to shaft torque, s, above 0.
    dt : float
        Nominal sampling period, s, above 0.
    delay, response_time : float
        As for `simc_gains`, s.

    Raises
    ------
    ValueError
        Naming the argument that is out of range.
    """

    # From walking pace to road speed, from soil that has all but failed to hard ground: where
    # the gain schedule of the LQI regulator is computed.
    _RIM_SPEEDS = (0.3, 12.0)
    _STIFFNESSES = (0.2, 50.0)

    def __init__(
        self,
        wheel: Wheel,
        load: float,
        *,
        slip: float,
        lag: float,
        dt: float,
        delay: float = 0.03,
        response_time: float = 0.15,
    ) -> None:
        super().__init__(
            wheel, load, slip=slip, lag=lag, dt=dt, delay=delay, response_time=response_time
        )
        self._load = load

    def torque(self, reading: Reading, target: float, sent: float, dt: float) -> float:
        """Find the torque of one step; see `traction_controller.control.laws.law.SlipLaw`.

        Parameters
        ----------
        reading : Reading
            The wheel as it is, SI units.
        target : float
            Slip to reach, 0.01 to 0.9.
        sent : float
            Torque that was really sent at the last step, N*m.
        dt : float
            Time since the last step, s, at least 0.

        Returns
        -------
        float
            Torque wanted, N*m, before limits.
        """
        slowest, fastest = self._RIM_SPEEDS
        softest, stiffest = self._STIFFNESSES
        proportional, integral = self._tuned(
            min(max(abs(reading.rim_speed), slowest), fastest),
            min(max(reading.stiffness, softest * self._load), stiffest * self._load),
        )
        self.gains = proportional, 0.0, integral
        return super().torque(reading, target, sent, dt)
