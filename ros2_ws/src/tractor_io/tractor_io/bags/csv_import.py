"""Import of CSV files: columns of numbers with units become the suite's topics in SI units.

A map in YAML assigns columns to fields of messages, with units. The file is read row by row, so
memory does not grow with its length. `config/import_t7165s.yaml` is an example of a map.
"""

import csv
import math
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any, NamedTuple, TextIO

from ament_index_python.packages import get_package_share_directory
from rosbags.interfaces import Nodetype

from traction_node.bounded_yaml import BoundedYamlError, read_yaml
from traction_node.closest import closest
from traction_node.quality_of_service import QOS
from traction_node.topics import topics as suite_topics
from tractor_io.bags.bag_error import BagError
from tractor_io.bags.message_types import typestore, zero_list, zero_message
from tractor_io.bags.writer import BagWriter

LONGEST_LINE = 64 * 1024
"""Limit of the length of a line, characters."""

LAST_SECOND = 2**31 - 1
"""Largest time that a stamp can hold, s."""

UNITS: dict[str, tuple[str, float]] = {
    '': ('', 1.0), '1': ('', 1.0), '%': ('', 0.01), 'permille': ('', 0.001),
    's': ('s', 1.0), 'ms': ('s', 1e-3), 'us': ('s', 1e-6), 'ns': ('s', 1e-9),
    'min': ('s', 60.0), 'h': ('s', 3600.0),
    'm': ('m', 1.0), 'mm': ('m', 1e-3), 'cm': ('m', 1e-2), 'km': ('m', 1e3),
    'in': ('m', 0.0254), 'ft': ('m', 0.3048),
    'm/s': ('m/s', 1.0), 'mm/s': ('m/s', 1e-3), 'cm/s': ('m/s', 1e-2),
    'km/h': ('m/s', 1.0 / 3.6), 'mph': ('m/s', 0.44704), 'kn': ('m/s', 1852.0 / 3600.0),
    'rad': ('rad', 1.0), 'deg': ('rad', math.pi / 180.0),
    'rad/s': ('rad/s', 1.0), 'deg/s': ('rad/s', math.pi / 180.0),
    'rpm': ('rad/s', math.pi / 30.0), 'rev/s': ('rad/s', 2.0 * math.pi),
    'N': ('N', 1.0), 'kN': ('N', 1e3), 'daN': ('N', 10.0), 'lbf': ('N', 4.4482216152605),
    'N·m': ('N·m', 1.0), 'N*m': ('N·m', 1.0), 'Nm': ('N·m', 1.0),
    'kN·m': ('N·m', 1e3), 'kN*m': ('N·m', 1e3), 'kNm': ('N·m', 1e3),
    'lbf*ft': ('N·m', 1.3558179483314004),
    'Pa': ('Pa', 1.0), 'kPa': ('Pa', 1e3), 'bar': ('Pa', 1e5), 'MPa': ('Pa', 1e6),
    'm/s^2': ('m/s^2', 1.0), 'g': ('m/s^2', 9.80665),
    'm^2': ('m^2', 1.0), 'm^2/s^2': ('m^2/s^2', 1.0),
}  # fmt: skip
"""SI unit and factor to it, of every unit that a map can name."""

# SI units of message fields, by their names.
_UNITS_OF_FIELDS = (
    (r'^velocity$', 'rad/s'),
    (r'^effort$', 'N·m'),
    (r'(^|\.)twist\.linear\.[xyz]$', 'm/s'),
    (r'(^|\.)twist\.angular\.[xyz]$', 'rad/s'),
    (r'\.position\.[xyz]$', 'm'),
    (r'_speed$', 'm/s'),
)
_PART = re.compile(r'([a-zA-Z]\w*)(?:\[(\d{1,6})\])?')
# Stands for the number of a wheel.
_NO_WHEEL = -1
_KEYS = ('delimiter', 'soil', 'source', 'time', 'topics', 'vehicle', 'wheel_names')
_TOPIC_KEYS = ('fields', 'frame_id', 'skip_empty')
_VALUE_KEYS = ('column', 'rolling_radius', 'scale', 'unit')
_TIME_KEYS = ('column', 'rate', 'start', 'unit')
# Decimal: exact to the nanosecond also near the present date.
_SECONDS = {
    's': Decimal(1), 'ms': Decimal('1e-3'), 'us': Decimal('1e-6'), 'ns': Decimal('1e-9'),
    'min': Decimal(60), 'h': Decimal(3600),
}  # fmt: skip
# Rows from one call of `progress` to the next.
_PROGRESS_ROWS = 200


