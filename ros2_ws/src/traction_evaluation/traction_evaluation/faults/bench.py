"""Faults put into the running suite, and what it makes of them.

A bench runs the suite as processes; what the nodes hear of each other passes through the bench,
which spoils it. The faults are those of `fault_table`.
"""

import contextlib
import copy
import math
import os
import signal
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import can
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from torque_gate.gate import REACTION_TIME
from traction_node.node import QOS
from traction_node.node_spec import NodeSpec
from traction_node.probe import NodeProcess, executable
from traction_node.running_system import RunningSystem
from traction_node.topics import message_class, topic
from tractor_io.bags.reader import BagReader
from tractor_io.can.interface import frame, free_port, open_bus
from tractor_io.can.parameter_group import FrameError, tractor_groups
from tractor_io.can.torque_limit import LimitReader

RELAYED = {
    'wheel_states': 'plant_node',
    'radar': 'plant_node',
    'wheel_torque_command': 'slip_controller',
}
"""Topics that pass through the bench, and who publishes them."""

DRIVING = 300.0
"""Torque on a rear wheel from which on the tractor drives, N·m."""

SLIP_TARGET = 0.2

SETTLED_BAND = 0.05
"""Slip above its target up to which it counts as controlled, dimensionless."""

SETTLED_TIME = 0.5
"""How long it has to be, before a fault, s."""

WALKING = 1.0
"""Ground speed from which on a tractor is at speed, m/s."""

LOOK = 0.2
"""How long torques are watched after a fault has been told of, s."""

PATIENCE = 15.0
"""Longest wait for what must come, s: a new process has to load."""

Describe = Callable[..., list[NodeSpec]]

BUS_RATE = 250_000 / 128
"""Frames of eight bytes a second that fill a J1939 bus, 1/s: 250 kbit/s, some 128 bits each."""


@dataclass(frozen=True)
class Outcome:
    """What a fault led to.

    Attributes
    ----------
    reaction : float
        From the fault to the first output from which on all were safe, s.
    told : float
        From the fault to the reason in `/diagnostics`, s.
    message : str
        That reason.
    recovery : float
        From the end of the fault to the tractor driving again, s.
    """

    reaction: float
    told: float
    message: str
    recovery: float


@dataclass(frozen=True)
class Row:
    """One hazard.

    Attributes
    ----------
    part : str
        Where it is.
    hazard, detection, safe : str
        What happens, who notices by what, and what is safe then.
    node, reason : str
        Who says so in `/diagnostics`, and a part of what it says.
    inject, clear : callable
        Begin and end the fault on a bench.
    is_safe : callable
        Whether an output of the bench is safe.
    limit : float
        Longest time from the fault to safe outputs, s.
    """

    part: str
    hazard: str
    detection: str
    safe: str
    node: str
    reason: str
    inject: Callable[[Any], None]
    clear: Callable[[Any], None]
    is_safe: Callable[[Any, Sequence[float]], bool]
    limit: float = REACTION_TIME

    @property
    def name(self) -> str:
        """Part and hazard."""
        return f'{self.part}: {self.hazard}'

    @property
    def at_speed(self) -> bool:
        """Whether the tractor has to be at speed, with its slip settled, before the fault.

        Where slip is judged; and a tenth of a speed near standstill is no fault that shows.
        """
        return self.part == 'Tachometer' or 'true slip' in self.safe


