"""What is heard on the bus: newest value of every message, from one sender, until it is silent.

Several senders of one message are arbitrated: a message is heard from the address that is pinned
to it, or else from who sent it first, until that one falls silent. A message is silent when it has
not come for several of its periods.
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
        Address that a message is heard from, 0 to 253, by its name; others from whoever is first.
    missed : float
        Periods without a frame after which a message is silent, above 1.

    Attributes
    ----------
    refused : dict of str to int
        Frames of another sender than the one heard, by message.

    Raises
    ------
    ValueError
        If a message is not known, or an address or `missed` is out of range.
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
        # Of every message heard: when, and what.
        self._newest: dict[str, tuple[float, Group]] = {}
        self.refused: dict[str, int] = {}

    def take(self, t: float, identifier: int, data: bytes) -> Group | None:
        """Take in a frame.

        Parameters
        ----------
        t : float
            When it came, s.
        identifier : int
            29 bits.
        data : bytes
            Its bytes.

        Returns
        -------
        Group or None
            What it says; None where it is none of our messages or from a sender not heard.

        Raises
        ------
        FrameError
            If it is one of our messages with another length.
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
        """Whether a message has not come for too long.

        Parameters
        ----------
        t : float
            Now, s.
        name : str
            Of the message.

        Returns
        -------
        bool
            True too where it has never come.
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
            In SI units; not available where the message is silent.
        """
        if self.silent(t, name):
            return Unknown.NOT_AVAILABLE
        return self._newest[name][1].values[field]
