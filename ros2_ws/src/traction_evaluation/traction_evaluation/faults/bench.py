"""Benches that inject faults into the running suite and measure the effects.

A bench runs the suite as processes. Messages between the nodes pass through the bench, which can
change them. `traction_evaluation.faults.table` has the faults.
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
from rclpy.timer import Timer
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from torque_gate.gate import REACTION_TIME
from traction_node.node import QOS
from traction_node.node_spec import NodeSpec
from traction_node.probe import NodeProcess, executable
from traction_node.running_system import RunningSystem
from traction_node.stamp import seconds
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
"""Topics that pass through the bench, and their publishers."""

DRIVING = 300.0
"""Torque of a rear wheel above which the tractor counts as driving, N·m."""

SLIP_TARGET = 0.2

SETTLED_BAND = 0.05
"""Largest slip above target at which slip counts as controlled, dimensionless."""

SETTLED_TIME = 0.5
"""Time of controlled slip required before a fault, s."""

WALKING = 1.0
"""Ground speed above which the tractor counts as at speed, m/s."""

LOOK = 0.2
"""Time of observation of torques after the report of a fault, s."""

Describe = Callable[..., list[NodeSpec]]

BUS_RATE = 250_000 / 128
"""Rate of 8-byte frames that fill a J1939 bus, 1/s: 250 kbit/s, about 128 bits each."""


@dataclass(frozen=True)
class Outcome:
    """Effect of a fault.

    Attributes
    ----------
    reaction : float
        Time from the fault to the first output after which all are safe, s.
    told : float
        Time from the fault to the reason in `/diagnostics`, s.
    message : str
        This reason.
    recovery : float
        Time from the end of the fault until the tractor drives again, s.
    """

    reaction: float
    told: float
    message: str
    recovery: float


@dataclass(frozen=True)
class Row:
    """Row of the table of hazards.

    Attributes
    ----------
    part : str
        Part of the system.
    hazard, detection, safe : str
        Description of the fault, of its detection, and of the safe output.
    node, reason : str
        Node that reports it in `/diagnostics`, and a part of the message.
    inject, clear : callable
        Start and end of the fault on a bench.
    is_safe : callable
        True if an output of the bench is safe.
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
        """True if the tractor must be at speed with settled slip before the fault.

        Needed if slip is evaluated, and because a tenth of a small speed is not detectable.
        """
        return self.part == 'Tachometer' or 'true slip' in self.safe


class _Bench:
    """Driving suite as processes; a context manager."""

    def __init__(self, nodes: Sequence[NodeSpec]) -> None:
        self._nodes = {node.name: node for node in nodes}
        self._stack = contextlib.ExitStack()
        # Time of publication of each output, s of the system clock, and whether it was safe.
        self.outputs: list[tuple[float, bool]] = []
        self._row: Row | None = None
        self.said: list[tuple[float, str, str]] = []
        self.request: list[float] = []
        self.true_slip = 0.0
        self._settled_from = math.inf
        # Newest and previous measured torques, N·m.
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
            # Recording is complete from here on: all publishers and subscribers are matched.
            self.torques.clear()
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        for process in self.system.processes.values():
            # A stopped process could not end.
            with contextlib.suppress(ProcessLookupError):
                os.kill(process.pid, signal.SIGCONT)
        self._stack.close()

    def _listen(self, stack: contextlib.ExitStack) -> None:
        probe = self.probe
        sent: list[float] = []

        def torque(message: Any) -> None:
            self.torque = list(message.effort)
            self.torques.append(message)
            self.heard('wheel_torque', self.torque, sent.pop())

        def statuses(array: Any) -> None:
            at = seconds(array.header.stamp)
            self.said.extend((at, status.name, status.message) for status in array.status)

        self.torque = [0.0]
        # All received torques, in order.
        self.torques: list[Any] = []
        probe.subscribe('wheel_torque', torque, sent)
        probe.subscribe('torque_request', lambda m: setattr(self, 'request', list(m.effort)))
        probe.subscribe('ground_truth/slip_estimate', self._follow)
        probe.subscribe('wheel_states', self._feel)
        probe.subscribe('/diagnostics', statuses)

    def _feel(self, message: Any) -> None:
        self.shaft_before, self.shaft = self.shaft, list(message.effort) or [0.0]

    def _follow(self, truth: Any) -> None:
        """Set the time since which the tractor is at speed with slip near its target."""
        self.true_slip = max(truth.slip)
        settled = (
            self.torque[-1] > DRIVING
            and truth.ground_based_speed > WALKING
            and self.true_slip < SLIP_TARGET + SETTLED_BAND
        )
        since = min(self._settled_from, time.monotonic())
        self._settled_from = since if settled else math.inf

    def heard(self, name: str, values: list[float], at: float) -> None:
        """Process an output, published at a time in s of the system clock."""
        if self._row is not None:
            self.outputs.append((at, self._row.is_safe(self, values)))

    # Processes

    def start(self, name: str) -> None:
        """Start a node, or restart it if it has ended."""
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
        """Send a signal to the process of a node."""
        os.kill(self.system.processes[name].pid, number)

    def restart(self, name: str) -> None:
        """End a node as Ctrl-C does and restart it at once."""
        self.signal(name, signal.SIGINT)
        self.start(name)

    # Faults

    def await_driving(self, settled: bool = False) -> None:
        """Wait until the tractor drives and commands pass; with `settled` also for slip."""

        def passing() -> bool:
            newest = [text for _, node, text in self.said if node == 'torque_gate'][-1:]
            return (
                bool(newest)
                and newest[0].startswith(('passing', 'limited'))
                and self.torque[-1] > DRIVING
                and (not settled or time.monotonic() - self._settled_from > SETTLED_TIME)
                and self.healthy()
            )

        self.probe.wait_for(passing, 'tractor that drives')

    def await_said(self, node: str, text: str) -> None:
        """Wait until the newest diagnostic of a node contains a text."""

        def said() -> bool:
            newest = [said for _, name, said in self.said if name == node][-1:]
            return bool(newest) and text in newest[0]

        self.probe.wait_for(said, f'"{text}" from {node}')

    def healthy(self) -> bool:
        """True if the state is as before a fault, apart from the torque."""
        newest = {node: text for _, node, text in self.said}
        return newest.get('slip_estimator') == 'estimating'

    def measure(self, row: Row) -> Outcome:
        """Inject a fault, observe, and remove it.

        Raises
        ------
        TimeoutError
            If the fault is not reported, the tractor does not drive afterwards, or outputs do not
            become safe.
        """
        self.await_driving(row.at_speed)
        self.outputs.clear()
        self.said.clear()
        self._row = row
        began = time.time()
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

        def lasting() -> float | None:
            since = safe_since()
            # A busy machine may interrupt commands, and torque, before the fault has its effect.
            over = since is not None and time.time() > max(since, t_told) + LOOK
            return since if over else None

        try:
            t_told, text = self.probe.wait_for(told, f'"{row.reason}" from {row.node}')
            t_safe = self.probe.wait_for(lasting, f'lasting safe outputs after {row.name}')
        finally:
            self._row = None
            row.clear(self)
        cleared = time.monotonic()
        self.said.clear()
        self.await_driving()
        return Outcome(t_safe - began, t_told - began, text, time.monotonic() - cleared)


