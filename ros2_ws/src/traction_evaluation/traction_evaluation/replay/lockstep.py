"""Behaviours of nodes in lock step: no process, no clock, no middleware.

A behaviour is what a lifecycle node of the suite does, without ROS: `SlipEstimatorBehaviour`,
`SlipControllerBehaviour`, `TorqueGateBehaviour`. Mixed with `traction_node.node` it is a node,
put into a `LockStep` it runs on the time of whoever calls. The same messages in the same order
give the same bytes.
"""

import logging
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from traction_node import diagnostic
from traction_node.parameter import resolve
from traction_node.topics import topic

_DTYPES: dict[str, np.dtype[Any]] = {
    name: np.dtype(name)
    for name in (
        'bool', 'int8', 'uint8', 'int16', 'uint16', 'int32', 'uint32', 'int64', 'uint64',
        'float32', 'float64',
    )
}  # fmt: skip


class LockStep:
    """Passes messages between behaviours, each to its end before the next.

    Parameters
    ----------
    types : Typestore
        Message types, as of `tractor_io.bags.bag.typestore`.
    record : callable
        Called with topic (leading slash), type, time (ns) and CDR bytes of all that is published.
    start : int
        Time to begin at, ns.
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

    def add(self, behaviour: type, overrides: Mapping[str, Any]) -> Any:
        """Make, configure and activate a behaviour.

        Parameters
        ----------
        behaviour : type
            Its class.
        overrides : mapping
            Parameters that differ from their defaults.

        Returns
        -------
        object
            The running behaviour.

        Raises
        ------
        ValueError
            If a parameter, or a combination of them, is refused.
        """
        node = type(behaviour.__name__, (behaviour, _Host), {})(lockstep=self, overrides=overrides)
        node.configure()
        node.active = True
        node.activate()
        return node

    @property
    def inputs(self) -> set[str]:
        """Topics that somebody here subscribes to, without leading slash."""
        return set(self._subscribers)

    def put(self, name: str, time: int, message: Any) -> None:
        """Let time pass and deliver a message.

        Parameters
        ----------
        name : str
            Topic, without leading slash.
        time : int
            When, ns; not before the last.
        message : object
            With the fields of its type.
        """
        self.advance(time)
        self._waiting.append((name, message))
        self._deliver()

    def advance(self, time: int) -> None:
        """Let time pass: timers that are due run, each at its time.

        Parameters
        ----------
        time : int
            Until when, ns.
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
        """Call back with each message of a topic, in the order of subscribing."""
        self._subscribers.setdefault(name, []).append(callback)

    def timer(self, period: float, callback: Callable[[], None]) -> None:
        """Call back at a period, s, for the first time after one."""
        step = round(period * 1e9)
        self._timers.append([self.now + step, step, callback])

    def message(self, type_name: str) -> SimpleNamespace:
        """A message of a type, all zero."""
        fields = self._types.fielddefs[type_name][1]
        return SimpleNamespace(**{name: self._zero(kind) for name, kind in fields})

    def _zero(self, kind: Any) -> Any:
        sort, payload = kind
        if sort == Nodetype.NAME:
            return self.message(payload)
        if sort == Nodetype.SEQUENCE:
            return []
        if sort == Nodetype.ARRAY:
            (_, inner), length = payload
            return np.zeros(length, _DTYPES[inner[0]])
        if payload[0] == 'string':
            return ''
        return np.zeros((), _DTYPES.get(payload[0], 'uint8')).item()

    def publisher(self, name: str) -> Callable[[Any], None]:
        """Function that publishes to a topic of the suite: records, then delivers."""
        type_name = topic(name).type
        full_name = f'/{name.lstrip("/")}'
        # Numbers in sequences are lists for the behaviours and arrays for serialization.
        sequences = []
        for field, (sort, payload) in self._types.fielddefs[type_name][1]:
            if sort == Nodetype.SEQUENCE and payload[0][0] == Nodetype.BASE:
                dtype = _DTYPES.get(payload[0][1][0])
                if dtype is not None:
                    sequences.append((field, dtype))

        def publish(message: Any) -> None:
            fields = dict(vars(message))
            for field, dtype in sequences:
                fields[field] = np.array(fields[field], dtype)
            data = self._types.serialize_cdr(SimpleNamespace(**fields), type_name)
            self._record(full_name, type_name, self.now, bytes(data))
            self._waiting.append((name, message))

        return publish


class _Host:
    """What a behaviour finds in `traction_node.node.TractionLifecycleNode`, in lock step."""

    NAME = ''
    PARAMETERS: Sequence[Any] = ()

    def __init__(self, lockstep: LockStep, overrides: Mapping[str, Any]):
        self._lockstep = lockstep
        self.active = False
        self.p = SimpleNamespace(**resolve(self.PARAMETERS, overrides))
        self.check_parameters(self.p)
        self._diagnostic = diagnostic.Diagnostic()
        self._publish_diagnostics = lockstep.publisher('/diagnostics')

    @property
    def said(self) -> str:
        """What its diagnostics say now."""
        return self._diagnostic.message

    def check_parameters(self, p: SimpleNamespace) -> None:
        """As the hook of a node."""

    def activate(self) -> None:
        """As the hook of a node."""

    def message(self, name: str) -> SimpleNamespace:
        return self._lockstep.message(topic(name).type)

    def publisher(self, name: str) -> SimpleNamespace:
        return SimpleNamespace(publish=self._lockstep.publisher(name))

    def subscription(self, name: str, callback: Callable[[Any], None]) -> None:
        self._lockstep.subscribe(name, callback)

    def service(self, name: str, type_name: str, callback: Callable[[Any, Any], Any]) -> None:
        """Nobody calls in lock step."""

    def steady_timer(self, period: float, callback: Callable[[], None]) -> None:
        self._lockstep.timer(period, callback)

    def steady_time(self) -> float:
        return (self._lockstep.now - self._lockstep.start) * 1e-9

    def get_logger(self) -> logging.Logger:
        return logging.getLogger(self.NAME)

    def set_diagnostic(self, level: int, message: str, **values: Any) -> None:
        """Tell what is new; in lock step nobody joins late, so nothing is repeated."""
        if not self._diagnostic.change(level, message, values):
            return
        array = self._lockstep.message('diagnostic_msgs/msg/DiagnosticArray')
        array.header.stamp.sec, array.header.stamp.nanosec = divmod(self._lockstep.now, 10**9)
        status = self._lockstep.message('diagnostic_msgs/msg/DiagnosticStatus')
        status.level, status.name, status.message = level, self.NAME, message
        for key, value in values.items():
            pair = self._lockstep.message('diagnostic_msgs/msg/KeyValue')
            pair.key, pair.value = key, diagnostic.text(value)
            status.values.append(pair)
        array.status.append(status)
        self._publish_diagnostics(array)
