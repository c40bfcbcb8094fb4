"""Sliding mode: equivalent torque from the estimated thrust, and a boundary layer.

The surface is the slip error ``s = slip - target``. On it slip does not change, for which, with
the vehicle's own acceleration small against that of the wheel, torque must balance the soil:
``T_eq = r*F + b_f*omega``, F the estimated thrust. Off it the torque is reduced or raised by the
reach eta, in proportion within the boundary layer phi (J.-J. E. Slotine and W. Li, Applied
Nonlinear Control, 1991, chapter 7):

    T = T_eq - eta*sat(s/phi)

As the thrust follows the torque that was really delivered, the law can neither wind up nor be
left with an error of slip: on a steady surface T_eq is the torque itself.
"""

import math

from traction_controller.control.laws.law import Reading
from traction_model.vehicle.wheel import Wheel


class SlidingModeLaw:
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
        Gains on slip, N*m (0 beyond the boundary layer), shaft torque, 1, integral, N*m/s.

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
        for name, value in (
            ('reach', reach),
            ('boundary_layer', boundary_layer),
            ('takeover_time', takeover_time),
        ):
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f'{name} must be above 0, got {value}')
        self._radius, self._friction = wheel.radius, wheel.viscous_friction
        self._reach = reach * load * wheel.radius
        self._layer = boundary_layer
        self._takeover_time = takeover_time
        self.gains: tuple[float, ...] = (0.0, 0.0, 0.0)
        self.reset()

    def reset(self) -> None:
        """Forget the past: the next step takes over whatever torque was sent."""
        # What is left of the difference to the torque taken over; None before it is known.
        self._offset: float | None = None

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
        error = (target - reading.slip) / self._layer
        inside = -1.0 < error < 1.0
        self.gains = (self._reach / self._layer if inside else 0.0, 0.0, 0.0)
        equivalent = self._radius * reading.gross_traction
        equivalent += self._friction * abs(reading.rim_speed) / self._radius
        torque = equivalent + self._reach * min(max(error, -1.0), 1.0)
        if self._offset is None:
            self._offset = sent - torque
        self._offset *= math.exp(-dt / self._takeover_time)
        return torque + self._offset
