"""Link to an open CAN bus: a receiving thread, frames sent when due, a record of all frames.

A flooded bus must not delay the torque limit. So the thread takes at most `MAX_FRAMES` frames in
one period of the limit; the others stay in the queue of the driver.
"""

import collections
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import can

from traction_node.diagnostic import ERROR, OK, WARN
from tractor_io.can.address_claim import Claim
from tractor_io.can.interface import DEFAULT_PORT, find_interface, frame, open_bus
from tractor_io.can.parameter_group import FrameError, Group
from tractor_io.can.torque_limit import PERIOD
from tractor_io.can.vehicle_bus import Frame, VehicleBus

REPORT_PERIOD = 1.0
"""Time between two regular reports, s."""

LISTEN_PERIOD = 0.1
"""Longest wait for a frame before the thread checks for its end, s."""

FULL_BUS = 0.9 * 250_000 / 128
"""Rate of 8-byte frames above which a bus of 250 kbit/s counts as full, 1/s."""

RETRY_PERIOD = 0.5
"""Pause after two failures in a row, s."""

MAX_RAW_FRAMES = 100
"""Raw frames kept for `take_raw`; further ones are counted as missed."""

MAX_FRAMES = 100
"""Frames taken in one period of the limit; more is a flood and waits for the next period."""

MAX_ECHOES = 16
"""Number of sent frames remembered, to drop their echo on a bus over UDP."""


class Report(NamedTuple):
    """State of the link for a diagnostic.

    Attributes
    ----------
    level : int
        Of `traction_node.diagnostic`.
    text : str
        One line.
    """

    level: int
    text: str


