"""PI law with scheduled gains: the SIMC rules at the operating point of each step.

Law and rules are those of `traction_controller.control.laws.pi`.
"""

from traction_controller.control.laws.law import WheelState
from traction_controller.control.laws.pi import PiLaw
from traction_model.vehicle.wheel import Wheel


class ScheduledPiLaw(PiLaw):
    """PI controller of slip with gains by the SIMC rules at the present speed and stiffness.

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
        If an argument is out of range.
    """

    # From walking pace to road speed, from soil near failure to hard ground, as in the gain
    # schedule of the LQI regulator.
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

    def torque(self, state: WheelState, target: float, sent: float, dt: float) -> float:
        """Compute the torque of one step, see `SlipLaw.torque`."""
        slowest, fastest = self._RIM_SPEEDS
        softest, stiffest = self._STIFFNESSES
        proportional, integral = self.tuned(
            min(max(abs(state.rim_speed), slowest), fastest),
            min(max(state.stiffness, softest * self._load), stiffest * self._load),
        )
        self.gains = proportional, 0.0, integral
        return super().torque(state, target, sent, dt)
