"""Size limits for reading bags: records, whole numbers, unpacked chunks.

A damaged or malicious file can declare a record of 2^60 bytes, or have a small chunk that unpacks
to gigabytes. The libraries that read bags do not check this. The limits are above what recorders
write.
"""

from types import SimpleNamespace
from typing import Any, BinaryIO

import lz4.frame
import zstandard
from rosbags.rosbag2 import reader, storage_mcap

LARGEST_RECORD = 64 * 1024 * 1024
"""Largest record and largest unpacked chunk, bytes; a file with more counts as damaged."""

LARGEST_INTEGER = 2**63 - 1
"""Largest time, ns, and largest depth of a queue."""


class BoundedFile:
    """File for reading, with a limit on the size of one read.

    Parameters
    ----------
    file : file object
        Opened for reading, binary.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.seek = file.seek
        self.tell = file.tell

    def read(self, size: int = -1) -> bytes:
        """Read bytes.

        Parameters
        ----------
        size : int
            Number of bytes, at most `LARGEST_RECORD`; below 0: `LARGEST_RECORD`.

        Returns
        -------
        bytes
            Fewer at the end of the file.

        Raises
        ------
        ValueError
            If the size is above the limit.
        """
        if size > LARGEST_RECORD:
            raise ValueError(f'{size} bytes are claimed, more than {LARGEST_RECORD}')
        return self._file.read(LARGEST_RECORD if size < 0 else size)


def whole_number(value: Any) -> int:
    """Check a time or the depth of a queue.

    Parameters
    ----------
    value : object
        Value in the file; times in ns.

    Returns
    -------
    int
        The value, 0 to `LARGEST_INTEGER`; times in ns.

    Raises
    ------
    ValueError
        If it is no whole number in that range.
    """
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= LARGEST_INTEGER:
        raise ValueError(f'{str(value)[:60]!r} is no whole number of 0 to {LARGEST_INTEGER}')
    return value


def unpack(data: bytes, compression: str, size: int) -> bytes:
    """Unpack a chunk, up to its declared size.

    Parameters
    ----------
    data : bytes
        Chunk as stored in the file.
    compression : str
        ``zstd``, ``lz4`` or nothing.
    size : int
        Declared size, bytes.

    Returns
    -------
    bytes
        At most one byte more than declared, which shows that the size is wrong.

    Raises
    ------
    ValueError
        If the size is above `LARGEST_RECORD`, or the compression is unknown.
    """
    if size > LARGEST_RECORD:
        raise ValueError(f'a chunk claims {size} bytes, more than {LARGEST_RECORD}')
    if not compression:
        return data
    if compression == 'lz4':
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1))
    if compression != 'zstd':
        raise ValueError(f"unknown compression '{compression[:60]}'")
    return _unzstd(data, size + 1)


def _unzstd(data: bytes, most: int) -> bytes:
    window = zstandard.ZstdDecompressor(max_window_size=LARGEST_RECORD)
    with window.stream_reader(data, read_across_frames=True) as stream:
        return bytes(stream.read(most))


def _message(data: bytes) -> bytes:
    """Unpack a message that is compressed on its own."""
    found = _unzstd(data, LARGEST_RECORD + 1)
    if len(found) > LARGEST_RECORD:
        raise ValueError(f'a message unpacks to more than {LARGEST_RECORD} bytes')
    return found


def _read_exact(bio: BinaryIO, size: int) -> bytes:
    """Read from a file or a chunk, never more than a record."""
    at = bio.tell()
    found = BoundedFile(bio).read(size)
    if len(found) != size:
        raise ValueError(f'cut short at byte {at}: {size} bytes expected, {len(found)} found')
    return found


def limit_rosbags() -> None:
    """Replace the reading functions of rosbags, which have no limits, by these."""
    # The original allocates the declared size.
    storage_mcap.read_exact = _read_exact
    storage_mcap.DECOMPRESSORS.update(
        zstd=lambda data, size: unpack(data, 'zstd', size),
        lz4=lambda data, size: unpack(data, 'lz4', size),
    )
    bounded: Any = SimpleNamespace(open=reader.zstd.open, decompress=_message)
    reader.zstd = bounded