class BusLink:
    """Open bus with a receiving thread; sends on it until it is closed.

    Parameters
    ----------
    bus : VehicleBus
        Decodes received frames and makes the frames to send.
    heard : callable
        Called in the receiving thread with each known message and its steady time, s; may read
        `bus`.
    wall_time : callable
        Returns the time for raw frames, ns.
    interface, channel, port
        As `tractor_io.can.interface.open_bus` takes them.
    log : str
        Path of a candump log to which all frames are added; empty for none.

    Attributes
    ----------
    counts : dict of str to int
        Frames and faults since the bus was opened.

    Raises
    ------
    BusError
        If the bus cannot be opened.
    OSError
        If the log cannot be written.
    """

    def __init__(
        self,
        bus: VehicleBus,
        heard: Callable[[Group, float], None],
        wall_time: Callable[[], int],
        *,
        interface: str,
        channel: str = '',
        port: int = DEFAULT_PORT,
        log: str = '',
    ) -> None:
        self._bus = bus
        self._heard = heard
        self._wall_time = wall_time
        self._kind = find_interface(interface)
        self._channel = channel
        self._lock = threading.Lock()
        self.counts = dict.fromkeys(
            (
                'frames', 'error_frames', 'bad_frames', 'floods', 'bad_torques', 'failures',
                'log_failures',
            ), 0,
        )  # fmt: skip
        self._failure = ''
        # Frames for `take_raw` with their times, and the number of frames dropped.
        self._raw: list[tuple[int, can.Message]] = []
        self._missed = 0
        # Frames sent last whose echo has not come.
        self._echoes: collections.deque[Frame] = collections.deque(maxlen=MAX_ECHOES)
        # Time until which the last flood counts, s.
        self._flooded = 0.0
        self._trouble = ''
        self._counted_at = time.monotonic()
        self._counted = dict(self.counts)
        self._can = open_bus(interface, channel, port)
        try:
            # Appends to the log of an earlier drive.
            self._log = can.CanutilsLogWriter(log, append=True) if log else None
        except OSError:
            self._can.shutdown()
            raise
        self._ended = threading.Event()
        if not self._kind.is_log:
            bus.begin(time.monotonic())
        self._thread = threading.Thread(target=self._listen, name='can', daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Release the engine and close the bus."""
        self._ended.set()
        with self._lock:
            self._bus.end()
            self._send(self._bus.outgoing(time.monotonic()))
        self._thread.join()
        self._can.shutdown()
        if self._log is not None:
            self._log.stop()

    @contextmanager
    def locked(self) -> Iterator[VehicleBus]:
        """The bus, locked against the receiving thread and `send_due`."""
        with self._lock:
            yield self._bus

    def send_due(self) -> None:
        """Send the frames that are due; call it every `tractor_io.can.torque_limit.PERIOD`."""
        with self._lock:
            self._send(self._bus.outgoing(time.monotonic()))

    def take_raw(self) -> tuple[list[tuple[int, can.Message]], int]:
        """Take the raw frames received and sent since the last call.

        Returns
        -------
        frames : list of (int, can.Message)
            Frames with their times, ns.
        missed : int
            Number of frames beyond `MAX_RAW_FRAMES`, which were not kept.
        """
        with self._lock:
            raw, self._raw = self._raw, []
            missed, self._missed = self._missed, 0
        return raw, missed

    def report(self) -> Report:
        """State of the link; of several faults the gravest.

        Returns
        -------
        Report
            Level and text.
        """
        with self._lock:
            return self._report(time.monotonic())

    # Receiving thread

    def _listen(self) -> None:
        taken, until = 0, 0.0
        failing = False
        while not self._ended.is_set():
            try:
                message = self._can.recv(LISTEN_PERIOD)
            except (can.CanError, OSError) as error:
                with self._lock:
                    self._failed(error)
                if failing:
                    self._ended.wait(RETRY_PERIOD)
                failing = True
                continue
            failing = False
            if message is None:
                continue
            now = time.monotonic()
            if now >= until:
                taken, until = 0, now + PERIOD
            elif taken >= MAX_FRAMES:
                # Leaves the processor to the limit; the queue of the driver drops the excess.
                with self._lock:
                    self.counts['floods'] += 1
                    self._flooded = now + REPORT_PERIOD
                self._ended.wait(until - now)
            taken += 1
            with self._lock:
                self._take(message)

    def _take(self, message: can.Message) -> None:
        now = time.monotonic()
        sent = message.arbitration_id, bytes(message.data)
        if sent in self._echoes:
            self._echoes.remove(sent)
            return
        self.counts['frames'] += 1
        self._failure = ''
        self._keep(message)
        if message.is_error_frame:
            self.counts['error_frames'] += 1
            return
        if not message.is_extended_id or message.is_remote_frame:
            # Not J1939.
            return
        try:
            group = self._bus.take(now, message.arbitration_id, bytes(message.data))
        except FrameError:
            self.counts['bad_frames'] += 1
            return
        if group is not None:
            self._heard(group, now)

    def _keep(self, message: can.Message) -> None:
        """Write a frame to the log and keep it for `take_raw`."""
        if self._log is not None:
            try:
                self._log.on_message_received(message)
            except (OSError, ValueError):
                # A full disk must not stop the limit.
                self.counts['log_failures'] += 1
        if len(self._raw) < MAX_RAW_FRAMES:
            self._raw.append((self._wall_time(), message))
        else:
            self._missed += 1

    # Called with the lock held

    def _send(self, frames: Sequence[Frame]) -> None:
        for k, (identifier, data) in enumerate(frames):
            message = frame(identifier, data)
            try:
                self._can.send(message)
            except (can.CanError, OSError) as error:
                self._failed(error)
                self._bus.unsent(time.monotonic(), frames[k:])
                return
            message.timestamp = time.time()
            self._keep(message)
            if self._kind.over_udp:
                self._echoes.append((identifier, data))

    def _failed(self, error: Exception) -> None:
        self.counts['failures'] += 1
        self._failure = str(error)

    def _count(self, now: float) -> None:
        """Look for faults in the frames of the last second, once a second."""
        passed = now - self._counted_at
        if passed < REPORT_PERIOD:
            return
        new = {name: count - self._counted[name] for name, count in self.counts.items()}
        self._counted_at, self._counted = now, dict(self.counts)
        troubles = (
            ('error frames', new['error_frames'] > 0),
            ('frames of a wrong length', new['bad_frames'] > 0),
            ('full of frames', new['frames'] > FULL_BUS * passed),
        )
        self._trouble = ', '.join(text for text, there in troubles if there)

    def _report(self, now: float) -> Report:
        bus, sends = self._bus, not self._kind.is_log
        self._count(now)
        silent = [name for name in ('HRW', 'EEC1', 'GBSD') if bus.watch.silent(now, name)]
        if self._failure:
            return Report(ERROR, f'the bus fails: {self._failure}')
        if sends and not bus.claim.usable:
            # No limit is sent, so only the driver commands the engine.
            level = ERROR if bus.claim.state is Claim.LOST else WARN
            return Report(level, f'no address: {bus.claim.state.value}')
        if now < self._flooded:
            return Report(WARN, f'flooded: over {MAX_FRAMES / PERIOD:.0f} frames/s')
        if silent:
            return Report(ERROR if 'HRW' in silent else WARN, f'silent: {", ".join(silent)}')
        if sends and not bus.commanded(now):
            return Report(WARN, 'no wheel_torque: the engine is limited to none')
        if self._trouble:
            return Report(WARN, f'bus: {self._trouble}')
        if not sends:
            return Report(OK, f'listens to {self._channel}')
        return Report(OK, f'limits the engine from address {bus.claim.address}')
