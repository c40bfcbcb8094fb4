"""Newest value of every message on the bus, from one sender each, with a timeout.

A message may have several senders. It is accepted from the address that the user has set for it,
or else from its first sender, until that sender's frames stop. A message counts as missing if no
frame has come for several of its periods.
"""

import math
from collections.abc import Mapping

from tractor_io.can.j1939 import Unknown, check_address
from tractor_io.can.parameter_group import Group, ParameterGroups


class BusWatch:
    """Newest frames of a bus.

    Parameters
    ----------
    groups : ParameterGroups
        Messages of the bus, with their periods.
    sources : mapping of str to int
        Address from which to accept a message, 0 to 253, by its name. The others are accepted
        from their first sender.
    missed : float
        Periods without a frame after which a message counts as missing, above 1.

    Attributes
    ----------
    refused : dict of str to int
        Frames from other senders than the accepted one, by message.

    Raises
    ------
    ValueError
        If a message is unknown, or an address or `missed` is out of range.
    """

    def __init__(
        self,
        groups: ParameterGroups,
        sources: Mapping[str, int] | None = None,
        missed: float = 5.0,
    ) -> None:
        if not (math.isfinite(missed) and missed > 1):
            raise ValueError(f'missed must be above 1, got {missed}')
        self._groups = groups
        self._pinned = dict(sources or {})
        for name, source in self._pinned.items():
            groups.identifier(name)
            check_address(f'source of {name}', source)
        self._missed = missed
        # Time and content of the newest frame of every message.
        self._newest: dict[str, tuple[float, Group]] = {}
        self.refused: dict[str, int] = {}

    def take(self, t: float, identifier: int, data: bytes) -> Group | None:
        """Process a frame.

        Parameters
        ----------
        t : float
            Time of arrival, s.
        identifier : int
            29 bits.
        data : bytes
            Its bytes.

        Returns
        -------
        Group or None
            Decoded values; None if the message is unknown or its sender not accepted.

        Raises
        ------
        FrameError
            If a known message has the wrong length.
        """
        group = self._groups.decode(identifier, data)
        if group is None:
            return None
        name, source = group.name, group.identifier.source
        heard = self._pinned.get(name)
        if heard is None and not self.silent(t, name):
            heard = self._newest[name][1].identifier.source
        if heard is not None and source != heard:
            self.refused[name] = self.refused.get(name, 0) + 1
            return None
        self._newest[name] = t, group
        return group

    def silent(self, t: float, name: str) -> bool:
        """True if a message is missing.

        Parameters
        ----------
        t : float
            Now, s.
        name : str
            Of the message.

        Returns
        -------
        bool
            Also true if it has never come.
        """
        if name not in self._newest:
            return True
        return t - self._newest[name][0] > self._missed * self._groups.period(name)

    def value(self, t: float, name: str, field: str) -> float | Unknown:
        """Newest value of a field.

        Parameters
        ----------
        t : float
            Now, s.
        name : str
            Of the message.
        field : str
            Of the field.

        Returns
        -------
        float or Unknown
            In SI units; "not available" if the message is missing.
        """
        if self.silent(t, name):
            return Unknown.NOT_AVAILABLE
        return self._newest[name][1].values[field]