class _Bench:
    """The suite as processes, driving; a context manager."""

    def __init__(self, nodes: Sequence[NodeSpec]) -> None:
        self._nodes = {node.name: node for node in nodes}
        self._stack = contextlib.ExitStack()
        # When each came, and whether it was safe.
        self.outputs: list[tuple[float, bool]] = []
        self._row: Row | None = None
        self.said: list[tuple[float, str, str]] = []
        self.request: list[float] = []
        self.true_slip = 0.0
        self._settled_from = math.inf
        # Measured torques, the newest and those before, N·m.
        self.shaft = [0.0]
        self.shaft_before = [0.0]

    def __enter__(self) -> Any:
        with contextlib.ExitStack() as stack:
            *others, driver = self._nodes.values()
            self.system = stack.enter_context(RunningSystem(others))
            self.probe = self.system.probe
            self._listen(stack)
            self._stack = stack.pop_all()
        try:
            self.start(driver.name)
            self.await_driving()
            # From here on all is recorded: everybody has found everybody.
            self.torques.clear()
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        for process in self.system.processes.values():
            # A frozen one could not end.
            with contextlib.suppress(ProcessLookupError):
                os.kill(process.pid, signal.SIGCONT)
        self._stack.close()

    def _listen(self, stack: contextlib.ExitStack) -> None:
        probe = self.probe

        def torque(message: Any) -> None:
            self.torque = list(message.effort)
            self.torques.append(message)
            self.heard('wheel_torque', self.torque)

        def statuses(array: Any) -> None:
            now = time.monotonic()
            self.said.extend((now, status.name, status.message) for status in array.status)

        self.torque = [0.0]
        # All that was heard, as it came.
        self.torques: list[Any] = []
        probe.subscribe('wheel_torque', torque)
        probe.subscribe('torque_request', lambda m: setattr(self, 'request', list(m.effort)))
        probe.subscribe('ground_truth/slip_estimate', self._follow)
        probe.subscribe('wheel_states', self._feel)
        probe.node.create_subscription(DiagnosticArray, '/diagnostics', statuses, QOS['reliable'])

    def _feel(self, message: Any) -> None:
        self.shaft_before, self.shaft = self.shaft, list(message.effort) or [0.0]

    def _follow(self, truth: Any) -> None:
        """Note since when the tractor is at speed and slip near its target."""
        self.true_slip = max(truth.slip)
        settled = (
            self.torque[-1] > DRIVING
            and truth.ground_based_speed > WALKING
            and self.true_slip < SLIP_TARGET + SETTLED_BAND
        )
        since = min(self._settled_from, time.monotonic())
        self._settled_from = since if settled else math.inf

    def heard(self, name: str, values: list[float]) -> None:
        """Judge an output as it comes."""
        if self._row is not None:
            self.outputs.append((time.monotonic(), self._row.is_safe(self, values)))

    # Processes

    def start(self, name: str) -> None:
        """Start a node, anew where it has ended."""
        node = self._nodes[name]
        self.system.processes[name] = self._stack.enter_context(
            NodeProcess(
                executable(node.package, node.executable),
                params=dict(node.parameters),
                params_files=node.parameter_files,
                remaps=dict(node.remappings),
                quiet=True,
            )
        )

    def signal(self, name: str, number: int) -> None:
        """Send a node's process a signal."""
        os.kill(self.system.processes[name].pid, number)

    def restart(self, name: str) -> None:
        """End a node as Ctrl-C does and start it anew at once."""
        self.signal(name, signal.SIGINT)
        self.start(name)

    # Faults

    def await_driving(self, settled: bool = False) -> None:
        """Wait until the tractor drives and commands pass, and slip is settled if need be."""

        def passing() -> bool:
            newest = [text for _, node, text in self.said if node == 'torque_gate'][-1:]
            return (
                bool(newest)
                and newest[0].startswith(('passing', 'limited'))
                and self.torque[-1] > DRIVING
                and (not settled or time.monotonic() - self._settled_from > SETTLED_TIME)
                and self.healthy()
            )

        self.probe.wait_for(passing, PATIENCE, 'tractor that drives')

    def await_said(self, node: str, text: str) -> None:
        """Wait until the newest that a node said begins to contain a text."""

        def said() -> bool:
            newest = [said for _, name, said in self.said if name == node][-1:]
            return bool(newest) and text in newest[0]

        self.probe.wait_for(said, PATIENCE, f'"{text}" from {node}')

    def healthy(self) -> bool:
        """Whether all is as it was before a fault, beside the torque."""
        newest = {node: text for _, node, text in self.said}
        return newest.get('slip_estimator') == 'estimating'

    def measure(self, row: Row) -> Outcome:
        """Put a fault in, watch, and take it out again.

        Raises
        ------
        TimeoutError
            If nobody tells of it, the tractor does not drive on afterwards, or outputs never
            get safe.
        """
        self.await_driving(row.at_speed)
        self.outputs.clear()
        self.said.clear()
        self._row = row
        began = time.monotonic()
        row.inject(self)

        def told() -> tuple[float, str] | None:
            for t, node, text in self.said:
                if node == row.node and row.reason in text:
                    return t, text
            return None

        def safe_since() -> float | None:
            unsafe = [k for k, (_, safe) in enumerate(self.outputs) if not safe]
            first = unsafe[-1] + 1 if unsafe else 0
            return self.outputs[first][0] if first < len(self.outputs) else None

        try:
            t_told, text = self.probe.wait_for(told, 5.0, f'"{row.reason}" from {row.node}')
            self.probe.wait_for(safe_since, 2.0, f'safe output after {row.name}')
            self.probe.run_for(LOOK)
            t_safe = safe_since()
            if t_safe is None:
                raise TimeoutError(f'{row.name}: outputs did not stay safe')
        finally:
            self._row = None
            row.clear(self)
        cleared = time.monotonic()
        self.said.clear()
        self.await_driving()
        return Outcome(t_safe - began, t_told - began, text, time.monotonic() - cleared)


