"""Parameter groups of a tractor's bus: frames to values in SI units and back.

The messages are those of ``config/tractor.dbc``. Only the parameter group identifies a message;
priority and source do not. The bits of a field are checked before they are scaled, since "not
available" would otherwise read as a speed of 65 m/s. Unused bits are sent as ones.
"""

import math
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

import cantools
from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from cantools.database.can import Database, Message

from tractor_io.can.j1939 import Identifier, Unknown, bits_of, meaning

LENGTH = 8
"""Bytes of every frame."""

# Factors from units of the bus to SI units (REP-103).
_TO_SI = {
    '': 1.0, 'm': 1.0, 'm/s': 1.0, 'm/s^2': 1.0, 'rad': 1.0, 'rad/s': 1.0, 'N': 1.0,
    '%': 0.01, 'km/h': 1.0 / 3.6, 'rpm': 2.0 * math.pi / 60.0, 'min': 60.0,
}  # fmt: skip


class FrameError(ValueError):
    """Invalid frame or value; the text names message and field."""


class Group(NamedTuple):
    """Decoded frame.

    Attributes
    ----------
    name : str
        Name of the message, such as ``WBSD``.
    identifier : Identifier
        Parameter group, source, destination, priority.
    values : dict of str to float or Unknown
        Value of every field, in SI units: m/s, m, rad/s, N, s; shares in place of percent. States
        and counters are dimensionless numbers.
    """

    name: str
    identifier: Identifier
    values: dict[str, float | Unknown]


class _Field(NamedTuple):
    name: str
    start: int
    length: int
    scale: float
    offset: float
    to_si: float
    # True if all bit patterns are values, without "error" and "not available".
    always: bool


class _Layout(NamedTuple):
    name: str
    identifier: Identifier
    # s
    period: float
    fields: tuple[_Field, ...]


