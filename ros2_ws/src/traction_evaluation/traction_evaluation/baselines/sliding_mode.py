"""Sliding mode: equivalent torque from the estimated gross traction, and a boundary layer.

The surface is the slip error ``s = slip - target``. On it slip does not change: with the vehicle's
own acceleration small against that of the wheel, torque must balance the soil,
``T_eq = r*F + b_f*omega``, F the estimated gross traction. Off it the torque is reduced or raised
by the reach eta, in proportion within the boundary layer phi (J.-J. E. Slotine and W. Li, Applied
Nonlinear Control, 1991, chapter 7):

    T = T_eq - eta*sat(s/phi)

As the gross traction follows the torque that was really delivered, the law can neither wind up
nor be left with an error of slip: on a steady surface T_eq is the torque itself.
"""

from traction_controller.control.laws.law import (
    SlipLaw,
    Takeover,
    WheelState,
    checked,
    soil_moment,
)
from traction_model.vehicle.wheel import Wheel


class SlidingModeLaw(SlipLaw):
    """Sliding-mode controller of slip.

    Parameters
    ----------
    wheel : Wheel
        The wheel.
    load : float
        Its static load, N, above 0.
    slip : float
        Slip that it is made for; without effect, dimensionless.
    lag : float
        Time constant from commanded to shaft torque, s; without effect.
    dt : float
        Nominal sampling period, s; without effect.
    reach : float
        eta as a share of the static load times radius, dimensionless, above 0.
    boundary_layer : float
        phi, slip error at which the reach is used to the full, above 0.
    takeover_time : float
        Time constant with which the torque of another law gives way to this one's, s, above 0.

    Attributes
    ----------
    gains : tuple of float
        Gains on slip, N·m (0 beyond the boundary layer), shaft torque, 1, integral, N·m/s.

    Raises
    ------
    ValueError
        Naming the argument that is out of range.
    """

    velocity_form = False

    def __init__(
        self,
        wheel: Wheel,
        load: float,
        *,
        slip: float,
        lag: float,
        dt: float,
        reach: float = 0.4,
        boundary_layer: float = 0.4,
        takeover_time: float = 0.2,
    ) -> None:
        self._wheel = wheel
        self._reach = checked('reach', reach) * load * wheel.radius
        self._layer = checked('boundary_layer', boundary_layer)
        self._takeover = Takeover(takeover_time)

    def reset(self) -> None:
        """Forget the past: the next step takes over whatever torque was sent."""
        self._takeover.reset()

    def torque(self, state: WheelState, target: float, sent: float, dt: float) -> float:
        """Find the torque of one step, see `SlipLaw.torque`."""
        error = (target - state.slip) / self._layer
        inside = -1.0 < error < 1.0
        self.gains = (self._reach / self._layer if inside else 0.0, 0.0, 0.0)
        torque = soil_moment(self._wheel, state) + self._reach * min(max(error, -1.0), 1.0)
        return self._takeover.torque(torque, sent, dt)
