"""Interfaces to a CAN bus by name, over python-can.

``socketcan`` is a CAN device of Linux. ``udp_multicast`` is a bus over the loopback of this
machine; its hop limit is 0, so no packet leaves the machine. ``virtual`` is a bus within one
process. ``candump`` plays a recorded log at its recorded pace and cannot send.
"""

import socket
import threading
import time
from pathlib import Path
from typing import Any, NamedTuple

import can


class Interface(NamedTuple):
    """One kind of access to a bus.

    Attributes
    ----------
    channel : str
        Default channel: name of the bus, or multicast address.
    over_udp : bool
        The bus has a port and echoes sent frames.
    is_log : bool
        The bus is a recorded log; sending is an error.
    """

    channel: str
    over_udp: bool = False
    is_log: bool = False


INTERFACES = {
    'socketcan': Interface('can0'),
    'udp_multicast': Interface('239.74.163.2', over_udp=True),
    'virtual': Interface('traction'),
    'candump': Interface('', is_log=True),
}
"""Interfaces by name."""

DEFAULT_PORT = 43113
"""Port of a bus over UDP."""


class BusError(ValueError):
    """Error of opening a bus; the text names bus and reason."""


def find_interface(name: str) -> Interface:
    """Interface of a name.

    Parameters
    ----------
    name : str
        One of `INTERFACES`.

    Returns
    -------
    Interface
        Its properties.

    Raises
    ------
    BusError
        If the name is unknown; the text lists the known ones.
    """
    if name not in INTERFACES:
        raise BusError(f"unknown CAN interface '{name}': there are {', '.join(INTERFACES)}")
    return INTERFACES[name]


def open_bus(interface: str, channel: str = '', port: int = DEFAULT_PORT) -> can.BusABC:
    """Open a bus.

    Parameters
    ----------
    interface : str
        One of `INTERFACES`.
    channel : str
        Name of the bus, multicast address, or path of the log; empty for the default.
    port : int
        Of a bus over UDP, 1 to 65535.

    Returns
    -------
    can.BusABC
        Of python-can: `recv`, `send` and `shutdown`.

    Raises
    ------
    BusError
        If the interface is unknown, the port is out of range, or the bus cannot be opened.
    """
    kind = find_interface(interface)
    if not 1 <= port <= 65535:
        raise BusError(f'port must be 1 to 65535, got {port}')
    channel = channel or kind.channel
    if kind.is_log:
        return CandumpBus(Path(channel))
    options: dict[str, Any] = {}
    if kind.over_udp:
        options = {'port': port, 'hop_limit': 0, 'fd': False}
    try:
        return can.Bus(interface=interface, channel=channel, **options)
    except (can.CanError, OSError, ValueError) as error:
        raise BusError(f"CAN interface {interface}, channel '{channel}': {error}") from error


def free_port() -> int:
    """Unused port for a bus over UDP.

    Returns
    -------
    int
        Number of the port, dimensionless.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as found:
        found.bind(('127.0.0.1', 0))
        return int(found.getsockname()[1])


class CandumpBus(can.BusABC):
    """Recorded log (`candump -l`) as a bus, for reading only.

    Parameters
    ----------
    path : Path
        Path of the log.

    Raises
    ------
    BusError
        If there is no such file.
    """

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise BusError(f'{path}: no such candump log')
        super().__init__(channel=str(path))
        self._path = path
        self._reader = can.CanutilsLogReader(str(path))
        self._messages = iter(self._reader)
        self._next: can.Message | None = None
        # Offset from time in the log to steady time, s.
        self._offset: float | None = None
        self._ended = threading.Event()

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if self._next is None:
            try:
                self._next = next(self._messages, None)
            except (ValueError, IndexError) as error:
                raise can.CanOperationError(f'{self._path}: damaged line: {error}') from error
        if self._next is None:
            # End of the log: no more frames.
            self._ended.wait(timeout)
            return None, False
        now = time.monotonic()
        if self._offset is None:
            self._offset = now - self._next.timestamp
        ahead = self._next.timestamp + self._offset - now
        if ahead > 0.0:
            self._ended.wait(ahead if timeout is None else min(ahead, timeout))
            if timeout is not None and ahead > timeout:
                return None, False
        message, self._next = self._next, None
        return message, False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Raise an error: a log is for reading only.

        Parameters
        ----------
        msg : can.Message
            A frame.
        timeout : float or None
            Without effect, s.

        Raises
        ------
        can.CanOperationError
            Always.
        """
        raise can.CanOperationError(f'{self._path}: a log cannot be sent to')

    def shutdown(self) -> None:
        """Close the log and end a waiting `recv`."""
        self._ended.set()
        self._reader.stop()
        super().shutdown()


def frame(identifier: int, data: bytes) -> can.Message:
    """Frame to send, as python-can has it.

    Parameters
    ----------
    identifier : int
        29 bits.
    data : bytes
        At most 8 bytes.

    Returns
    -------
    can.Message
        Of python-can.
    """
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=True, check=True)
