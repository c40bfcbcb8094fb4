"""Wheel outcome: torque of a wheel with limit status, exit reason and gains."""

from dataclasses import dataclass
from enum import IntFlag

from traction_controller.control.exit_reason import ExitReason, LimitStatus

NO_GAINS: tuple[float, ...] = (0.0, 0.0, 0.0)
"""Gains of a wheel without a law in action: N·m, 1, N·m/s."""


class Degraded(IntFlag):
    """Missing measurements of a wheel under control, numbered as in ControllerState."""

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
    """Torque of one wheel in the last step, with its causes.

    Attributes
    ----------
    torque : float
        Commanded torque, N·m, forward positive.
    limit_status : LimitStatus
        Limit of the torque, if any.
    exit_reason : ExitReason
        Reason for the wheel not being under slip control; ALL_CLEAR if it is.
    degraded : Degraded
        Missing measurements.
    slip_target : float
        Slip target in use, dimensionless: reduced while speed is not measured.
    gains : tuple of float
        Gains on slip (N·m), shaft torque (1) and integral (N·m/s), and others of the law.
    """

    torque: float = 0.0
    limit_status: LimitStatus = LimitStatus.NOT_AVAILABLE
    exit_reason: ExitReason = ExitReason.REMOTE_COMMAND_TIMEOUT
    degraded: Degraded = Degraded.NONE
    slip_target: float = 0.0
    gains: tuple[float, ...] = NO_GAINS
