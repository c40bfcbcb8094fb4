"""LPV law: measured load torque plus feedback with the certified gains of a table.

Torque against the shaft is measured: ``M = r*F + b_f*omega`` with F the estimated gross traction,
and ``A = J*omega*v'/v`` for the acceleration of the vehicle. The rest of the shaft torque changes
the slip. The law is

    u = M + A + k_i*(target - slip) - k_T*(T - M - A) - sum_j k_u[j]*(u_j - M - A)

with T the shaft torque, u_j the torques sent j + 1 steps ago, and the gains of the table at the
present rim speed and slip stiffness. All torques in it were sent or measured, so it cannot wind
up. If the soil fails, the torque falls with the moment of the soil, independent of the estimated
stiffness.
"""

from traction_controller.control.laws.law import (
    SlipLaw,
    Takeover,
    WheelState,
    soil_moment,
)
from traction_controller.synthesis.gain_table import GainTable
from traction_model.vehicle.wheel import Wheel
from traction_node.positive import check_positive


class LpvLaw(SlipLaw):
    """Regulator of slip with the gains of a table.

    Parameters
    ----------
    wheel : Wheel
        The wheel.
    load : float
        Its static load, N, above 0.
    slip, lag, dt : float
        As for every law, dimensionless, s and s. The table has values of its own.
    gain_table : GainTable
        The table.
    takeover_time : float
        Time constant of the bumpless transfer from another law, s, above 0.
    acceleration_time : float
        Time constant of the filter of acceleration, s, above 0.

    Attributes
    ----------
    gains : tuple of float
        Gains of the last step: on slip error, N·m; on shaft torque, 1; on the integral, always
        0 N·m/s; on commands, 1.

    Raises
    ------
    ValueError
        If there is no table, or a time is out of range.
    """

    velocity_form = False

    # Smallest speed in v'/v, m/s.
    _SLOWEST = 0.3
    # Limit of the relative acceleration v'/v, 1/s.
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
        check_positive(acceleration_time=acceleration_time)
        self._acceleration_time = acceleration_time
        self.reset()

    def reset(self) -> None:
        """Reset: the next step starts from the torque sent."""
        self._takeover.reset()
        self._last_speed: float | None = None
        self._acceleration = 0.0
        # Torques sent, the newest first.
        self._sent: list[float] = []

    def torque(self, state: WheelState, target: float, sent: float, dt: float) -> float:
        """Compute the torque of one step, see `SlipLaw.torque`."""
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
