"""LPV law: the certified gains of a synthesised table, on the torque beyond what the soil takes.

What turns against the shaft is measured, ``M = r*F + b_f*omega`` with F the estimated thrust, and
so is what the vehicle's own acceleration takes, ``A = J*omega*v'/v``. Slip changes by what the
shaft has beyond them. So the law is a feedback from the slip error on top of them,

    u = M + A + k_i*(target - slip) - k_T*(T - M - A) - sum_j k_u[j]*(u_j - M - A)

T the shaft torque, u_j the torques sent j + 1 steps ago, with the table's gains at the present rim
speed and slip stiffness. It uses only torques that were really sent
and measured, so it cannot wind up. When the soil gives way, the torque falls as soon as the soil's
moment does, whatever the estimate of its stiffness.
"""

from traction_controller.control.laws.law import (
    SlipLaw,
    Takeover,
    WheelState,
    checked,
    soil_moment,
)
from traction_controller.synthesis.gain_table import GainTable
from traction_model.vehicle.wheel import Wheel


class LpvLaw(SlipLaw):
    """Regulator of slip with the gains of a table.

    Parameters
    ----------
    wheel : Wheel
        The wheel.
    load : float
        Its static load, N, above 0.
    slip, lag, dt : float
        As for every law, dimensionless, s and s; the table has been made for its own.
    gain_table : GainTable
        The table.
    takeover_time : float
        Time constant with which the torque of another law gives way to this one's, s, above 0.
    acceleration_time : float
        Time constant of the filter on the vehicle's acceleration, s, above 0.

    Attributes
    ----------
    gains : tuple of float
        Gains of the last step as the table gave them, on slip error, N·m, on shaft torque and on
        commands, 1, with 0 N·m/s in between for the integral, which there is none of.

    Raises
    ------
    ValueError
        If there is no table, or a time is out of range.
    """

    velocity_form = False

    # Below this speed, m/s, acceleration is taken as at it: slip says little there.
    _SLOWEST = 0.3
    # Largest relative acceleration v'/v that is followed, 1/s.
    _MOST = 2.0

    def __init__(
        self,
        wheel: Wheel,
        load: float,
        *,
        slip: float,
        lag: float,
        dt: float,
        gain_table: GainTable | None = None,
        takeover_time: float = 0.1,
        acceleration_time: float = 0.15,
    ) -> None:
        if gain_table is None:
            raise ValueError("control law 'lpv' needs a gain table: give gain_table")
        self._table = gain_table
        self._wheel = wheel
        self._takeover = Takeover(takeover_time)
        self._acceleration_time = checked('acceleration_time', acceleration_time)
        self.reset()

    def reset(self) -> None:
        """Forget the past: the next step takes over whatever torque was sent."""
        self._takeover.reset()
        self._last_speed: float | None = None
        self._acceleration = 0.0
        # Torques sent, the newest first.
        self._sent: list[float] = []

    def torque(self, state: WheelState, target: float, sent: float, dt: float) -> float:
        """Find the torque of one step, see `SlipLaw.torque`."""
        slip_gain, torque_gain, *command_gains = self._table.at(state.rim_speed, state.stiffness)
        self.gains = (slip_gain, torque_gain, 0.0, *command_gains)
        omega = abs(state.rim_speed) / self._wheel.radius
        acceleration = self._relative_acceleration(abs(state.speed), dt)
        base = soil_moment(self._wheel, state) + self._wheel.inertia * omega * acceleration
        history = self._sent
        history.insert(0, sent)
        del history[len(command_gains) :]
        torque = base + slip_gain * (target - state.slip)
        torque -= torque_gain * (state.shaft_torque - base)
        for gain, command in zip(command_gains, history, strict=False):
            torque -= gain * (command - base)
        return self._takeover.torque(torque, sent, dt)

    def _relative_acceleration(self, speed: float, dt: float) -> float:
        """v'/v of the vehicle, filtered, 1/s."""
        if self._last_speed is not None:
            gained = speed - self._last_speed - self._acceleration * dt
            self._acceleration += gained / (self._acceleration_time + dt)
        self._last_speed = speed
        relative = self._acceleration / max(speed, self._SLOWEST)
        return min(max(relative, -self._MOST), self._MOST)
