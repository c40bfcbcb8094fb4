"""Reader of rosbag2 bags, MCAP and sqlite3, over `rosbags` and within limits of size."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from mcap.reader import SeekingReader
from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinitionFormat
from rosbags.interfaces.typing import Typesdict
from rosbags.rosbag2 import Reader
from rosbags.typesys import get_types_from_idl, get_types_from_msg
from rosbags.typesys.store import Typestore

from traction_node.bounded_yaml import load_yaml, read_yaml
from traction_node.quality_of_service import Qos
from tractor_io.bags.bag_error import BagError
from tractor_io.bags.mcap_limits import LARGEST_RECORD, BoundedFile, limit_rosbags, whole_number
from tractor_io.bags.message_types import MessageDefinition, known_definition, typestore
from tractor_io.bags.offered_qos import common_qos

MAX_HELD = 512 * 1024 * 1024
"""Limit of the chunks whose times overlap, bytes: sorting holds all of them in memory."""

MCAP_MAGIC = b'\x89MCAP0\r\n'

limit_rosbags()


@dataclass(frozen=True)
class BagTopic:
    """A topic of a bag.

    Attributes
    ----------
    type : str
        Message type, such as ``sensor_msgs/msg/JointState``.
    count : int
        Number of messages.
    qos : Qos
        Quality of service of its publishers.
    """

    type: str
    count: int
    qos: Qos


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


class BagReader:
    """Reader of a rosbag2 bag, MCAP or sqlite3; a context manager.

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
    topics : dict of str to BagTopic
        Its topics, sorted by name.
    start, end : int
        Log times of the first and last message, ns; both 0 for an empty bag.
    custom_data : dict of str to str
        Custom data of the bag.

    Raises
    ------
    BagError
        If the path does not exist, is no bag, or is cut short.
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
                raise ValueError(f'a topic is named {str(connection.topic)[:60]!r}')
        self.topics = {
            topic: _topic(info.connections) for topic, info in sorted(reader.topics.items())
        }
        # rosbags ends a bag one nanosecond after its last message.
        self.start = whole_number(reader.start_time) if reader.message_count else 0
        self.end = whole_number(reader.end_time - 1) if reader.message_count else 0
        self.custom_data = self._custom_data()

    def _check_metadata(self) -> None:
        """Check metadata.yaml against the limits before rosbags reads it."""
        read_yaml(self.path / 'metadata.yaml')

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
            Topics to read, all if empty; the leading slash may be left out.
        start_offset : float
            Time to skip at the start of the bag, s, at least 0.
        raw : bool
            Yield CDR bytes instead of messages.

        Yields
        ------
        BagMessage

        Raises
        ------
        BagError
            If a topic is not in the bag, or the bag is damaged.
        """
        connections = self._connections(topics)
        start = self.start + round(start_offset * 1e9) if start_offset > 0 else None
        decode = None if raw else self._attempt(self._typestore).deserialize_cdr
        # For rosbags an empty list means all connections.
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

    def definition(self, topic: str) -> MessageDefinition:
        """Definition of the type of a topic.

        Parameters
        ----------
        topic : str
            Name, with its leading slash.

        Returns
        -------
        MessageDefinition
            From the bag, or, if the bag has none (sqlite3), from the suite.

        Raises
        ------
        BagError
            If the topic is not in the bag, or its type is unknown to both.
        """
        self.find([topic])
        connection = next(each for each in self._reader.connections if each.topic == topic)
        encodings = {
            MessageDefinitionFormat.MSG: 'ros2msg',
            MessageDefinitionFormat.IDL: 'ros2idl',
        }
        if connection.msgdef.format in encodings:
            return MessageDefinition(
                connection.msgtype,
                encodings[connection.msgdef.format],
                connection.msgdef.data,
                connection.digest,
            )
        return known_definition(connection.msgtype, self._interfaces, f'{self.path}: {topic}')

    def find(self, topics: Iterable[str]) -> set[str]:
        """Names of topics as in the bag.

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
            If a topic is missing; the text lists the missing and the existing ones.
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
        """Types for decoding: the suite's, and others from the definitions in the bag."""
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
                # A copy, so that types of one bag do not enter the cached store.
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
                        metadata = load_yaml(record.metadata['serialized_metadata'])
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
        """Error for damaged bytes.

        Damaged bytes raise many types of exception in the parsers, from struct.error to
        UnicodeDecodeError. Every one of them means a damaged bag.
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


def _texts(custom: Any) -> dict[str, str]:
    return {str(key): str(value) for key, value in dict(custom or {}).items()}


def _check_overlap(storage: Any) -> None:
    """Reject bags with too many chunks of overlapping times; recorders do not write such bags."""
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


def _topic(connections: Sequence[Connection]) -> BagTopic:
    first = connections[0]
    count = sum(connection.msgcount for connection in connections)
    profiles = [
        profile
        for connection in connections
        if isinstance(connection.ext, ConnectionExtRosbag2)
        for profile in connection.ext.offered_qos_profiles
    ]
    return BagTopic(first.msgtype, count, common_qos(profiles))
