"""Claim of an address on the bus (SAE J1939-81, ISO 11783-5).

Every device that sends has an address and a unique NAME of 64 bits. It claims its preferred
address and may use it if no other device objects within 250 ms. If two devices claim the same
address, the one with the lower NAME keeps it. The other takes the next free address, if its NAME
allows that, or stops sending.
"""

import math
import random
from enum import Enum

from tractor_io.can.j1939 import GLOBAL, NULL, Identifier, check_address

CLAIMED_PGN = 0xEE00
"""Parameter group of an address claim; from the null address: "cannot claim an address"."""

REQUEST_PGN = 0xEA00
"""Parameter group that requests another one."""

WAIT = 0.25
"""Time without objection after which a claimed address may be used, s."""

LONGEST_DELAY = 0.153
"""Upper limit of the random delay before "cannot claim an address" is sent, s."""

ARBITRARY = range(128, 248)
"""Addresses open to devices whose NAME allows any address."""

_PRIORITY = 6
_ARBITRARY_BIT = 1 << 63
# Industry group 2; device class and instances are 0.
_AGRICULTURE = 2 << 60

Frame = tuple[Identifier, bytes]


def name_of(
    *,
    identity: int,
    manufacturer: int,
    function: int,
    arbitrary: bool = True,
) -> int:
    """NAME of the first and only such device on an agricultural or forestry vehicle.

    Parameters
    ----------
    identity : int
        Number of the device with its manufacturer, 21 bits.
    manufacturer : int
        Code of the manufacturer, 11 bits.
    function : int
        Function of the device, 8 bits.
    arbitrary : bool
        Device can use any address of `ARBITRARY`.

    Returns
    -------
    int
        64 bits.

    Raises
    ------
    ValueError
        If a part does not fit into its bits.
    """
    whole = _AGRICULTURE | (_ARBITRARY_BIT if arbitrary else 0)
    for text, value, start, length in (
        ('identity', identity, 0, 21),
        ('manufacturer', manufacturer, 21, 11),
        ('function', function, 40, 8),
    ):
        if not 0 <= value < 1 << length:
            raise ValueError(f'{text} must be 0 to {(1 << length) - 1}, got {value}')
        whole |= value << start
    return whole


class Claim(Enum):
    """Progress of a claim."""

    NONE = 'not claimed yet'
    WAITING = 'claimed'
    OWN = 'own'
    LOST = 'lost'


class AddressClaim:
    """Address of this device on the bus: claim and defence.

    Parameters
    ----------
    name : int
        NAME, 64 bits.
    preferred : int
        Address to claim first, 0 to 253.
    seed : int
        Seed of the random delays; different for every device.

    Attributes
    ----------
    state : Claim
        Progress of the claim.
    address : int
        Address that is claimed or in use; `NULL` if there is none.

    Raises
    ------
    ValueError
        If no device can have the preferred address.
    """

    def __init__(self, name: int, preferred: int, seed: int = 0) -> None:
        check_address('preferred', preferred)
        self.name = name
        self.state = Claim.NONE
        self.address = NULL
        self._preferred = preferred
        self._random = random.Random(seed)
        # Addresses of other devices, and the time at which a delayed frame is due, s.
        self._taken: set[int] = set()
        self._due = 0.0

    @property
    def usable(self) -> bool:
        """True if frames may be sent from `address`."""
        return self.state is Claim.OWN

    def start(self, t: float) -> list[Frame]:
        """Claim the preferred address.

        Parameters
        ----------
        t : float
            Time, s.

        Returns
        -------
        list of (Identifier, bytes)
            Frames to send.
        """
        self._taken.clear()
        return self._claim(t, self._preferred)

    def poll(self, t: float) -> list[Frame]:
        """End the claim, or send a delayed frame, when its time has come.

        Parameters
        ----------
        t : float
            Time, s.

        Returns
        -------
        list of (Identifier, bytes)
            Frames to send.
        """
        if self.state is Claim.WAITING and t >= self._due:
            self.state = Claim.OWN
        elif self.state is Claim.LOST and t >= self._due:
            self._due = math.inf
            return [self._claim_frame(NULL)]
        return []

    def receive(self, t: float, identifier: Identifier, data: bytes) -> list[Frame]:
        """Process a frame of the bus.

        Parameters
        ----------
        t : float
            Time, s.
        identifier : Identifier
            Its identifier.
        data : bytes
            Its bytes. Frames other than claims and requests are ignored.

        Returns
        -------
        list of (Identifier, bytes)
            Frames to send.
        """
        if identifier.pgn == REQUEST_PGN:
            asked = identifier.destination in (GLOBAL, self.address)
            claims = len(data) >= 3 and int.from_bytes(data[:3], 'little') == CLAIMED_PGN
            if not (asked and claims) or self.state is Claim.NONE:
                return []
            if self.state is Claim.LOST:
                self._due = t + self._random.uniform(0.0, LONGEST_DELAY)
                return []
            return [self._claim_frame(self.address)]
        if identifier.pgn != CLAIMED_PGN or len(data) != 8 or identifier.source == NULL:
            return []
        other = int.from_bytes(data, 'little')
        if other == self.name:
            return []
        if identifier.source != self.address:
            self._taken.add(identifier.source)
            return []
        if self.name < other:
            return [self._claim_frame(self.address)]
        self._taken.add(self.address)
        free = [each for each in ARBITRARY if each not in self._taken]
        if self.name & _ARBITRARY_BIT and free:
            return self._claim(t, free[0])
        self.state, self.address = Claim.LOST, NULL
        self._due = t + self._random.uniform(0.0, LONGEST_DELAY)
        return []

    def _claim(self, t: float, address: int) -> list[Frame]:
        self.state, self.address, self._due = Claim.WAITING, address, t + WAIT
        return [self._claim_frame(address)]

    def _claim_frame(self, source: int) -> Frame:
        """Frame of a claim, or, from the null address, of "cannot claim an address"."""
        return Identifier(CLAIMED_PGN, source, GLOBAL, _PRIORITY), self.name.to_bytes(8, 'little')
