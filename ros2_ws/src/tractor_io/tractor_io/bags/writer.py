"""Writer of rosbag2 bags: a folder with one MCAP file and metadata.yaml.

`mcap` writes the file in chunks with checksums; a chunk can be finished at any time. This module
adds what rosbag2 needs: metadata.yaml, message definitions and quality of service.
"""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self

from mcap.writer import Writer as McapWriter

from traction_node.quality_of_service import Qos
from tractor_io.bags.bag_error import BagError
from tractor_io.bags.message_types import MessageDefinition, known_definition, typestore
from tractor_io.bags.offered_qos import profile_of, to_channel
from tractor_io.bags.plain_yaml import dump_plain_yaml

METADATA_VERSION = 9
"""Version of metadata.yaml, as in ROS 2 Jazzy."""

CHUNK_SIZE = 256 * 1024
"""Bytes, uncompressed, of one chunk of a written bag."""

CUSTOM_DATA = 'traction_custom_data'
"""Name of the metadata records with the custom data of a bag; the last one is valid."""


class BagWriter:
    """Writer of a bag: a folder with one MCAP file and metadata.yaml; a context manager.

    The same calls write the same bytes. After an exception, or without `close`, the bag has no
    index and no metadata.yaml. It then holds all flushed messages; see `tractor_io.bags.repair`.

    Parameters
    ----------
    path : Path or str
        Folder to make; must not exist.
    custom_data : mapping of str to str
        Description of the bag, such as vehicle, soil, source.
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
        If the path exists or cannot be written.
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
            # `close` writes it again to metadata.yaml, where rosbag2 reads it.
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
        """Add to the custom data.

        Parameters
        ----------
        custom_data : mapping of str to str
            New and changed entries.

        Raises
        ------
        BagError
            If writing fails, for example on a full disk.
        """
        self._custom_data |= custom_data
        # Metadata records stand between chunks.
        self.flush()
        try:
            self._writer.add_metadata(CUSTOM_DATA, self._custom_data)
        except OSError as error:
            raise self._failure(error) from error

    def add_topic(
        self, topic: str, message_type: str | MessageDefinition, qos: Qos | None = None
    ) -> None:
        """Declare a topic.

        Parameters
        ----------
        topic : str
            Name, with its leading slash.
        message_type : str or MessageDefinition
            Such as ``sensor_msgs/msg/JointState``; for a type unknown to the suite, its
            definition from another bag.
        qos : Qos, optional
            Quality of service of the publisher; default: reliable.

        Raises
        ------
        BagError
            If the message type is unknown or the topic is declared twice.
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
        qos = qos or Qos()
        self._channels[topic] = self._writer.register_channel(
            topic, 'cdr', self._schemas[schema], {**to_channel(qos), 'topic_type_hash': digest}
        )
        self.counts[topic] = 0
        self._topics[topic] = {
            'name': topic,
            'type': name,
            'serialization_format': 'cdr',
            'offered_qos_profiles': [profile_of(qos)],
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
            If the topic is not declared, the message does not fit its type, or writing fails,
            for example on a full disk.
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
        """Finish the chunk and pass it to the operating system.

        The messages written so far then survive a kill of the process.

        Raises
        ------
        BagError
            If writing fails, for example on a full disk.
        """
        try:
            self._writer.flush()
        except OSError as error:
            raise self._failure(error) from error

    def close(self) -> None:
        """Finish the MCAP file and write metadata.yaml.

        Raises
        ------
        BagError
            If writing fails, for example on a full disk.
        """
        if self._file.closed:
            return
        metadata = self._metadata()
        try:
            self._writer.add_metadata(
                'rosbag2', {'serialized_metadata': dump_plain_yaml(metadata)}
            )
            self._writer.finish()
            self._file.close()
            text = dump_plain_yaml({'rosbag2_bagfile_information': metadata}) + '\n'
            (self.path / 'metadata.yaml').write_text(text, encoding='utf-8')
        except OSError as error:
            self.abort()
            raise self._failure(error) from error

    def abort(self) -> None:
        """Close the file without index and metadata.yaml."""
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
            # rosbag2 means compression of the whole file, not of chunks inside.
            'compression_format': '',
            'compression_mode': '',
            'relative_file_paths': [self._file_name],
            'files': [{'path': self._file_name, **span}],
            'custom_data': self._custom_data or None,
            'ros_distro': 'jazzy',
        }

    def _failure(self, error: OSError) -> BagError:
        return BagError(f'{self.path}: cannot write: {error.strerror or error}')
