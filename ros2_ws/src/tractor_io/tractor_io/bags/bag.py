"""Bags: the suite's one reader and one writer of rosbag2 bags.

Reading goes through `rosbags`, which knows MCAP and sqlite3. Writing goes through `mcap`,
whose chunk size can be chosen and whose chunks carry a checksum; what rosbag2 wants around
the MCAP file (metadata.yaml, message definitions, QoS profiles) is added here.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, NamedTuple, Self

import yaml
from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from mcap.reader import SeekingReader
from mcap.writer import Writer as McapWriter
from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag2,
    MessageDefinitionFormat,
    QosDurability,
    QosReliability,
)
from rosbags.interfaces.typing import Typesdict
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from tractor_io.bags.mcap_limits import LARGEST_RECORD, BoundedFile, limit_rosbags
from tractor_io.bags.plain_yaml import LONGEST_TEXT, load_plain_yaml

INTERFACES = 'traction_interfaces'

METADATA_VERSION = 9
"""Version of metadata.yaml, that of ROS 2 Jazzy."""

CHUNK_SIZE = 256 * 1024
"""Bytes, uncompressed, of one chunk of a written bag."""

LARGEST_INTEGER = 2**63 - 1
"""Largest time, ns, and largest depth of a queue."""

MAX_HELD = 512 * 1024 * 1024
"""Bytes of chunks whose times overlap, all of which have to be held at once to sort them."""

CUSTOM_DATA = 'traction_custom_data'
"""Name of the metadata records of a bag that keep what is said about it; the last one counts."""

MCAP_MAGIC = b'\x89MCAP0\r\n'

# RMW_DURATION_INFINITE: how rosbag2 writes a deadline, lifespan or lease that is not set.
INFINITE = {'sec': 9223372036, 'nsec': 854775807}

limit_rosbags()


class BagError(ValueError):
    """A bag cannot be read or written; the text says which, where and why."""


@dataclass(frozen=True)
class Qos:
    """What of a topic's quality of service a bag has to remember.

    Attributes
    ----------
    reliable : bool
        Reliable, else best effort.
    latched : bool
        Transient local (late subscribers get the last messages), else volatile.
    depth : int
        Messages kept.
    """

    reliable: bool = True
    latched: bool = False
    depth: int = 10


QOS = {
    'sensor_data': Qos(reliable=False, depth=5),
    'command': Qos(depth=1),
    'latched': Qos(latched=True, depth=1),
    'reliable': Qos(depth=10),
}
"""Quality of service by its name in the suite's table of topics."""


@dataclass(frozen=True)
class Topic:
    """A topic of a bag.

    Attributes
    ----------
    type : str
        Message type, such as ``sensor_msgs/msg/JointState``.
    count : int
        Number of messages.
    qos : Qos
        Quality of service it was published with.
    """

    type: str
    count: int
    qos: Qos


class Definition(NamedTuple):
    """What a bag has to say about the type of a topic.

    Attributes
    ----------
    type : str
        Message type, such as ``sensor_msgs/msg/JointState``.
    encoding : str
        ``ros2msg`` or ``ros2idl``.
    text : str
        Its definition, with those of the types in it.
    digest : str
        Hash of its description (RIHS01), empty where it is not known.
    """

    type: str
    encoding: str
    text: str
    digest: str


class BagMessage(NamedTuple):
    """A message of a bag.

    Attributes
    ----------
    topic : str
        Topic name as recorded.
    type : str
        Message type, such as ``sensor_msgs/msg/JointState``.
    time : int
        Log time, ns: for bags made by this suite's tools the stamp of the message.
    message : object or bytes
        The message with the fields of its type (arrays are NumPy arrays), or its CDR bytes.
    """

    topic: str
    type: str
    time: int
    message: Any