class CsvImportError(ValueError):
    """Error in a file or a map; the text names file, line, column and value."""


@dataclass(frozen=True)
class Imported:
    """Result of an import.

    Attributes
    ----------
    path : Path
        The new bag.
    rows : int
        Rows of numbers in the file.
    counts : dict of str to int
        Number of messages, by topic.
    start, end : int
        Stamps of the first and the last message, ns.
    """

    path: Path
    rows: int
    counts: dict[str, int]
    start: int
    end: int


class _Cell(NamedTuple):
    """A number of a row and its place in a message."""

    column: str
    factor: float
    # Lists take their element, messages their attribute.
    parent: Any
    key: int | str
    kind: str
    # Index of the column in a row; set when the header has been read.
    place: int = -1

    def put(self, text: str) -> None:
        """Convert and store; raises ValueError with the reason."""
        value: Any = text
        if self.kind != 'string':
            value = number(text) * self.factor
            low, high = _RANGES[self.kind]
            if not low <= value <= high:
                raise ValueError(f'is out of range for {self.kind}')
            if not self.kind.startswith('float'):
                if value != int(value):
                    raise ValueError(f'is not a whole number, as {self.kind} needs')
                value = int(value) if self.kind != 'bool' else bool(value)
        _store(self.parent, self.key, value)


_RANGES: dict[str, tuple[float, float]] = {
    'bool': (0, 1), 'byte': (0, 255), 'char': (0, 255),
    'float32': (-3.4028234e38, 3.4028234e38),
    'float64': (-sys.float_info.max, sys.float_info.max),
    **{f'int{n}': (-(2 ** (n - 1)), 2 ** (n - 1) - 1) for n in (8, 16, 32, 64)},
    **{f'uint{n}': (0, 2**n - 1) for n in (8, 16, 32, 64)},
}  # fmt: skip


def number(text: str) -> float:
    """Read a number of a table.

    Parameters
    ----------
    text : str
        A cell.

    Returns
    -------
    float
        Finite number in the unit of its column.

    Raises
    ------
    ValueError
        If it is empty, no number, or not finite.
    """
    if not text.strip():
        raise ValueError('is empty')
    # Python also accepts underscores between digits; loggers do not write them.
    if '_' in text:
        raise ValueError('is not a number')
    try:
        value = float(text)
    except ValueError:
        raise ValueError('is not a number') from None
    if not math.isfinite(value):
        raise ValueError('is not finite')
    return value