class FaultBench(_Bench):
    """Bench with topics: sensors and commands of a simulated tractor pass through this process.

    Parameters
    ----------
    describe : callable
        Returns the nodes, as `traction_bringup.system.system`.
    bag : Path
        Folder for a recording of all topics.
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
        """Set or release the emergency stop by topic."""
        self._stop.publish(Bool(data=stop))

    def stop_by_service(self, stop: bool) -> None:
        """Set or release the emergency stop by service."""
        self._stop_client.call_async(SetBool.Request(data=stop))


class BusBench(_Bench):
    """Bench with a CAN bus between a simulated tractor and the suite.

    Parameters
    ----------
    describe : callable
        As for `FaultBench`.
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
        self._pouring: Timer | None = None
        self.limits: list[float | None] = []

    def _listen(self, stack: contextlib.ExitStack) -> None:
        super()._listen(stack)
        self.bus = open_bus('udp_multicast', port=self.port)
        stack.callback(self.bus.shutdown)
        self._groups = tractor_groups()
        self._reader = LimitReader()
        self.probe.node.create_timer(0.002, self._hear)

    def heard(self, name: str, values: list[float], at: float) -> None:
        """Ignore torques: the limit of the engine is the output of this bench."""
        if name == 'TSC1':
            super().heard(name, values, at)

    def healthy(self) -> bool:
        """True if also the bridge receives all messages."""
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
                    # A released limit: no limit.
                    self.heard('TSC1', [math.inf if limit is None else limit], message.timestamp)

    def pour(self, message: can.Message | None) -> None:
        """Fill the bus with copies of a frame; None ends this."""
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
        """Known message with too few bytes."""
        return frame(self._groups.identifier(name).bits, b'\x00\x01\x02')


def recorded(bench: FaultBench, bag: Path) -> tuple[int, int]:
    """End the recorder and compare its bag with the torques received by the bench.

    Returns
    -------
    int, int
        Number of received torques in the bag, and in all.
    """
    bench.system.processes['bag_recorder'].interrupt()
    with BagReader(bag) as reader:
        kept = {_key(entry.message) for entry in reader.messages(['/wheel_torque'])}
    heard = [_key(message) for message in bench.torques]
    return sum(key in kept for key in heard), len(heard)


def _key(message: Any) -> tuple[int, int, tuple[float, ...]]:
    stamp = message.header.stamp
    return stamp.sec, stamp.nanosec, tuple(float(torque) for torque in message.effort)
