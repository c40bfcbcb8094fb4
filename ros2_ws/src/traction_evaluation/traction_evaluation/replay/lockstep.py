"""Host of behaviours in lock step: no process, no clock, no middleware.

It runs the behaviours of `traction_node.run` on the time of the caller. The same messages in the
same order give the same bytes.
"""

import logging
from collections import deque
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
from rosbags.typesys.store import Typestore

from traction_node import diagnostic
from traction_node.behaviour import Behaviour
from traction_node.host import Logger
from traction_node.parameter import resolve
from traction_node.stamp import to_stamp_exact
from traction_node.topics import topic
from tractor_io.bags.message_types import zero_message


class LockStep:
    """Message passing between behaviours; each message is handled completely before the next.

    Parameters
    ----------
    types : Typestore
        Message types, from `tractor_io.bags.message_types.typestore`.
    record : callable
        Called for each message with topic (leading slash), type, time (ns) and CDR bytes.
    start : int
        Start time, ns.
    """

    def __init__(
        self, types: Typestore, record: Callable[[str, str, int, bytes], None], start: int
    ):
        self.start = start
        self.now = start
        self._types = types
        self._record = record
        self._subscribers: dict[str, list[Callable[[Any], None]]] = {}
        self._waiting: deque[tuple[str, Any]] = deque()
        self._timers: list[list[Any]] = []

    def add(self, behaviour: type[Behaviour], overrides: Mapping[str, Any]) -> 'LockStepHost':
        """Construct, configure and activate a behaviour.

        Parameters
        ----------
        behaviour : type
            Subclass of `Behaviour`.
        overrides : mapping
            Parameters that differ from their defaults.

        Returns
        -------
        LockStepHost
            Host of the running behaviour.

        Raises
        ------
        ValueError
            If a parameter or a combination is invalid.
        """
        host = LockStepHost(self, behaviour, overrides)
        host.behaviour.configure()
        host.active = True
        host.behaviour.activate()
        return host

    @property
    def inputs(self) -> set[str]:
        """Topics with subscribers, without leading slash."""
        return set(self._subscribers)

    def put(self, name: str, time: int, message: Any) -> None:
        """Advance time and deliver a message.

        Parameters
        ----------
        name : str
            Topic, without leading slash.
        time : int
            Time, ns; not before the last one.
        message : object
            Message with the fields of its type.
        """
        self.advance(time)
        self._waiting.append((name, message))
        self._deliver()

    def advance(self, time: int) -> None:
        """Advance time: timers run at their due times.

        Parameters
        ----------
        time : int
            New time, ns.
        """
        while self._timers:
            timer = min(self._timers, key=lambda entry: entry[0])
            if timer[0] > time:
                break
            self.now = timer[0]
            timer[0] += timer[1]
            timer[2]()
            self._deliver()
        self.now = max(self.now, time)

    def _deliver(self) -> None:
        while self._waiting:
            name, message = self._waiting.popleft()
            for callback in self._subscribers.get(name, ()):
                callback(message)

    def subscribe(self, name: str, callback: Callable[[Any], None]) -> None:
        """Register a callback for the messages of a topic; callbacks run in this order."""
        self._subscribers.setdefault(name, []).append(callback)

    def subscriber_count(self, name: str) -> int:
        """Number of subscribers of a topic."""
        return len(self._subscribers.get(name, ()))

    def timer(self, period: float, callback: Callable[[], None]) -> None:
        """Register a callback with a period, s; the first call comes after one period."""
        step = round(period * 1e9)
        self._timers.append([self.now + step, step, callback])

    def message(self, type_name: str) -> Any:
        """Message of a type, all zero."""
        return zero_message(self._types, type_name)

    def publisher(self, name: str) -> Callable[[Any], None]:
        """Function that publishes to a topic of the suite: record, then deliver."""
        type_name = topic(name).type
        full_name = f'/{name.lstrip("/")}'
        # Sequences of numbers are lists in behaviours and arrays in serialization.
        sequences = [
            (name, value.dtype)
            for name, value in vars(self.message(type_name)).items()
            if isinstance(value, np.ndarray) and not value.size
        ]

        def publish(message: Any) -> None:
            fields = dict(vars(message))
            for field, dtype in sequences:
                fields[field] = np.array(fields[field], dtype)
            data = self._types.serialize_cdr(SimpleNamespace(**fields), type_name)
            self._record(full_name, type_name, self.now, bytes(data))
            self._waiting.append((name, message))

        return publish


