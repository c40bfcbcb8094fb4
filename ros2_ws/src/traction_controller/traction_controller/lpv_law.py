"""LPV law: the certified gains of a synthesised table, in velocity form.

Every step adds

    du = -k_i*(change of slip) - k_T*(change of shaft torque)
         - sum_k k_u[k]*(change of command k + 1 steps ago) + k_z*(target - slip)*dt

to the torque last sent, with the table's gains at the present rim speed and slip stiffness. The
commands of the last steps are states of the model behind the table: what delay holds back.
"""

from typing import Protocol

from traction_controller.control_law import Reading
from traction_model.wheel import Wheel


class Gains(Protocol):
    """A table of gains over rim speed and slip stiffness."""

    def at(self, rim_speed: float, stiffness: float) -> tuple[float, ...]:
        """Look the gains up.

        Parameters
        ----------
        rim_speed : float
            r*omega, m/s; its magnitude counts.
        stiffness : float
            Slip stiffness, N, at least 0.

        Returns
        -------
        tuple of float
            Gain on slip, N*m, on shaft torque, 1, on the integral of the slip error, N*m/s, and
            on the command of one step ago, of two, and so on, 1.
        """


class LpvLaw:
    """Regulator of slip with the gains of a table.

    Parameters
    ----------
    wheel : Wheel
        The wheel.
    load : float
        Its static load, N, above 0.
    slip, lag, dt : float
        As for every law, dimensionless, s and s; the table has been made for its own.
    gain_table : Gains
        The table.

    Attributes
    ----------
    gains : tuple of float
        Gains of the last step as the table gave them: N*m, 1, N*m/s, 1.
    """

    def __init__(
        self,
        wheel: Wheel,
        load: float,
        *,
        slip: float,
        lag: float,
        dt: float,
        gain_table: Gains | None = None,
    ) -> None:
        if gain_table is None:
            raise ValueError("control law 'lpv' needs a gain table: give gain_table")
        self._table = gain_table
        self.gains: tuple[float, ...] = (0.0, 0.0, 0.0)
        self.reset()

    def reset(self) -> None:
        """Forget the last steps: commands count as constant before the next."""
        self._last: tuple[float, float] | None = None
        # Torques sent, the newest first.
        self._sent: list[float] = []

    def torque(self, reading: Reading, target: float, sent: float, dt: float) -> float:
        """Find the torque of one step; see `traction_controller.control_law.SlipLaw`.

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
        self.gains = gains = self._table.at(reading.rim_speed, reading.stiffness)
        slip, shaft = reading.slip, reading.shaft_torque
        torque = sent + gains[2] * (target - slip) * dt
        history = self._sent
        history.insert(0, sent)
        if self._last is not None:
            last_slip, last_shaft = self._last
            torque -= gains[0] * (slip - last_slip) + gains[1] * (shaft - last_shaft)
            for k in range(min(len(gains) - 3, len(history) - 1)):
                torque -= gains[3 + k] * (history[k] - history[k + 1])
        del history[len(gains) - 2 :]
        self._last = slip, shaft
        return torque