class FaultBench(_Bench):
    """The simulated tractor with topics; sensors and commands pass through this process.

    Parameters
    ----------
    describe : callable
        Describes the suite's nodes, as `traction_bringup.system.system` does.
    bag : Path
        Folder to record all topics into.
    """

    def __init__(self, describe: Describe, bag: Path) -> None:
        nodes = describe(
            simulated=True,
            bag=bag,
            parameters={
                'plant_node': {'soil_starts': [0.0, 1e6]},
                'drive_cycle': {'ramp': 0.0, 'slip_target': SLIP_TARGET},
            },
        )
        super().__init__(
            [
                replace(
                    node,
                    remappings={
                        **node.remappings,
                        **{name: f'unspoilt/{name}' for name, by in RELAYED.items()
                           if by == node.name},
                    },
                )
                for node in nodes
            ]
        )  # fmt: skip
        self.faults: dict[str, Callable[[Any], Iterable[Any]]] = {}

    def _listen(self, stack: contextlib.ExitStack) -> None:
        super()._listen(stack)
        for name in RELAYED:
            row = topic(name)
            publisher = self.probe.node.create_publisher(
                message_class(row.type), name, QOS[row.qos]
            )

            def relay(message: Any, name: str = name, publisher: Any = publisher) -> None:
                fault = self.faults.get(name)
                for out in (message,) if fault is None else fault(copy.deepcopy(message)):
                    publisher.publish(out)

            self.probe.node.create_subscription(
                message_class(row.type), f'unspoilt/{name}', relay, QOS[row.qos]
            )
        self._stop = self.probe.node.create_publisher(Bool, 'emergency_stop', QOS['latched'])
        self._stop_client = self.probe.node.create_client(SetBool, 'torque_gate/emergency_stop')

    def stop_by_topic(self, stop: bool) -> None:
        """Call or release the emergency stop by its topic."""
        self._stop.publish(Bool(data=stop))

    def stop_by_service(self, stop: bool) -> None:
        """Call or release the emergency stop by its service."""
        self._stop_client.call_async(SetBool.Request(data=stop))


class BusBench(_Bench):
    """The simulated tractor with a CAN bus between it and the suite.

    Parameters
    ----------
    describe : callable
        As of `FaultBench`.
    """

    def __init__(self, describe: Describe) -> None:
        self.port = free_port()
        end = {'port': self.port}
        super().__init__(
            describe(
                simulated=True,
                can='udp_multicast',
                parameters={
                    'plant_node': {'soil_starts': [0.0, 1e6]},
                    'can_bridge': end,
                    'tractor_ecu': end,
                    'drive_cycle': {'ramp': 0.0, 'slip_target': SLIP_TARGET},
                },
            )
        )
        self._pouring = None
        self.limits: list[float | None] = []

    def _listen(self, stack: contextlib.ExitStack) -> None:
        super()._listen(stack)
        self.bus = open_bus('udp_multicast', port=self.port)
        stack.callback(self.bus.shutdown)
        self._groups = tractor_groups()
        self._reader = LimitReader()
        self.probe.node.create_timer(0.002, self._hear)

    def heard(self, name: str, values: list[float]) -> None:
        """Keep the engine's limit, as it is what acts on the vehicle."""
        if name == 'TSC1':
            super().heard(name, values)

    def healthy(self) -> bool:
        """Whether the bridge hears all it should, too."""
        newest = {node: text for _, node, text in self.said}
        return super().healthy() and newest.get('can_bridge', '').startswith('limits')

    def _hear(self) -> None:
        while (message := self.bus.recv(0.0)) is not None:
            if message.is_error_frame or not message.is_extended_id:
                continue
            with contextlib.suppress(FrameError):
                group = self._groups.decode(message.arbitration_id, bytes(message.data))
                if group is not None and group.name == 'TSC1':
                    limit = self._reader.read(group, bytes(message.data))
                    # A limit that is taken back: as much as there is.
                    self.heard('TSC1', [math.inf if limit is None else limit])

    def pour(self, message: can.Message | None) -> None:
        """Fill the bus with a frame, or no longer with None."""
        if self._pouring is not None:
            self.probe.node.destroy_timer(self._pouring)
            self._pouring = None
        if message is not None:
            period = 0.005

            def pour() -> None:
                for _ in range(round(BUS_RATE * period)):
                    self.bus.send(message)

            self._pouring = self.probe.node.create_timer(period, pour)

    def garble(self, name: str) -> can.Message:
        """One of our messages with too few bytes."""
        return frame(self._groups.identifier(name).bits, b'\x00\x01\x02')


def recorded(bench: FaultBench, bag: Path) -> tuple[int, int]:
    """End the recorder, and look for all torques that the bench heard.

    Returns
    -------
    int, int
        How many of them are in the bag, and how many there are.
    """
    bench.system.processes['bag_recorder'].interrupt()
    with BagReader(bag) as reader:
        kept = {_key(entry.message) for entry in reader.messages(['/wheel_torque'])}
    heard = [_key(message) for message in bench.torques]
    return sum(key in kept for key in heard), len(heard)


def _key(message: Any) -> tuple[int, int, tuple[float, ...]]:
    stamp = message.header.stamp
    return stamp.sec, stamp.nanosec, tuple(float(torque) for torque in message.effort)