class CsvMap:
    """Assignment of the columns of a CSV file to message fields.

    Parameters
    ----------
    path : Path or str
        YAML file.

    Attributes
    ----------
    path : Path
        As given.
    custom_data : dict of str to str
        Custom data for the bag: vehicle, soil, source.
    wheel_names : tuple of str
        The wheels, in the order of all lists.
    delimiter : str
        Character between two columns.
    topics : dict of str to str
        Message types of the topics, by name.

    Raises
    ------
    CsvImportError
        If a key is missing, unknown or has a wrong value.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        content = self._mapping(self._read(), '', _KEYS)
        self.custom_data: dict[str, str] = {
            key: self._text(content[key], key)
            for key in ('vehicle', 'soil', 'source')
            if key in content
        }
        self.wheel_names = self._wheels(content.get('wheel_names', []))
        self.delimiter = self._text(content.get('delimiter', ','), 'delimiter')
        if len(self.delimiter) != 1 or self.delimiter in '\r\n"':
            raise self._fault('delimiter', 'must be one character')
        self._read_time(content.get('time'))
        entries = content.get('topics')
        if not isinstance(entries, dict) or not entries:
            raise self._fault('topics', 'must name at least one topic')
        self._store = typestore()
        self.topics: dict[str, str] = {}
        self._frames: dict[str, str] = {}
        self.skips_empty: dict[str, bool] = {}
        self._fields: dict[str, dict[str, Any]] = {}
        for name, entry in entries.items():
            self._read_topic(name, entry)
        # Built once here, so that errors of the map are raised before a file is read.
        for topic in self.topics:
            self.message(topic)

    # Reading of the map

    def _read(self) -> Any:
        try:
            return read_yaml(self.path)
        except BoundedYamlError as error:
            raise CsvImportError(str(error)) from error

    def _fault(self, key: str, reason: str) -> CsvImportError:
        return CsvImportError(f'{self.path}: {key + ": " if key else ""}{reason}')

    def _mapping(self, content: Any, key: str, known: Sequence[str]) -> dict[str, Any]:
        if not isinstance(content, dict):
            raise self._fault(key, f'must be a mapping, got {_shown(content)}')
        for name in content:
            if name not in known:
                raise self._fault(
                    f'{key}.{_plain(name)}' if key else _plain(name),
                    f'unknown key{closest(name, known)}',
                )
        return content

    def _text(self, content: Any, key: str) -> str:
        if not isinstance(content, str):
            raise self._fault(key, f'must be a text, got {_shown(content)}')
        return content

    def _finite(self, content: Any, key: str) -> float:
        if isinstance(content, bool) or not isinstance(content, int | float):
            raise self._fault(key, f'must be a number, got {_shown(content)}')
        if not abs(content) < 1e300:  # NaN, infinity, and integers beyond any float
            raise self._fault(key, f'must be a finite number, got {_shown(content)}')
        return float(content)

    def _wheels(self, content: Any) -> tuple[str, ...]:
        if not isinstance(content, list) or not all(isinstance(n, str) and n for n in content):
            raise self._fault('wheel_names', f'must be a list of names, got {_shown(content)}')
        if len(set(content)) != len(content):
            raise self._fault('wheel_names', 'a name is given twice')
        return tuple(content)

    def _read_time(self, content: Any) -> None:
        if content is None:
            raise self._fault('time', 'missing: name its column and unit, or a rate in Hz')
        entry = self._mapping(content, 'time', _TIME_KEYS)
        if ('column' in entry) == ('rate' in entry):
            raise self._fault('time', 'must have either a column with its unit, or a rate in Hz')
        start = self._finite(entry.get('start', 0.0), 'time.start')
        if not 0.0 <= start < LAST_SECOND:
            raise self._fault('time.start', f'must be 0 to {LAST_SECOND} s, got {start:g}')
        self._start = Decimal(repr(start))
        self.time_column: str | None = None
        if 'rate' in entry:
            if 'unit' in entry:
                raise self._fault('time.unit', 'a rate is in Hz')
            rate = self._finite(entry['rate'], 'time.rate')
            if not 1e-6 <= rate <= 1e9:
                raise self._fault('time.rate', f'must be 1e-6 to 1e9 Hz, got {rate:g}')
            self._period = 1 / Decimal(repr(rate))
            return
        self.time_column = self._text(entry['column'], 'time.column')
        unit = self._text(entry.get('unit', ''), 'time.unit')
        if unit not in _SECONDS:
            raise self._fault(
                'time.unit', f"'{_plain(unit)}' is no unit of time{closest(unit, _SECONDS)}"
            )
        self._second = _SECONDS[unit]

    def _read_topic(self, name: Any, content: Any) -> None:
        table = suite_topics()
        if not isinstance(name, str) or name not in table:
            raise self._fault('topics', f"unknown topic '{_plain(name)}'{closest(name, table)}")
        entry = self._mapping(content, name, _TOPIC_KEYS)
        skip = entry.get('skip_empty', False)
        if not isinstance(skip, bool):
            raise self._fault(f'{name}.skip_empty', f'must be true or false, got {_shown(skip)}')
        fields = entry.get('fields')
        if not isinstance(fields, dict) or not fields:
            raise self._fault(f'{name}.fields', 'must name at least one field')
        self.topics[name] = table[name].type
        self.skips_empty[name] = skip
        self._frames[name] = self._text(entry.get('frame_id', ''), f'{name}.frame_id')
        self._fields[name] = fields

    # Messages

    def message(self, topic: str) -> tuple[Any, list[Any]]:
        """Message of a topic with its constant fields set.

        Parameters
        ----------
        topic : str
            One of `topics`.

        Returns
        -------
        message : object
            Message class of `typestore`; filled anew for every row.
        cells : list
            Fields that come from columns.

        Raises
        ------
        CsvImportError
            If the message has no such field, or a value does not fit it.
        """
        message = zero_message(self._store, self.topics[topic])
        if hasattr(message, 'header'):
            message.header.frame_id = self._frames[topic]
        elif self._frames[topic]:
            raise self._fault(f'{topic}.frame_id', 'the message has no header')
        for field in ('name', 'wheel_names'):
            if hasattr(message, field):
                if not self.wheel_names:
                    raise self._fault('wheel_names', f'missing: {topic} needs them')
                setattr(message, field, list(self.wheel_names))
        cells: list[_Cell] = []
        for path, value in self._fields[topic].items():
            self._fill(message, topic, path, value, cells)
        if not cells:
            raise self._fault(f'{topic}.fields', 'names no column')
        return message, cells

    def _fields_of(self, kind: str) -> Any:
        return self._store.fielddefs[kind][1]

    def _fill(self, message: Any, topic: str, path: Any, value: Any, cells: list[_Cell]) -> None:
        """Set a field to its constant, or note the cells that fill it."""
        key = f'{topic}.fields.{_plain(path)}'
        if not isinstance(path, str):
            raise self._fault(key, 'a field must be a name')
        if path in ('name', 'wheel_names') or path.split('.')[0] == 'header':
            raise self._fault(key, 'is set from time, frame_id and wheel_names')
        parent, name, index, node, detail = self._find(message, topic, path, key)
        if node is Nodetype.BASE:
            self._place(parent, name, detail[0], value, key, path, _NO_WHEEL, cells)
        elif node is Nodetype.NAME:
            fields = (part for part, _ in self._fields_of(detail))
            raise self._fault(key, f'is a message itself, of {", ".join(fields)}')
        else:
            element, length = detail
            if element[0] is not Nodetype.BASE:
                raise self._fault(key, 'is a list of messages, which no column can fill')
            if index is not None:
                if node is not Nodetype.ARRAY or index >= length:
                    raise self._fault(key, f'has no element {index}')
                self._place(
                    getattr(parent, name), index, element[1][0], value, key, path, _NO_WHEEL, cells
                )
                return
            self._fill_list(parent, name, node, element, length, value, key, path, cells)

    def _fill_list(
        self, parent: Any, name: str, node: Any, element: Any, length: int, value: Any,
        key: str, path: str, cells: list[_Cell],
    ) -> None:  # fmt: skip
        """Fill a list field: one value for all elements, or one for each."""
        of_wheels = bool(self.wheel_names) and node is not Nodetype.ARRAY
        count = length if node is Nodetype.ARRAY else len(self.wheel_names)
        each = value if isinstance(value, list) else [value] * count
        if (of_wheels or node is Nodetype.ARRAY) and len(each) != count:
            what = 'wheels' if of_wheels else 'elements'
            raise self._fault(key, f'{len(each)} values for {count} {what}')
        if not each:
            raise self._fault(key, 'must have a list of values, or wheel_names be given')
        filled = zero_list(self._store, element, len(each))
        setattr(parent, name, filled)
        for k, one in enumerate(each):
            wheel = k if of_wheels else _NO_WHEEL
            self._place(filled, k, element[1][0], one, key, path, wheel, cells)

    def _find(
        self, message: Any, topic: str, path: str, key: str
    ) -> tuple[Any, str, int | None, Any, Any]:
        """Follow a path such as ``twist.covariance[0]`` into a message."""
        kind = self.topics[topic]
        parent = message
        parts = path.split('.')
        for k, part in enumerate(parts):
            match = _PART.fullmatch(part)
            fields = dict(self._fields_of(kind))
            if match is None or match[1] not in fields:
                raise self._fault(
                    key, f"{kind} has no field '{_plain(part)}'{closest(part, fields)}"
                )
            node, detail = fields[match[1]]
            index = None if match[2] is None else int(match[2])
            if index is not None and node in (Nodetype.BASE, Nodetype.NAME):
                raise self._fault(key, f"'{match[1]}' is no list")
            if k == len(parts) - 1:
                return parent, match[1], index, node, detail
            if node is not Nodetype.NAME:
                raise self._fault(key, f"'{match[1]}' has no fields")
            parent, kind = getattr(parent, match[1]), detail
        raise AssertionError('a path has at least one part')

    def _place(
        self, parent: Any, place: int | str, kind: str, value: Any, key: str, path: str,
        wheel: int, cells: list[_Cell],
    ) -> None:  # fmt: skip
        """Fill one place from a constant or a column."""
        if not isinstance(value, dict):
            self._constant(parent, place, kind, value, key)
            return
        entry = self._mapping(value, key, _VALUE_KEYS)
        if 'column' not in entry:
            raise self._fault(key, 'names no column')
        column = self._text(entry['column'], f'{key}.column')
        if kind == 'string':
            if len(entry) > 1:
                raise self._fault(key, 'a text has no unit')
            cells.append(_Cell(column, 1.0, parent, place, kind))
            return
        factor = self._factor(entry, key, path, wheel)
        cells.append(_Cell(column, factor, parent, place, kind))

    def _factor(self, entry: Mapping[str, Any], key: str, path: str, wheel: int) -> float:
        """Factor from column to field: unit to SI, over rolling radius, times scale."""
        if 'unit' not in entry:
            raise self._fault(key, "names no unit; for a plain number give '1'")
        # YAML reads 1 as a number.
        unit = str(entry['unit']) if entry['unit'] == 1 else entry['unit']
        if not isinstance(unit, str) or unit not in UNITS:
            raise self._fault(
                f'{key}.unit', f"unknown unit '{_plain(unit)}'{closest(unit, UNITS)}"
            )
        si, factor = UNITS[unit]
        if 'rolling_radius' in entry:
            radius = self._of_wheel(entry['rolling_radius'], f'{key}.rolling_radius', wheel)
            if not radius > 0.0:
                raise self._fault(f'{key}.rolling_radius', f'must be above 0 m, got {radius:g}')
            if si != 'm/s':
                raise self._fault(f'{key}.rolling_radius', f'turns m/s into rad/s, not {unit}')
            si, factor = 'rad/s', factor / radius
        if 'scale' in entry:
            factor *= self._of_wheel(entry['scale'], f'{key}.scale', wheel)
            if not math.isfinite(factor):
                raise self._fault(f'{key}.scale', 'is too large')
            return factor
        for pattern, wanted in _UNITS_OF_FIELDS:
            if re.search(pattern, path) and si != wanted:
                raise self._fault(
                    f'{key}.unit', f"must be a unit of {wanted}, '{unit}' is one of {si or '1'}"
                )
        return factor

    def _of_wheel(self, content: Any, key: str, wheel: int) -> float:
        """Number of a wheel, from one number for all wheels or a list."""
        if isinstance(content, list):
            if wheel == _NO_WHEEL:
                raise self._fault(key, 'must be one number: the field has none for each wheel')
            if len(content) != len(self.wheel_names):
                raise self._fault(key, f'{len(content)} values for {len(self.wheel_names)} wheels')
            content = content[wheel]
        return self._finite(content, key)

    def _constant(self, parent: Any, place: int | str, kind: str, value: Any, key: str) -> None:
        if kind == 'string':
            _store(parent, place, self._text(value, key))
            return
        if kind == 'bool' and isinstance(value, bool):
            _store(parent, place, value)
            return
        finite = self._finite(value, key)
        low, high = _RANGES[kind]
        if not low <= finite <= high or not (kind.startswith('float') or finite.is_integer()):
            raise self._fault(key, f'{_shown(value)} does not fit {kind}')
        _store(parent, place, finite if kind.startswith('float') else int(finite))

    # Times

    def time(self, row: int, cell: str) -> int:
        """Stamp of a row.

        Parameters
        ----------
        row : int
            Index of the row, from 0.
        cell : str
            Text in its time column; empty if the map has a rate.

        Returns
        -------
        int
            ns.

        Raises
        ------
        ValueError
            If it is no time or no stamp can hold it.
        """
        if self.time_column is None:
            seconds = self._start + row * self._period
        else:
            number(cell)
            try:
                told = Decimal(cell.strip())
            except InvalidOperation:
                raise ValueError('is not a number') from None
            # Checked first: Decimal would expand a large exponent to that many digits.
            if not abs(told) < Decimal(10) ** 20:
                raise ValueError('is no time')
            seconds = self._start + told * self._second
        if not 0 < seconds <= LAST_SECOND:
            raise ValueError(
                f'gives a stamp of {float(seconds):g} s; stamps are above 0 and at most '
                f'{LAST_SECOND} s: set `start` of `time`'
            )
        return int((seconds * 1_000_000_000).to_integral_value())


def find_map(name: str) -> Path:
    """Path of a map, from its path or the name of a shipped one.

    Parameters
    ----------
    name : str
        Path of a YAML file, or a name such as ``import_t7165s``.

    Returns
    -------
    Path
        The shipped file, or `name` as a path if there is none.
    """
    if Path(name).suffix or Path(name).name != name:
        return Path(name)
    shipped = Path(get_package_share_directory('tractor_io')) / 'config' / f'{name}.yaml'
    return shipped if shipped.is_file() else Path(name)


def import_csv(
    path: Path | str,
    map_path: Path | str,
    output: Path | str,
    progress: Callable[[float], None] | None = None,
) -> Imported:
    """Convert a CSV file to a bag.

    Parameters
    ----------
    path : Path or str
        CSV file, UTF-8, its first line the names of the columns.
    map_path : Path or str
        Map, see `CsvMap`.
    output : Path or str
        Folder of the new bag; must not exist. It appears once it is complete.
    progress : callable, optional
        Called with the share read so far, 0 to 1.

    Returns
    -------
    Imported
        Summary of the import; times in ns.

    Raises
    ------
    CsvImportError
        If the file or the map cannot be used, naming file, line, column and value.
    BagError
        If the bag exists or cannot be written.
    """
    meaning, source, target = CsvMap(map_path), Path(path), Path(output)
    if target.exists():
        raise BagError(f'{target}: exists already, not overwritten')
    try:
        with source.open(encoding='utf-8-sig', newline='') as file:
            target.parent.mkdir(parents=True, exist_ok=True)
            scratch = Path(tempfile.mkdtemp(prefix=f'.{target.name}.', dir=target.parent))
            try:
                rows = _Rows(source, file, meaning, progress)
                found = _write(rows, meaning, scratch / target.name)
                (scratch / target.name).rename(target)
            finally:
                shutil.rmtree(scratch, ignore_errors=True)
    except OSError as error:
        raise CsvImportError(f'{error.filename or source}: {error.strerror or error}') from error
    return Imported(target, *found)


def _write(rows: '_Rows', meaning: CsvMap, folder: Path) -> tuple[int, dict[str, int], int, int]:
    """Write the bag of all rows."""
    table = suite_topics()
    start = end = count = 0
    with BagWriter(folder, meaning.custom_data) as bag:
        made = []
        for name, kind in meaning.topics.items():
            topic = name if name.startswith('/') else f'/{name}'
            bag.add_topic(topic, kind, QOS[table[name].qos])
            message, cells = meaning.message(name)
            placed = [cell._replace(place=rows.place(cell.column)) for cell in cells]
            made.append((topic, message, placed, meaning.skips_empty[name]))
        at = None if meaning.time_column is None else rows.place(meaning.time_column)
        for cells_of_row in rows:
            try:
                time = meaning.time(count, '' if at is None else cells_of_row[at])
            except ValueError as error:
                where = '' if at is None else cells_of_row[at]
                raise rows.fault(meaning.time_column or 'time', where, str(error)) from None
            if count and time < end:
                raise rows.fault(
                    meaning.time_column or 'time', '' if at is None else cells_of_row[at],
                    f'is {(end - time) / 1e9:g} s before the row above',
                )  # fmt: skip
            start, end = (start, time) if count else (time, time)
            count += 1
            for topic, message, cells, skip in made:
                if skip and any(not cells_of_row[cell.place].strip() for cell in cells):
                    continue
                for cell in cells:
                    try:
                        cell.put(cells_of_row[cell.place])
                    except ValueError as error:
                        raise rows.fault(
                            cell.column, cells_of_row[cell.place], str(error)
                        ) from None
                if hasattr(message, 'header'):
                    stamp = message.header.stamp
                    stamp.sec, stamp.nanosec = divmod(time, 1_000_000_000)
                bag.write(topic, time, message)
        if not count:
            raise CsvImportError(f'{rows.path}: holds no rows')
        if not sum(bag.counts.values()):
            raise CsvImportError(f'{rows.path}: every row is left out, as cells are empty')
    return count, dict(bag.counts), start, end


class _Rows:
    """Rows of a file, one at a time, each with as many cells as the header."""

    def __init__(
        self, path: Path, file: TextIO, meaning: CsvMap,
        progress: Callable[[float], None] | None,
    ) -> None:  # fmt: skip
        self.path = path
        self._file = file
        self._map = meaning.path
        self._progress = progress
        self._size = max(1, path.stat().st_size)
        self._line = 0
        self._reader = csv.reader(self._lines(), delimiter=meaning.delimiter, strict=True)
        head = self._next()
        if head is None:
            raise CsvImportError(f'{path}: is empty')
        self._head = [name.strip() for name in head]

    def _lines(self) -> Iterator[str]:
        """Lines of the file; only one line is held in memory."""
        while True:
            try:
                line = self._file.readline(LONGEST_LINE + 1)
            except UnicodeDecodeError as error:
                raise CsvImportError(
                    f'{self.path}: line {self._line + 1} or near it: not text in UTF-8: '
                    f'{error.reason}'
                ) from error
            if not line:
                return
            self._line += 1
            if len(line) > LONGEST_LINE:
                raise CsvImportError(
                    f'{self.path}: line {self._line}: longer than {LONGEST_LINE} characters'
                )
            yield line

    def _next(self) -> list[str] | None:
        """The next row that is not blank."""
        try:
            return next((row for row in self._reader if row), None)
        except csv.Error as error:
            raise CsvImportError(f'{self.path}: line {self._line}: {error}') from error

    def place(self, column: str) -> int:
        """Index of a column."""
        count = self._head.count(column)
        if count != 1:
            hint = ', as the map says' if count else closest(column, map(_plain, self._head))
            reason = 'has several columns' if count else 'has no column'
            raise CsvImportError(
                f"{self.path}: line 1: {reason} '{_plain(column)}'{hint} ({self._map})"
            )
        return self._head.index(column)

    def fault(self, column: str, value: str, reason: str) -> CsvImportError:
        """Error about a cell of the newest row."""
        return CsvImportError(
            f"{self.path}: line {self._line}, column '{_plain(column)}': "
            f"'{_plain(value)}' {reason}"
        )

    def __iter__(self) -> Iterator[list[str]]:
        count = 0
        while (row := self._next()) is not None:
            if len(row) != len(self._head):
                raise CsvImportError(
                    f'{self.path}: line {self._line}: {len(row)} columns, the head has '
                    f'{len(self._head)}'
                )
            if self._progress is not None and count % _PROGRESS_ROWS == 0:
                self._progress(min(1.0, self._file.buffer.tell() / self._size))
            count += 1
            yield row


def _store(parent: Any, key: int | str, value: Any) -> None:
    if isinstance(key, int):
        parent[key] = value
    else:
        setattr(parent, key, value)


def _plain(value: Any) -> str:
    """Short, printable form of a name or value for an error message."""
    text = value if isinstance(value, str) else repr(value)
    text = ''.join(c if c.isprintable() else '\ufffd' for c in text[:60])
    return text if len(text) < 60 else text + '…'


def _shown(value: Any) -> str:
    if isinstance(value, dict | list):
        return 'a mapping' if isinstance(value, dict) else 'a list'
    return _plain(value) if isinstance(value, str) else _plain(repr(value))
