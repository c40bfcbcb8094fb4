"""Wheel outcome: the torque that slip control gives a wheel, and what it says of it."""

from dataclasses import dataclass
from enum import IntFlag

from traction_controller.control.exit_reason import ExitReason, LimitStatus

NO_GAINS: tuple[float, ...] = (0.0, 0.0, 0.0)
"""Gains of a wheel that no law acts on: N·m, 1, N·m/s."""


class Degraded(IntFlag):
    """Measurements that a wheel is controlled without, numbered as in ControllerState."""

    NONE = 0
    RADAR = 1
    TACHOMETER = 2
    SHAFT_TORQUE = 4

    @property
    def words(self) -> str:
        """Names of what is missing as a text."""
        missing = [str(flag.name).lower().replace('_', ' ') for flag in Degraded if flag & self]
        return f'without {", ".join(missing)}' if missing else 'nothing is missing'


@dataclass
class WheelOutcome:
    """Torque of one wheel in the last step, and what led to it.

    Attributes
    ----------
    torque : float
        Commanded torque, N·m, forward positive.
    limit_status : LimitStatus
        Whether and by what the torque is limited.
    exit_reason : ExitReason
        Why the wheel is not under slip control; ALL_CLEAR when it is.
    degraded : Degraded
        Measurements that are missing.
    slip_target : float
        Slip target acted on, dimensionless: lower than the one given while speed is not measured.
    gains : tuple of float
        Gains on slip (N·m), shaft torque (1) and integral (N·m/s), and what else the law has.
    """

    torque: float = 0.0
    limit_status: LimitStatus = LimitStatus.NOT_AVAILABLE
    exit_reason: ExitReason = ExitReason.REMOTE_COMMAND_TIMEOUT
    degraded: Degraded = Degraded.NONE
    slip_target: float = 0.0
    gains: tuple[float, ...] = NO_GAINS
