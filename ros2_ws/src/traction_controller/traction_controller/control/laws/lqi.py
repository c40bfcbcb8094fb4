"""Scheduled LQI: a linear-quadratic regulator with integral action at every operating point.

In velocity form every step adds

    du = -k_i*(change of slip) - k_T*(change of shaft torque) + k_z*(target - slip)*dt

to the torque last sent, with the gains of `traction_controller.synthesis.gain_schedule` at the
present rim speed and slip stiffness.
"""

from functools import lru_cache

from traction_controller.control.laws.law import SlipLaw, WheelState
from traction_controller.synthesis.gain_schedule import ControlWeights, GainSchedule
from traction_model.vehicle.vehicle import GRAVITY
from traction_model.vehicle.wheel import Wheel


@lru_cache(maxsize=64)
def shared_schedule(
    wheel: Wheel, load: float, slip: float, lag: float, dt: float, weights: ControlWeights
) -> GainSchedule:
    """Gain schedule of a wheel, shared by equal wheels under equal load.

    Parameters
    ----------
    wheel, load, slip, lag, dt, weights
        As for `GainSchedule`, SI units.

    Returns
    -------
    GainSchedule
        Computed at the first call.
    """
    return GainSchedule(wheel, load, slip, lag, dt, weights, GRAVITY)


class LqiLaw(SlipLaw):
    """Scheduled LQI regulator of slip.

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
    weights : ControlWeights
        Weights of slip, its integral and torque.

    Attributes
    ----------
    schedule : GainSchedule
        Gains, shared by equal wheels.
    gains : tuple of float
        Gains of the last step: N·m, 1, N·m/s.
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
        weights: ControlWeights = ControlWeights(),
    ) -> None:
        # Rounded, since sums of the same loads may differ in the last digits.
        self.schedule = shared_schedule(wheel, round(load, 6), slip, lag, dt, weights)
        self._last: tuple[float, float] | None = None

    def reset(self) -> None:
        """Reset slip and torque of the last step."""
        self._last = None

    def torque(self, state: WheelState, target: float, sent: float, dt: float) -> float:
        """Compute the torque of one step, see `SlipLaw.torque`."""
        self.gains = self.schedule.at(state.rim_speed, state.stiffness)
        slip_gain, torque_gain, integral_gain = self.gains
        slip, shaft = state.slip, state.shaft_torque
        torque = sent + integral_gain * (target - slip) * dt
        if self._last is not None:
            last_slip, last_shaft = self._last
            torque -= slip_gain * (slip - last_slip) + torque_gain * (shaft - last_shaft)
        self._last = slip, shaft
        return torque