@cache
def typestore(interfaces: Path | None = None) -> Typestore:
    """Message types of ROS 2 Jazzy and of this suite.

    Parameters
    ----------
    interfaces : Path, optional
        Folder of traction_interfaces (with ``msg/*.msg``); by default its share folder as
        the ament index gives it.

    Returns
    -------
    Typestore
        Gives message classes (``.types``), serializes and deserializes.

    Raises
    ------
    BagError
        When the folder is not found.
    """
    if interfaces is None:
        try:
            interfaces = Path(get_package_share_directory(INTERFACES))
        except PackageNotFoundError:
            raise BagError(
                f'package {INTERFACES} is not in the ament index: build and source the workspace'
            ) from None
    store = get_typestore(Stores.ROS2_JAZZY)
    definitions = sorted((interfaces / 'msg').glob('*.msg'))
    if not definitions:
        raise BagError(f'{interfaces}: holds no msg/*.msg')
    for path in definitions:
        name = f'{INTERFACES}/msg/{path.stem}'
        store.register(get_types_from_msg(path.read_text(encoding='utf-8'), name))
    return store


def known_definition(
    message_type: str, interfaces: Path | None = None, what: str = 'topic'
) -> Definition:
    """Definition of a message type of ROS 2 Jazzy or of this suite.

    Parameters
    ----------
    message_type : str
        Such as ``sensor_msgs/msg/JointState``.
    interfaces : Path, optional
        Folder of traction_interfaces, as for `typestore`.
    what : str
        What has this type, for the error.

    Returns
    -------
    Definition
        Of the type.

    Raises
    ------
    BagError
        If the type is not known.
    """
    store = typestore(interfaces)
    if message_type not in store.fielddefs:
        raise BagError(f'{what} has unknown type {message_type}')
    text, _ = store.generate_msgdef(message_type, ros_version=2)
    return Definition(message_type, 'ros2msg', text, store.hash_rihs01(message_type))


