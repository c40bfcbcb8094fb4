"""Limit of engine torque on the bus: TSC1 with counter and checksum (SAE J1939-71).

An engine applies the lowest of all limits that it receives. A limit holds while it is repeated
every 10 ms; a frame of mode 0 releases it. The checksum covers identifier, data and counter, so
repeated and damaged frames are detected.
"""

import math

from tractor_io.can.j1939 import Unknown
from tractor_io.can.parameter_group import FrameError, Group, ParameterGroups

PERIOD = 0.01
"""Period of the frames while a limit holds, s."""

HIGHEST = 1.25
"""Largest limit that a frame can hold, as a share of reference torque."""

COUNTS = 8
"""Frames per cycle of the counter."""

# Override control modes, and the speed limit sent with a torque limit: no limit, rad/s.
_RELEASED, _LIMIT = 0, 3
_ANY_SPEED = 0xFAFF * 0.125 * 2.0 * math.pi / 60.0
_STANDARD_RATE = 7
# Control purpose: temporary power train control (P32).
_PURPOSE = 31
_TORQUE, _FRACTION = 'EngineRequestedTorque', 'EngineRequestedTorqueFraction'

STEPS = 800
"""Steps of torque per reference torque: eighths of a percent."""


def checksum(identifier: int, data: bytes, counter: int) -> int:
    """Checksum of a TSC1 frame.

    Parameters
    ----------
    identifier : int
        Its 29 bits.
    data : bytes
        Its first 7 bytes at least.
    counter : int
        Its counter, 0 to 15.

    Returns
    -------
    int
        0 to 7.
    """
    total = sum(data[:7]) + (counter & 0x0F) + sum(identifier.to_bytes(4, 'little'))
    return ((total >> 6 & 0x03) + (total >> 3) + total) & 0x07


def with_fraction(torque: float, fraction: float | Unknown) -> float:
    """Torque from its whole percents and the field with the fraction of a percent.

    Parameters
    ----------
    torque : float
        Whole percents, as a share of reference torque, dimensionless.
    fraction : float or Unknown
        Fraction, as a share of reference torque, dimensionless, 0 to below 0.01. Other values are
        ignored, since some senders leave the field out.

    Returns
    -------
    float
        Share of reference torque, dimensionless, at most `HIGHEST`.
    """
    if isinstance(fraction, Unknown) or not 0.0 <= fraction < 0.00999:
        return torque
    return min(torque + fraction, HIGHEST)


class TorqueLimit:
    """Encoder of torque limits for one engine.

    Parameters
    ----------
    groups : ParameterGroups
        Messages of the bus.
    destination : int
        Address of the engine, 0 to 253.
    priority : int
        Override control mode priority, 0 (highest) to 3 (low).
    """

    def __init__(self, groups: ParameterGroups, destination: int = 0, priority: int = 1) -> None:
        self._groups = groups
        self._identifier = groups.identifier('TSC1')._replace(destination=destination)
        self._priority = priority
        self._counter = 0

    def limit(self, source: int, share: float) -> tuple[int, bytes]:
        """Frame with a limit.

        Parameters
        ----------
        source : int
            Address of the sender, 0 to 253.
        share : float
            Limit of engine torque, as a share of reference torque, -1.25 to 1.25. It is rounded
            down to eighths of a percent. Engines that ignore the fraction apply whole percents.

        Returns
        -------
        identifier : int
            29 bits.
        data : bytes
            8 bytes.

        Raises
        ------
        FrameError
            If the share is not finite or out of range.
        """
        if not (math.isfinite(share) and -HIGHEST <= share <= HIGHEST):
            raise FrameError(
                f'TSC1 {_TORQUE} must be {-HIGHEST:g} to {HIGHEST:g} of reference, got {share}'
            )
        # Rounded down, with a tolerance for binary fractions.
        percents, eighths = divmod(math.floor(STEPS * share + 1e-9), 8)
        return self._frame(
            source,
            {
                'EngineOverrideControlMode': _LIMIT,
                'EngineRequestedSpeed': _ANY_SPEED,
                _TORQUE: percents / 100.0,
                _FRACTION: eighths / STEPS,
            },
        )

    def release(self, source: int) -> tuple[int, bytes]:
        """Frame that releases the limit.

        Parameters
        ----------
        source : int
            Address of the sender, 0 to 253.

        Returns
        -------
        identifier : int
            29 bits.
        data : bytes
            8 bytes.
        """
        return self._frame(source, {'EngineOverrideControlMode': _RELEASED})

    def _frame(self, source: int, values: dict[str, float]) -> tuple[int, bytes]:
        counter, self._counter = self._counter, (self._counter + 1) % COUNTS
        identifier = self._identifier._replace(source=source).bits
        values |= {
            'OverrideControlModePriority': self._priority,
            'TransmissionRate': _STANDARD_RATE,
            'ControlPurpose': _PURPOSE,
            'MessageCounter': counter,
        }
        bare = self._groups.encode('TSC1', values)
        values['MessageChecksum'] = checksum(identifier, bare, counter)
        return identifier, self._groups.encode('TSC1', values)


class LimitReader:
    """Decoder of the torque limits of one sender, as in an engine."""

    def __init__(self) -> None:
        self._counter: float | Unknown | None = None

    def read(self, group: Group, data: bytes) -> float | None:
        """Limit in a frame.

        Parameters
        ----------
        group : Group
            Decoded TSC1.
        data : bytes
            Its 8 bytes.

        Returns
        -------
        float or None
            Limit as a share of reference torque; None if the frame sets no limit.

        Raises
        ------
        FrameError
            If the checksum is wrong, the counter did not change, or the torque has no value.
        """
        values = group.values
        counter, told = values['MessageCounter'], values['MessageChecksum']
        last, self._counter = self._counter, counter
        # Both "not available": a sender without counter and checksum.
        if not isinstance(told, Unknown) and not isinstance(counter, Unknown):
            right = checksum(group.identifier.bits, data, int(counter))
            if told != right:
                raise FrameError(f'TSC1 MessageChecksum is {told:g}, not {right}')
            if counter == last:
                raise FrameError(f'TSC1 MessageCounter stays at {counter:g}')
        if values['EngineOverrideControlMode'] != _LIMIT:
            return None
        torque = values[_TORQUE]
        if isinstance(torque, Unknown):
            raise FrameError(f'TSC1 {_TORQUE} is {torque.value}')
        return with_fraction(torque, values[_FRACTION])