class ParameterGroups:
    """Messages of a bus: decoding and encoding.

    Parameters
    ----------
    path : Path, optional
        DBC file; the default is ``config/tractor.dbc``.

    Raises
    ------
    FrameError
        If the file cannot be read, or has an unsupported message or unit.
    """

    def __init__(self, path: Path | None = None) -> None:
        if path is None:
            try:
                share = get_package_share_directory('tractor_io')
            except PackageNotFoundError:
                raise FrameError(
                    'package tractor_io is not in the ament index: build and source the workspace'
                ) from None
            path = Path(share) / 'config' / 'tractor.dbc'
        try:
            database = cantools.database.load_file(str(path), database_format='dbc')
        except (
            OSError,
            cantools.Error,
            cantools.database.UnsupportedDatabaseFormatError,
        ) as error:
            raise FrameError(f'{path}: {error}') from error
        if not isinstance(database, Database):
            raise FrameError(f'{path}: holds no messages')
        self._by_pgn: dict[int, _Layout] = {}
        self._by_name: dict[str, _Layout] = {}
        for message in database.messages:
            if not message.cycle_time:
                raise FrameError(f'{path}: {message.name} has no GenMsgCycleTime')
            layout = _Layout(
                message.name, Identifier.parse(message.frame_id), 1e-3 * message.cycle_time,
                tuple(self._fields(path, message)),
            )  # fmt: skip
            self._by_pgn[layout.identifier.pgn] = self._by_name[layout.name] = layout

    @staticmethod
    def _fields(path: Path, message: Message) -> Iterable[_Field]:
        if message.length != LENGTH or not message.is_extended_frame:
            raise FrameError(f'{path}: {message.name} is no J1939 frame of {LENGTH} bytes')
        for signal in message.signals:
            unit = signal.unit or ''
            if unit not in _TO_SI:
                raise FrameError(f"{path}: {message.name} {signal.name}: unknown unit '{unit}'")
            if signal.byte_order != 'little_endian' or signal.is_signed:
                raise FrameError(f'{path}: {message.name} {signal.name} is no J1939 field')
            attributes = signal.dbc.attributes if signal.dbc else {}
            always = 'AllValuesValid' in attributes and attributes['AllValuesValid'].value == 1
            yield _Field(
                signal.name, signal.start, signal.length, float(signal.scale),
                float(signal.offset), _TO_SI[unit], always,
            )  # fmt: skip

    def identifier(self, name: str) -> Identifier:
        """Identifier of a message with its default priority and no source address.

        Parameters
        ----------
        name : str
            Name of the message, such as ``TSC1``.

        Returns
        -------
        Identifier
            With source `NULL`.

        Raises
        ------
        FrameError
            If there is no such message.
        """
        return self._named(name).identifier

    def period(self, name: str) -> float:
        """Nominal period of a message.

        Parameters
        ----------
        name : str
            Name of the message, such as ``HRW``.

        Returns
        -------
        float
            s.

        Raises
        ------
        FrameError
            If there is no such message.
        """
        return self._named(name).period

    def _named(self, name: str) -> _Layout:
        if name not in self._by_name:
            raise FrameError(f"unknown message '{name}': there are {', '.join(self._by_name)}")
        return self._by_name[name]

    def decode(self, identifier: int, data: bytes) -> Group | None:
        """Read a frame.

        Parameters
        ----------
        identifier : int
            29 bits.
        data : bytes
            8 bytes.

        Returns
        -------
        Group or None
            Decoded values, SI units; None if the parameter group is unknown.

        Raises
        ------
        FrameError
            If the data has not 8 bytes, or the identifier more than 29 bits.
        """
        try:
            parsed = Identifier.parse(identifier)
        except ValueError as error:
            raise FrameError(str(error)) from None
        layout = self._by_pgn.get(parsed.pgn)
        if layout is None:
            return None
        if len(data) != LENGTH:
            raise FrameError(f'{layout.name}: has {len(data)} bytes, not {LENGTH}')
        whole = int.from_bytes(data, 'little')
        values: dict[str, float | Unknown] = {}
        for field in layout.fields:
            raw = whole >> field.start & (1 << field.length) - 1
            told: float | Unknown = raw if field.always else meaning(raw, field.length)
            if not isinstance(told, Unknown):
                told = (told * field.scale + field.offset) * field.to_si
            values[field.name] = told
        return Group(layout.name, parsed, values)

    def encode(self, name: str, values: Mapping[str, float | Unknown]) -> bytes:
        """Encode a message.

        Parameters
        ----------
        name : str
            Name of the message, such as ``WBSD``.
        values : mapping of str to float or Unknown
            Values of its fields, in SI units. Fields left out are sent as all ones ("not
            available").

        Returns
        -------
        bytes
            8 bytes.

        Raises
        ------
        FrameError
            If there is no such message or field, or a value does not fit into its field.
        """
        fields = self._named(name).fields
        for asked in values.keys() - {field.name for field in fields}:
            raise FrameError(f"{name} has no field '{asked}'")
        whole = (1 << 8 * LENGTH) - 1
        for field in fields:
            value = values.get(field.name, Unknown.NOT_AVAILABLE)
            if isinstance(value, Unknown):
                if field.always and field.name in values:
                    raise FrameError(f'{name} {field.name} cannot be {value.value}')
                raw = bits_of(value, field.length)
            else:
                raw = self._raw(name, field, value)
            mask = (1 << field.length) - 1
            whole = whole & ~(mask << field.start) | raw << field.start
        return whole.to_bytes(LENGTH, 'little')

    @staticmethod
    def _raw(name: str, field: _Field, value: float) -> int:
        """Bits of a value."""
        if math.isfinite(value):
            raw = round((value / field.to_si - field.offset) / field.scale)
            inside = 0 <= raw < 1 << field.length
            if inside and (field.always or not isinstance(meaning(raw, field.length), Unknown)):
                return raw
        raise FrameError(f'{name} {field.name} cannot be {value:g}')


@cache
def tractor_groups() -> ParameterGroups:
    """Messages of ``config/tractor.dbc``, read once per process.

    Returns
    -------
    ParameterGroups
        Messages with values in SI units.

    Raises
    ------
    FrameError
        See `ParameterGroups`.
    """
    return ParameterGroups()