class BagReader:
    """Reads a rosbag2 bag, MCAP or sqlite3, as a context manager.

    Parameters
    ----------
    path : Path or str
        Bag folder, or a lone ``.mcap`` or ``.db3`` file.
    interfaces : Path, optional
        Folder of traction_interfaces, as for `typestore`.

    Attributes
    ----------
    path : Path
        As given.
    topics : dict of str to Topic
        Its topics, sorted by name.
    start, end : int
        Log times of the first and last message, ns; both 0 for an empty bag.
    custom_data : dict of str to str
        What its writer says about it.

    Raises
    ------
    BagError
        Where the path does not exist, is no bag, or is cut short.
    """

    def __init__(self, path: Path | str, interfaces: Path | None = None):
        self.path = Path(path)
        if not self.path.exists():
            raise BagError(f'{self.path}: no such file or folder')
        if self.path.is_dir() and not (self.path / 'metadata.yaml').is_file():
            raise BagError(f'{self.path}: not a bag, it has no metadata.yaml')
        if self.path.is_file() and self.path.suffix not in ('.mcap', '.db3'):
            raise BagError(f'{self.path}: not a bag, expected a folder, .mcap or .db3')
        for part in sorted(self.path.glob('*.mcap')) if self.path.is_dir() else [self.path]:
            if part.suffix == '.mcap':
                _check_complete(part)
        self._interfaces = interfaces
        self._store: Typestore | None = None
        if self.path.is_dir():
            self._attempt(self._check_metadata)
        self._reader = self._attempt(lambda: Reader(self.path))
        try:
            self._attempt(self._open)
        except BagError:
            self.close()
            raise

    def _open(self) -> None:
        self._reader.open()
        reader = self._reader
        _check_overlap(reader.storage)
        for connection in reader.connections:
            if not (isinstance(connection.topic, str) and connection.topic):
                raise ValueError(f'a topic is named {_start_of(connection.topic)!r}')
        self.topics = {
            topic: _topic(info.connections) for topic, info in sorted(reader.topics.items())
        }
        # rosbags ends a bag one nanosecond after its last message.
        self.start = _integer(reader.start_time) if reader.message_count else 0
        self.end = _integer(reader.end_time - 1) if reader.message_count else 0
        self.custom_data = self._custom_data()

    def _check_metadata(self) -> None:
        """Read metadata.yaml within limits, before rosbags does without."""
        with (self.path / 'metadata.yaml').open(encoding='utf-8') as file:
            load_plain_yaml(file.read(LONGEST_TEXT + 1))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the bag."""
        if self._reader.is_open:
            self._reader.close()

    @property
    def duration(self) -> float:
        """Time from the first to the last message, s."""
        return (self.end - self.start) / 1e9

    def messages(
        self, topics: Sequence[str] = (), start_offset: float = 0.0, raw: bool = False
    ) -> Iterator[BagMessage]:
        """Yield messages in total order: by log time, then in the order of the file.

        Parameters
        ----------
        topics : sequence of str
            Topics wanted, all when empty; the leading slash may be left out.
        start_offset : float
            Skip what lies less than this after the start of the bag, s, at least 0.
        raw : bool
            Give CDR bytes instead of messages.

        Yields
        ------
        BagMessage

        Raises
        ------
        BagError
            When a wanted topic is not in the bag, or the bag is damaged.
        """
        connections = self._connections(topics)
        start = self.start + round(start_offset * 1e9) if start_offset > 0 else None
        decode = None if raw else self._attempt(self._typestore).deserialize_cdr
        # An empty list would mean every connection to rosbags.
        if not connections:
            return
        try:
            for connection, time, data in self._reader.messages(connections, start=start):
                message = data if decode is None else self._decode(decode, connection, time, data)
                yield BagMessage(connection.topic, connection.msgtype, time, message)
        except BagError:
            raise
        except Exception as error:
            raise self._damage(error) from error

    def definition(self, topic: str) -> Definition:
        """What the bag says about the type of a topic.

        Parameters
        ----------
        topic : str
            Name, with its leading slash.

        Returns
        -------
        Definition
            That of the bag, or where it has none, as in sqlite3, that of the suite.

        Raises
        ------
        BagError
            If the topic is not in the bag, or its type not known to either.
        """
        self.find([topic])
        connection = next(each for each in self._reader.connections if each.topic == topic)
        encodings = {
            MessageDefinitionFormat.MSG: 'ros2msg',
            MessageDefinitionFormat.IDL: 'ros2idl',
        }
        if connection.msgdef.format in encodings:
            return Definition(
                connection.msgtype,
                encodings[connection.msgdef.format],
                connection.msgdef.data,
                connection.digest,
            )
        return known_definition(connection.msgtype, self._interfaces, f'{self.path}: {topic}')

    def find(self, topics: Iterable[str]) -> set[str]:
        """Look up topics.

        Parameters
        ----------
        topics : iterable of str
            Names; the leading slash may be left out.

        Returns
        -------
        set of str
            Their names in this bag.

        Raises
        ------
        BagError
            Naming those that are missing and those that are there.
        """
        wanted = {f'/{topic.lstrip("/")}' for topic in topics}
        missing = sorted(wanted - set(self.topics))
        if missing:
            there = ', '.join(self.topics) or 'none'
            raise BagError(f'{self.path}: no topic {", ".join(missing)}; it holds: {there}')
        return wanted

    def _connections(self, topics: Sequence[str]) -> list[Connection]:
        wanted = self.find(topics)
        return [
            connection
            for connection in self._reader.connections
            if not wanted or connection.topic in wanted
        ]

    def _typestore(self) -> Typestore:
        """Types to decode with; those only the bag knows come from its own definitions."""
        if self._store is None:
            self._store = typestore(self._interfaces)
            parse = {
                MessageDefinitionFormat.MSG: get_types_from_msg,
                MessageDefinitionFormat.IDL: lambda text, _: get_types_from_idl(text),
            }
            own: Typesdict = {}
            for connection in self._reader.connections:
                definition = connection.msgdef
                if connection.msgtype not in self._store.fielddefs and definition.format in parse:
                    own |= parse[definition.format](definition.data, connection.msgtype)
            if own:
                # The cached store stays free of what one bag calls its types.
                self._store = typestore.__wrapped__(self._interfaces)
                known = self._store.fielddefs
                self._store.register({k: v for k, v in own.items() if k not in known})
        return self._store

    def _decode(
        self, decode: Callable[..., Any], connection: Connection, time: int, data: bytes
    ) -> Any:
        try:
            return decode(data, connection.msgtype)
        except Exception as error:
            raise BagError(
                f'{self.path}: message on {connection.topic} at {time} ns is not a valid '
                f'{connection.msgtype}: {error!r}'
            ) from error

    def _custom_data(self) -> dict[str, str]:
        if self.path.is_dir():
            return _texts(self._reader.storage.metadata.custom)
        if self.path.suffix == '.mcap':
            with self.path.open('rb') as file:
                bounded: Any = BoundedFile(file)
                reader = SeekingReader(bounded, record_size_limit=LARGEST_RECORD)
                for record in reader.iter_metadata():
                    if record.name == 'rosbag2':
                        metadata = load_plain_yaml(record.metadata['serialized_metadata'])
                        return _texts(metadata.get('custom_data'))
        return {}

    def _attempt(self, action: Callable[[], Any]) -> Any:
        try:
            return action()
        except BagError:
            raise
        except Exception as error:
            raise self._damage(error) from error

    def _damage(self, error: Exception) -> BagError:
        """What to raise for damaged bytes.

        They surface as whatever the parser trips over, from struct.error to
        UnicodeDecodeError: at this boundary every failure means a damaged bag.
        """
        return BagError(f'{self.path}: damaged bag: {str(error) or repr(error)}')


def _check_complete(path: Path) -> None:
    with path.open('rb') as file:
        head = file.read(len(MCAP_MAGIC))
        file.seek(0, 2)
        length = file.tell()
        file.seek(max(0, length - len(MCAP_MAGIC)))
        tail = file.read()
    if not MCAP_MAGIC.startswith(head) or not head:
        raise BagError(f'{path}: not an MCAP file')
    if length < 2 * len(MCAP_MAGIC) or tail != MCAP_MAGIC:
        raise BagError(
            f'{path}: cut short after {length} bytes, its writer was stopped or the copy failed'
        )


def _integer(value: Any) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= LARGEST_INTEGER:
        raise ValueError(f'{_start_of(value)!r} is no whole number of 0 to {LARGEST_INTEGER}')
    return value


def _start_of(value: Any) -> str:
    return str(value)[:60]


def _texts(custom: Any) -> dict[str, str]:
    return {str(key): str(value) for key, value in dict(custom or {}).items()}


def _check_overlap(storage: Any) -> None:
    """Refuse chunks that all have to be unpacked at once, as bags of recorders never are."""
    for each in getattr(storage, 'storages', [storage]):
        edges = []
        for chunk in getattr(each, 'chunks', ()):
            edges.append((chunk.message_start_time, chunk.uncompressed_size))
            edges.append((chunk.message_end_time + 1, -chunk.uncompressed_size))
        held = 0
        for _, size in sorted(edges):
            held += size
            if held > MAX_HELD:
                raise ValueError(f'chunks of one time claim more than {MAX_HELD} bytes')


def _topic(connections: Sequence[Connection]) -> Topic:
    first = connections[0]
    count = sum(connection.msgcount for connection in connections)
    profiles = [
        profile
        for connection in connections
        if isinstance(connection.ext, ConnectionExtRosbag2)
        for profile in connection.ext.offered_qos_profiles
    ]
    if not profiles:
        return Topic(first.msgtype, count, Qos())
    qos = Qos(
        reliable=all(p.reliability != QosReliability.BEST_EFFORT for p in profiles),
        latched=all(p.durability == QosDurability.TRANSIENT_LOCAL for p in profiles),
        depth=max(_integer(profile.depth) for profile in profiles),
    )
    return Topic(first.msgtype, count, qos)


class BagWriter:
    """Writes a bag: a folder with one MCAP file and metadata.yaml, as a context manager.

    The same calls give the same bytes. Left by an exception, or never closed, the bag stays
    without index and metadata.yaml; what was flushed is in it, see `tractor_io.bags.repair`.

    Parameters
    ----------
    path : Path or str
        Folder to make; must not exist.
    custom_data : mapping of str to str
        What to say about the bag, such as vehicle, soil, source.
    interfaces : Path, optional
        Folder of traction_interfaces, as for `typestore`.

    Attributes
    ----------
    path : Path
        As given.
    counts : dict of str to int
        Messages written so far on every topic.

    Raises
    ------
    BagError
        Where the path exists or cannot be written.
    """

    def __init__(
        self,
        path: Path | str,
        custom_data: Mapping[str, str] | None = None,
        interfaces: Path | None = None,
    ):
        self.path = Path(path)
        self.counts: dict[str, int] = {}
        self._custom_data = dict(custom_data or {})
        self._store = typestore(interfaces)
        self._topics: dict[str, dict[str, Any]] = {}
        self._channels: dict[str, int] = {}
        self._schemas: dict[tuple[str, str, str], int] = {}
        self._interfaces = interfaces
        self._first: int | None = None
        self._last = 0
        self._file_name = f'{self.path.name}.mcap'
        try:
            self.path.mkdir(parents=True)
            self._file: BinaryIO = (self.path / self._file_name).open('xb')
        except FileExistsError:
            raise BagError(f'{self.path}: exists already, not overwritten') from None
        except OSError as error:
            raise self._failure(error) from error
        self._writer = McapWriter(self._file, chunk_size=CHUNK_SIZE)
        self._writer.start(profile='ros2', library='tractor_io')
        if self._custom_data:
            # At the end it is said once more, where rosbag2 looks for it.
            self._writer.add_metadata(CUSTOM_DATA, self._custom_data)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self.close()
        else:
            self.abort()

    def say(self, custom_data: Mapping[str, str]) -> None:
        """Add to what is said about the bag.

        Parameters
        ----------
        custom_data : mapping of str to str
            What is new or has changed.

        Raises
        ------
        BagError
            When writing fails, such as on a full disk.
        """
        self._custom_data |= custom_data
        # Metadata stand between chunks.
        self.flush()
        try:
            self._writer.add_metadata(CUSTOM_DATA, self._custom_data)
        except OSError as error:
            raise self._failure(error) from error

    def add_topic(
        self, topic: str, message_type: str | Definition, qos: Qos | None = None
    ) -> None:
        """Declare a topic.

        Parameters
        ----------
        topic : str
            Name, with its leading slash.
        message_type : str or Definition
            Such as ``sensor_msgs/msg/JointState``; of a type that the suite does not know, what
            another bag says about it.
        qos : Qos, optional
            Quality of service the topic is published with; reliable when left out.

        Raises
        ------
        BagError
            For an unknown message type or a topic declared twice.
        """
        if isinstance(message_type, str):
            message_type = known_definition(
                message_type, self._interfaces, f'{self.path}: topic {topic}'
            )
        if topic in self._topics:
            raise BagError(f'{self.path}: topic {topic} is declared twice')
        name, encoding, text, digest = message_type
        schema = (name, encoding, text)
        if schema not in self._schemas:
            self._schemas[schema] = self._writer.register_schema(name, encoding, text.encode())
        profiles = [_profile(qos or Qos())]
        self._channels[topic] = self._writer.register_channel(
            topic,
            'cdr',
            self._schemas[schema],
            {'offered_qos_profiles': _yaml(profiles), 'topic_type_hash': digest},
        )
        self.counts[topic] = 0
        self._topics[topic] = {
            'name': topic,
            'type': name,
            'serialization_format': 'cdr',
            'offered_qos_profiles': profiles,
            'type_description_hash': digest,
        }

    def write(self, topic: str, time: int, message: Any) -> None:
        """Append a message.

        Parameters
        ----------
        topic : str
            A declared topic.
        time : int
            Log time, ns, at least 0.
        message : object or bytes
            A message of `typestore`'s class, or CDR bytes.

        Raises
        ------
        BagError
            For an undeclared topic, a message that does not fit its type, or when writing
            fails, such as on a full disk.
        """
        if topic not in self._channels:
            raise BagError(f'{self.path}: topic {topic} was not declared')
        if isinstance(message, bytes):
            data = message
        else:
            try:
                message_type = self._topics[topic]['type']
                data = bytes(self._store.serialize_cdr(message, message_type))
            except Exception as error:
                raise BagError(
                    f'{self.path}: message for {topic} at {time} ns does not fit its type: {error}'
                ) from error
        try:
            self._writer.add_message(self._channels[topic], time, data, time, self.counts[topic])
        except OSError as error:
            raise self._failure(error) from error
        self.counts[topic] += 1
        self._first = time if self._first is None else min(self._first, time)
        self._last = max(self._last, time)

    def flush(self) -> None:
        """Hand all that was written to the operating system, as a finished chunk.

        A process that is killed afterwards loses nothing of it.

        Raises
        ------
        BagError
            When writing fails, such as on a full disk.
        """
        try:
            # The library finishes a chunk by itself only once it is full.
            self._writer._Writer__finalize_chunk()  # type: ignore[attr-defined]
            self._file.flush()
        except OSError as error:
            raise self._failure(error) from error

    def close(self) -> None:
        """Finish the MCAP file and write metadata.yaml.

        Raises
        ------
        BagError
            When writing fails, such as on a full disk.
        """
        if self._file.closed:
            return
        metadata = self._metadata()
        try:
            self._writer.add_metadata('rosbag2', {'serialized_metadata': _yaml(metadata)})
            self._writer.finish()
            self._file.close()
            text = _yaml({'rosbag2_bagfile_information': metadata}) + '\n'
            (self.path / 'metadata.yaml').write_text(text, encoding='utf-8')
        except OSError as error:
            self.abort()
            raise self._failure(error) from error

    def abort(self) -> None:
        """Let go of the file as it is, without index and metadata.yaml."""
        with suppress(OSError):  # closing flushes: on a full disk it fails once more
            self._file.close()

    def _metadata(self) -> dict[str, Any]:
        first = self._first or 0
        span = {
            'duration': {'nanoseconds': self._last - first},
            'starting_time': {'nanoseconds_since_epoch': first},
            'message_count': sum(self.counts.values()),
        }
        return {
            'version': METADATA_VERSION,
            'storage_identifier': 'mcap',
            **span,
            'topics_with_message_count': [
                {'topic_metadata': topic, 'message_count': self.counts[name]}
                for name, topic in self._topics.items()
            ],
            # Chunks are compressed inside the MCAP file, which rosbag2 does not count.
            'compression_format': '',
            'compression_mode': '',
            'relative_file_paths': [self._file_name],
            'files': [{'path': self._file_name, **span}],
            'custom_data': self._custom_data or None,
            'ros_distro': 'jazzy',
        }

    def _failure(self, error: OSError) -> BagError:
        return BagError(f'{self.path}: cannot write: {error.strerror or error}')


def _profile(qos: Qos) -> dict[str, Any]:
    return {
        'history': 'keep_last',
        'depth': qos.depth,
        'reliability': 'reliable' if qos.reliable else 'best_effort',
        'durability': 'transient_local' if qos.latched else 'volatile',
        'deadline': INFINITE,
        'lifespan': INFINITE,
        'liveliness': 'automatic',
        'liveliness_lease_duration': INFINITE,
        'avoid_ros_namespace_conventions': False,
    }


class _PlainDumper(yaml.SafeDumper):
    def ignore_aliases(self, data: Any) -> bool:
        # rosbag2's reader is happier with repeated values than with YAML anchors.
        return True


def _yaml(data: Any) -> str:
    return yaml.dump(data, Dumper=_PlainDumper, sort_keys=False, allow_unicode=True).strip()
