"""Sliding mode: equivalent torque from the estimated gross traction, and a boundary layer.

The sliding surface is zero slip error, ``s = slip - target``. On it slip is constant. The
acceleration of the vehicle is small against that of the wheel, so the equivalent torque balances
the soil: ``T_eq = r*F + b_f*omega``, with F the estimated gross traction. Off the surface the
reach eta is added or subtracted, in proportion to s within the boundary layer phi (J.-J. E.
Slotine and W. Li, Applied Nonlinear Control, 1991, chapter 7):

    T = T_eq - eta*sat(s/phi)

Gross traction follows the delivered torque. So the law has no windup and no steady-state error: in
steady motion on the surface T_eq equals the torque.
"""

from traction_controller.control.laws.law import (
    SlipLaw,
    Takeover,
    WheelState,
    soil_moment,
)
from traction_model.vehicle.wheel import Wheel
from traction_node.positive import check_positive


class SlidingModeLaw(SlipLaw):
    """Sliding-mode controller of slip.

    Parameters
    ----------
    wheel : Wheel
        The wheel.
    load : float
        Its static load, N, above 0.
    slip : float
        Slip at the operating point; without effect, dimensionless.
    lag : float
        Time constant from commanded to shaft torque, s; without effect.
    dt : float
        Nominal sampling period, s; without effect.
    reach : float
        eta over static load times radius, dimensionless, above 0.
    boundary_layer : float
        phi, slip error with the full reach, above 0.
    takeover_time : float
        Time constant of the bumpless transfer from another law, s, above 0.

    Attributes
    ----------
    gains : tuple of float
        Gains on slip, N·m (0 beyond the boundary layer), shaft torque, 1, integral, N·m/s.

    Raises
    ------
    ValueError
        If an argument is out of range.
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
        check_positive(reach=reach, boundary_layer=boundary_layer)
        self._reach = reach * load * wheel.radius
        self._layer = boundary_layer
        self._takeover = Takeover(takeover_time)

    def reset(self) -> None:
        """Reset: the next step starts from the torque sent."""
        self._takeover.reset()

    def torque(self, state: WheelState, target: float, sent: float, dt: float) -> float:
        """Compute the torque of one step, see `SlipLaw.torque`."""
        error = (target - state.slip) / self._layer
        inside = -1.0 < error < 1.0
        self.gains = (self._reach / self._layer if inside else 0.0, 0.0, 0.0)
        torque = soil_moment(self._wheel, state) + self._reach * min(max(error, -1.0), 1.0)
        return self._takeover.torque(torque, sent, dt)
