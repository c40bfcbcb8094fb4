"""Repair of bags whose writer was killed, and cuts of bags.

A bag that was cut short lacks its index and its metadata, but each finished chunk is complete and
has a checksum. Repair reads the file record by record up to the damage and writes the messages to
a new bag. The damaged bag is not changed.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

from mcap.records import Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from traction_node.quality_of_service import Qos
from tractor_io.bags.bag_error import BagError
from tractor_io.bags.mcap_limits import LARGEST_RECORD, BoundedFile, unpack
from tractor_io.bags.message_types import MessageDefinition
from tractor_io.bags.offered_qos import from_channel
from tractor_io.bags.reader import BagReader
from tractor_io.bags.writer import CUSTOM_DATA, BagWriter


@dataclass(frozen=True)
class Repaired:
    """Result of a repair.

    Attributes
    ----------
    path : Path
        The new bag.
    counts : dict of str to int
        Number of messages, by topic.
    start, end : int
        Log times of the first and last message, ns.
    reason : str
        Reason why reading stopped before the end of the file; empty if it did not.
    """

    path: Path
    counts: dict[str, int]
    start: int
    end: int
    reason: str


def repair_bag(
    path: Path | str,
    output: Path | str | None = None,
    progress: Callable[[float], None] | None = None,
) -> Repaired:
    """Copy the readable messages of a damaged MCAP bag to a new one.

    Parameters
    ----------
    path : Path or str
        Bag folder with one MCAP file, or that file.
    output : Path or str, optional
        Folder of the new bag; must not exist. Default: path of the old one plus ``_repaired``.
    progress : callable, optional
        Called with the share read so far, 0 to 1.

    Returns
    -------
    Repaired
        Summary; times in ns.

    Raises
    ------
    BagError
        If there is no MCAP file, nothing in it can be read, or the output exists.
    """
    source = _mcap_of(Path(path))
    folder = source.parent if Path(path).is_dir() else source.with_suffix('')
    target = Path(output) if output is not None else folder.with_name(f'{folder.name}_repaired')
    records = _Records(source, progress)
    first = next(iter(records), None)
    if first is None:
        raise BagError(f'{source}: nothing to repair: {records.reason or "it holds no messages"}')
    start, end = first[1].log_time, first[1].log_time
    with BagWriter(target, records.custom_data) as writer:
        for topic, message in chain([first], records):
            if topic not in writer.counts:
                writer.add_topic(topic, *records.declared(topic))
            writer.write(topic, message.log_time, message.data)
            start, end = min(start, message.log_time), max(end, message.log_time)
        # Includes custom data written after the first message.
        writer.say(records.custom_data)
    return Repaired(target, dict(writer.counts), start, end, records.reason)


def cut_bag(
    path: Path | str,
    output: Path | str,
    start: float = 0.0,
    end: float | None = None,
    topics: Sequence[str] = (),
) -> dict[str, int]:
    """Copy a part of a bag to a new one.

    Parameters
    ----------
    path : Path or str
        Bag.
    output : Path or str
        Folder of the new bag; must not exist.
    start, end : float
        Range of time after its first message, s; `end` None: to the end of the bag.
    topics : sequence of str
        Topics to copy, all if empty; the leading slash may be left out.

    Returns
    -------
    dict of str to int
        Number of messages, by topic.

    Raises
    ------
    BagError
        If the bag cannot be read, a topic is missing, the range is empty, or the output exists.
    """
    if not all(map(math.isfinite, (start, 0.0 if end is None else end))):
        raise BagError(f'{path}: start and end must be finite, got {start} s and {end} s')
    if end is not None and not end > start:
        raise BagError(f'{path}: the end, {end:g} s, must be after the start, {start:g} s')
    with BagReader(path) as reader:
        wanted = sorted(reader.find(topics)) if topics else list(reader.topics)
        last = reader.end if end is None else reader.start + round(end * 1e9)
        inside = (
            message
            for message in reader.messages(wanted, start_offset=start, raw=True)
            if message.time <= last
        )
        first = next(inside, None)
        if first is None:
            raise BagError(f'{path}: nothing to cut, it is {reader.duration:.3f} s long')
        with BagWriter(output, reader.custom_data) as writer:
            for topic in wanted:
                writer.add_topic(topic, reader.definition(topic), reader.topics[topic].qos)
            for message in chain([first], inside):
                writer.write(message.topic, message.time, bytes(message.message))
    return dict(writer.counts)


def _mcap_of(path: Path) -> Path:
    if not path.exists():
        raise BagError(f'{path}: no such file or folder')
    files = sorted(path.glob('*.mcap')) if path.is_dir() else [path]
    if len(files) != 1 or files[0].suffix != '.mcap':
        raise BagError(f'{path}: expected one MCAP file, found {len(files)}')
    return files[0]


class _Records:
    """Messages of an MCAP file up to the damage; for one iteration."""

    def __init__(self, path: Path, progress: Callable[[float], None] | None) -> None:
        self.reason = ''
        self.custom_data: dict[str, str] = {}
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._by_topic: dict[str, Channel] = {}
        self._size = path.stat().st_size
        self._progress = progress
        self._path = path
        self._iterator = self._messages()

    def __iter__(self) -> Iterator[tuple[str, Message]]:
        return self._iterator

    def _messages(self) -> Iterator[tuple[str, Message]]:
        with self._path.open('rb') as file:
            bounded: Any = BoundedFile(file)
            reader = StreamReader(
                bounded,
                emit_chunks=True,
                validate_crcs=True,
                record_size_limit=LARGEST_RECORD,
            )
            records = _unpacked(reader.records)
            while True:
                try:
                    record = next(records, None)
                except Exception as error:
                    # Any exception of the parser means damage at this place.
                    self.reason = f'damaged or cut short at byte {file.tell()}: {error!r}'
                    return
                if record is None:
                    return
                if isinstance(record, Schema):
                    self._schemas[record.id] = record
                elif isinstance(record, Channel):
                    self._channels[record.id] = record
                    self._by_topic[record.topic] = record
                elif isinstance(record, Metadata) and record.name == CUSTOM_DATA:
                    self.custom_data = dict(record.metadata)
                elif isinstance(record, Message):
                    if record.channel_id not in self._channels:
                        self.reason = f'message of unknown channel {record.channel_id}'
                        return
                    if self._progress is not None:
                        self._progress(file.tell() / max(1, self._size))
                    yield self._channels[record.channel_id].topic, record

    def declared(self, topic: str) -> tuple[MessageDefinition, Qos]:
        """Type and quality of service of a topic."""
        channel = self._by_topic[topic]
        schema = self._schemas.get(channel.schema_id)
        if schema is None:
            raise BagError(f'{self._path}: topic {topic} has no message definition')
        definition = MessageDefinition(
            schema.name,
            schema.encoding,
            schema.data.decode(errors='replace'),
            channel.metadata.get('topic_type_hash', ''),
        )
        return definition, from_channel(channel.metadata)


def _unpacked(records: Iterator[McapRecord]) -> Iterator[McapRecord]:
    """Records of a file, with each chunk replaced by its records."""
    for record in records:
        if isinstance(record, Chunk):
            record.data = unpack(record.data, record.compression, record.uncompressed_size)
            record.compression = ''
            yield from breakup_chunk(record, validate_crc=True)
        else:
            yield record
