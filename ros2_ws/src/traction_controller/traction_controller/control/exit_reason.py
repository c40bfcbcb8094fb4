"""Limit status and exit reasons of slip control, in the words and numbers of ISO 11783-7.

ISO 11783-7 has a limit status of 3 bits and an exit/reason code of 6 bits for every function that
can be commanded over the bus. The numbers are those of AgIsoStack++ (Open-Agriculture, MIT
licence) for the machine selected speed, or for guidance if the former has no such code (vehicle
speed too low). Reasons without an ISO code start at 64, beyond its 6 bits.
"""

from enum import IntEnum


class LimitStatus(IntEnum):
    """Limit status of a wheel's torque."""

    NOT_LIMITED = 0
    OPERATOR_LIMITED = 1
    LIMITED_HIGH = 2
    LIMITED_LOW = 3
    NON_RECOVERABLE_FAULT = 6
    NOT_AVAILABLE = 7


class ExitReason(IntEnum):
    """Reason for a wheel not being under slip control."""

    ALL_CLEAR = 0
    REMOTE_COMMAND_TIMEOUT = 5
    REMOTE_COMMAND_INVALID = 6
    FUNCTION_FAULT = 9
    VEHICLE_SPEED_TOO_LOW = 23
    # Not in ISO 11783-7.
    SLIP_NOT_AVAILABLE = 64
    NOT_DRIVEN = 65

    @property
    def words(self) -> str:
        """The reason as a text."""
        return _WORDS[self]


_WORDS = {
    ExitReason.ALL_CLEAR: 'no reason, all clear',
    ExitReason.REMOTE_COMMAND_TIMEOUT: 'remote command time-out',
    ExitReason.REMOTE_COMMAND_INVALID: 'remote command out of range or invalid',
    ExitReason.FUNCTION_FAULT: 'function fault',
    ExitReason.VEHICLE_SPEED_TOO_LOW: 'vehicle speed too low',
    ExitReason.SLIP_NOT_AVAILABLE: 'slip not available',
    ExitReason.NOT_DRIVEN: 'not driven',
}

OPERATOR_CONTROLLED = 'operator controlled'
"""Reason of changes by parameter or topic, in the words of the limit status."""