class LockStepPublisher:
    """Publisher of a topic in lock step; see `traction_node.host.Publisher`.

    Parameters
    ----------
    publish : callable
        Records a message and delivers it.
    subscribers : callable
        Returns the number of subscribers.
    """

    def __init__(self, publish: Callable[[Any], None], subscribers: Callable[[], int]):
        self.publish = publish
        self.get_subscription_count = subscribers


class LockStepHost:
    """Host of one behaviour in lock step; see `traction_node.host.Host`.

    Parameters
    ----------
    lockstep : LockStep
        Topics and time.
    behaviour : type
        Subclass of `Behaviour`.
    overrides : mapping
        Parameters that differ from their defaults.

    Attributes
    ----------
    behaviour : Behaviour
        Behaviour with this host.
    p : types.SimpleNamespace
        Values of its parameters.
    active : bool
        True from just before activation on.
    finished : str or None
        Reason given to `finish`; None before.
    """

    def __init__(
        self, lockstep: LockStep, behaviour: type[Behaviour], overrides: Mapping[str, Any]
    ):
        self._lockstep = lockstep
        self._name = behaviour.NAME
        self.active = False
        self.finished: str | None = None
        self._diagnostic = diagnostic.Diagnostic()
        self._publish_diagnostics = lockstep.publisher('/diagnostics')
        self.p = SimpleNamespace(**resolve(behaviour.parameter_table(), overrides))
        self.behaviour = behaviour(self)
        self.behaviour.check_parameters(self.p)

    @property
    def said(self) -> str:
        """Present message of its diagnostics."""
        return self._diagnostic.message

    def message(self, name: str) -> Any:
        """New message of a topic, all fields zero or empty."""
        return self._lockstep.message(topic(name).type)

    def publisher(self, name: str) -> LockStepPublisher:
        """Publisher of a topic."""
        return LockStepPublisher(
            self._lockstep.publisher(name), lambda: self._lockstep.subscriber_count(name)
        )

    def subscription(self, name: str, callback: Callable[[Any], None]) -> None:
        """Subscribe to a topic."""
        self._lockstep.subscribe(name, callback)

    def publisher_count(self, name: str) -> int:
        """Number of publishers of a topic; the caller of `put` counts as one."""
        return 1

    def service(self, name: str, type_name: str, callback: Callable[[Any, Any], Any]) -> None:
        """Create a service; it is never called in lock step."""

    def steady_timer(self, period: float, callback: Callable[[], None]) -> None:
        """Timer on the time of the lock step."""
        self._lockstep.timer(period, callback)

    def steady_time(self) -> float:
        """Time since the start of the lock step, s."""
        return (self._lockstep.now - self._lockstep.start) * 1e-9

    def now(self) -> int:
        """Time of the lock step, ns."""
        return self._lockstep.now

    def get_logger(self) -> Logger:
        """Logger of Python with the name of the behaviour."""
        return logging.getLogger(self._name)

    def finish(self, reason: str = '') -> None:
        """Store the reason of the end."""
        self.finished = reason

    def set_diagnostic(self, level: int, message: str, **values: Any) -> None:
        """Publish a changed entry; it is not repeated, as there are no late subscribers."""
        if not self._diagnostic.change(level, message, values):
            return
        array = self._lockstep.message('diagnostic_msgs/msg/DiagnosticArray')
        to_stamp_exact(array.header.stamp, self._lockstep.now)
        status = self._lockstep.message('diagnostic_msgs/msg/DiagnosticStatus')
        status.level, status.name, status.message = level, self._name, message
        for key, value in values.items():
            pair = self._lockstep.message('diagnostic_msgs/msg/KeyValue')
            pair.key, pair.value = key, diagnostic.text(value)
            status.values.append(pair)
        array.status.append(status)
        self._publish_diagnostics(array)
