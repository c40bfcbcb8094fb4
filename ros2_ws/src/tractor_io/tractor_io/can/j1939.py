"""Identifiers of J1939 (SAE J1939-21, ISO 11783-3), and the special values of its fields.

The 29 bits of an identifier hold the priority, the parameter group number (PGN) and the source
address. Groups with a format byte below 240 have a destination address in place of the last byte
of the PGN. All others are broadcast.
"""

from enum import Enum
from typing import NamedTuple

GLOBAL = 255
"""Destination address of broadcasts."""

NULL = 254
"""Source address of a device without an address."""

LAST_ADDRESS = 253
"""Largest address that a device can have; the smallest is 0."""

LARGEST_IDENTIFIER = 0x1FFFFFFF

# Smallest format byte of broadcast groups.
_BROADCAST_FORMAT = 240


def check_address(name: str, address: int) -> None:
    """Check the address of a device.

    Parameters
    ----------
    name : str
        Name for the error message.
    address : int
        Allowed: 0 to `LAST_ADDRESS`.

    Raises
    ------
    ValueError
        If no device can have it.
    """
    if not 0 <= address <= LAST_ADDRESS:
        raise ValueError(f'{name} must be an address of 0 to {LAST_ADDRESS}, got {address}')


class Unknown(Enum):
    """Special value of a field without a measurement."""

    ERROR = 'error'
    NOT_AVAILABLE = 'not available'


class Identifier(NamedTuple):
    """Parts of the identifier of a frame.

    Attributes
    ----------
    pgn : int
        Parameter group number, 0 to 0x3FFFF; its last byte is 0 if the group has a destination.
    source : int
        Source address, 0 to 255.
    destination : int
        Destination address, 0 to 255; 255 (`GLOBAL`) for broadcasts.
    priority : int
        0 (first) to 7.
    """

    pgn: int
    source: int
    destination: int = GLOBAL
    priority: int = 6

    @classmethod
    def parse(cls, identifier: int) -> 'Identifier':
        """Split an identifier into its parts.

        Parameters
        ----------
        identifier : int
            The 29 bits.

        Returns
        -------
        Identifier
            Its parts.

        Raises
        ------
        ValueError
            If it has more than 29 bits.
        """
        if not 0 <= identifier <= LARGEST_IDENTIFIER:
            raise ValueError(f'identifier must have 29 bits, got {identifier:#x}')
        pgn, destination = identifier >> 8 & 0x3FFFF, GLOBAL
        if (pgn >> 8 & 0xFF) < _BROADCAST_FORMAT:
            pgn, destination = pgn & 0x3FF00, pgn & 0xFF
        return cls(pgn, identifier & 0xFF, destination, identifier >> 26)

    @property
    def bits(self) -> int:
        """The 29 bits of the identifier, dimensionless.

        Raises
        ------
        ValueError
            If a part is out of range.
        """
        for name, value, most in (
            ('pgn', self.pgn, 0x3FFFF),
            ('source', self.source, 255),
            ('destination', self.destination, 255),
            ('priority', self.priority, 7),
        ):
            if not 0 <= value <= most:
                raise ValueError(f'{name} must be 0 to {most}, got {value}')
        pgn = self.pgn
        if (pgn >> 8 & 0xFF) < _BROADCAST_FORMAT:
            if pgn & 0xFF:
                raise ValueError(f'pgn {pgn} has a destination: its last byte must be 0')
            pgn |= self.destination
        elif self.destination != GLOBAL:
            raise ValueError(f'pgn {pgn} goes to everybody, not to {self.destination}')
        return self.priority << 26 | pgn << 8 | self.source


def meaning(raw: int, length: int) -> int | Unknown:
    """Value of a field from its bits (SAE J1939-71, ISO 11783-7).

    In fields shorter than a byte, all ones mean "not available" and one less means "error". In
    fields of whole bytes the most significant byte decides: 0x00 to 0xFA value, 0xFB to 0xFD
    reserved (read as error), 0xFE error, 0xFF not available.

    Parameters
    ----------
    raw : int
        The bits, at least 0.
    length : int
        Their number: 2 to 7, 8, 16 or 32.

    Returns
    -------
    int or Unknown
        The bits if they are a value, else the special value.
    """
    if length % 8:
        top = (1 << length) - 1
        if raw == top:
            return Unknown.NOT_AVAILABLE
        return Unknown.ERROR if raw == top - 1 else raw
    first = raw >> length - 8
    if first == 0xFF:
        return Unknown.NOT_AVAILABLE
    return Unknown.ERROR if first > 0xFA else raw


def bits_of(unknown: Unknown, length: int) -> int:
    """Bits of a special value.

    Parameters
    ----------
    unknown : Unknown
        Special value.
    length : int
        Number of bits: 2 to 7, 8, 16 or 32.

    Returns
    -------
    int
        The bits.
    """
    top = (1 << length) - 1
    if unknown is Unknown.NOT_AVAILABLE:
        return top
    # The most significant byte decides.
    return top - 1 if length < 8 else top - (1 << length - 8)
