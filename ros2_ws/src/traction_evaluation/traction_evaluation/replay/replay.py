"""Replay of a bag through estimator, controller and gate in lock step.

Messages are in total order: by time in the bag, then in the order of the file. There is no clock
and no middleware, so the outputs depend only on bag, parameters and code.
"""

import gc
import hashlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from traction_evaluation.drives.recording import vehicle_and_soil, vehicle_prefix
from traction_evaluation.loop.shipped import BEHAVIOURS, Parameters, as_yaml, shipped_parameters
from traction_evaluation.replay.judge import EstimateErrors, Judge
from traction_evaluation.replay.lockstep import LockStep
from traction_model.vehicle.vehicle import load_vehicle
from traction_node.parameter_file import parse, read_parameters
from traction_node.quality_of_service import QOS
from traction_node.stamp import nanoseconds
from traction_node.topics import topic
from tractor_io.bags.bag_error import BagError
from tractor_io.bags.message_types import typestore
from tractor_io.bags.reader import BagReader
from tractor_io.bags.writer import BagWriter

REQUESTS = ('torque_request', 'wheel_torque_command', 'wheel_torque')
"""Topics used as the request to the controller: the first one in the bag."""

TRUTH = 'ground_truth/slip_estimate'
"""Topic of the ground truth."""

LONGEST_PAUSE = 3600.0
"""Longest gap without messages in a replayed bag, s: the gate publishes at 100 Hz in a gap."""


@dataclass
class Replay:
    """Result of a replay.

    Attributes
    ----------
    messages : list of tuple
        All published messages, in order: topic, type, time in the bag (ns), CDR bytes.
    start : int
        Time in the bag of its first message, ns.
    duration : float
        Length of the bag, s.
    wall : float
        Computing time, s.
    errors : EstimateErrors or None
        Errors against ground truth; None without compared samples.
    truths : int
        Number of messages of ground truth in the bag.
    custom_data : dict of str to str
        Vehicle, soil, source and parameters, for a bag of the outputs.
    """

    messages: list[tuple[str, str, int, bytes]] = field(default_factory=list)
    start: int = 0
    duration: float = 0.0
    wall: float = 0.0
    errors: EstimateErrors | None = None
    truths: int = 0
    custom_data: dict[str, str] = field(default_factory=dict)

    @property
    def sha256(self) -> str:
        """SHA-256 of all topics, times and contents, in order."""
        digest = hashlib.sha256()
        for name, _, ns, data in self.messages:
            digest.update(f'{name} {ns} {len(data)}\n'.encode())
            digest.update(data)
        return digest.hexdigest()

    def values(self, name: str) -> list[Any]:
        """Messages of a topic.

        Parameters
        ----------
        name : str
            Topic; the leading slash may be left out.

        Returns
        -------
        list
            Decoded messages, in order; SI units.
        """
        full_name = f'/{name.lstrip("/")}'
        store = typestore()
        return [
            store.deserialize_cdr(data, type_name)
            for where, type_name, _, data in self.messages
            if where == full_name
        ]

    def write(self, path: Path | str) -> None:
        """Write an MCAP bag of the outputs.

        Parameters
        ----------
        path : Path or str
            Folder to create.

        Raises
        ------
        BagError
            If it exists or cannot be written.
        """
        with BagWriter(path, self.custom_data) as bag:
            for name, type_name, ns, data in self.messages:
                if name not in bag.counts:
                    row = topic(name if name == '/diagnostics' else name[1:])
                    bag.add_topic(name, type_name, QOS[row.qos])
                bag.write(name, ns, data)


def chosen_parameters(
    path: Path | str | None, assignments: Sequence[str]
) -> dict[str, dict[str, Any]]:
    """Parameters by node from a file and a command line.

    Parameters
    ----------
    path : Path or str, optional
        Parameter file of ROS 2; entries for other nodes are ignored.
    assignments : sequence of str
        Each ``NODE.NAME=VALUE``, the value as in YAML; they override the file.

    Returns
    -------
    dict of str to dict
        Parameters by node, SI units.

    Raises
    ------
    ValueError
        If file or assignment cannot be read.
    """
    read = read_parameters(path) if path is not None else {}
    everywhere = read.pop('**', {})
    # A file may have entries for other nodes of the robot.
    chosen = {name: values for name, values in read.items() if name in BEHAVIOURS}
    for name in BEHAVIOURS if everywhere else ():
        known = {row.name for row in BEHAVIOURS[name][1].parameter_table()}
        shared = {key: value for key, value in everywhere.items() if key in known}
        chosen[name] = shared | chosen.get(name, {})
    for values in chosen.values():
        # Not used: the replay starts the nodes and has the time of the bag.
        for ignored in ('autostart', 'use_sim_time'):
            values.pop(ignored, None)
    for assignment in assignments:
        name, equals, text = assignment.partition('=')
        node, dot, parameter = name.partition('.')
        if not (node and dot and parameter and equals):
            raise ValueError(f"parameter '{assignment}' should read NODE.NAME=VALUE")
        try:
            value = parse(text)
        except ValueError as error:
            raise ValueError(f"parameter '{assignment}': {error}") from error
        chosen.setdefault(node, {})[parameter] = value
    return chosen


def replay(
    path: Path | str,
    *,
    vehicle: str = '',
    soil: str = '',
    parameters: Parameters | None = None,
    judge: Judge | None = None,
    change_radar: Callable[[Any], Any] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Replay:
    """Replay a bag through the suite in lock step.

    Parameters
    ----------
    path : Path or str
        Bag, MCAP or sqlite3, with `wheel_states`, in any namespace. Without a `torque_request`,
        the commanded torque is the request.
    vehicle, soil : str
        Vehicle and nominal soil; empty: from the bag.
    parameters : mapping of str to mapping, optional
        Parameters that override the shipped ones, by node.
    judge : Judge, optional
        Comparison of the estimates with ground truth.
    change_radar : callable, optional
        Returns the message to deliver in place of one of `radar`, or None to drop it.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Returns
    -------
    Replay
        The outputs.

    Raises
    ------
    BagError
        If the bag cannot be read, has no `wheel_states` of the vehicle, or the vehicle is neither
        given nor in it.
    ValueError
        If vehicle, soil or a parameter is invalid.
    """
    judge = judge or Judge()
    result = Replay()
    with BagReader(path) as bag:
        prefix = vehicle_prefix(bag)
        vehicle, soil = vehicle_and_soil(bag, vehicle, soil)
        chosen = shipped_parameters(vehicle, soil, parameters)
        source = bag.custom_data.get('source', '')
        result.custom_data = {
            'vehicle': vehicle,
            'soil': soil,
            'source': f'replay of: {source}' if source else 'replay',
            'parameters': as_yaml(chosen),
        }

        estimates: dict[int, tuple[Any, Any, float]] = {}
        lockstep = LockStep(
            typestore(), lambda *message: result.messages.append(message), bag.start
        )
        nodes = {
            name: lockstep.add(behaviour, chosen[name])
            for name, (_, behaviour) in BEHAVIOURS.items()
        }

        def remember(message: Any) -> None:
            stamp = nanoseconds(message.header.stamp)
            estimates[stamp] = (
                list(message.slip), list(message.slip_variance), message.ground_based_speed,
            )  # fmt: skip

        there = {name for name in bag.topics if name.startswith(prefix)}
        request = next(
            (n for n in REQUESTS if prefix + n in there and bag.topics[prefix + n].count), ''
        )
        produced = {'slip_estimate', 'terrain_estimate', 'wheel_torque_command', 'wheel_torque'}
        sent = {prefix + name: name for name in lockstep.inputs - produced} | (
            {prefix + request: 'torque_request'} if request else {}
        )
        judged = prefix + TRUTH in there
        names = load_vehicle(vehicle).wheel_names
        if judged:
            lockstep.subscribe('slip_estimate', remember)
        began = time.perf_counter()
        # Garbage collection is off, as in a node; it would only find objects in use.
        gc.disable()
        try:
            for message in bag.messages(sorted(there & set(sent))):
                pause = (message.time - lockstep.now) * 1e-9
                if pause > LONGEST_PAUSE:
                    raise BagError(
                        f'{path}: nothing from {(lockstep.now - bag.start) * 1e-9:.3f} s on for '
                        f'{pause:.0f} s: cut the bag there (traction bag cut)'
                    )
                content = message.message
                if change_radar is not None and sent[message.topic] == 'radar':
                    content = change_radar(content)
                if content is not None:
                    lockstep.put(sent[message.topic], message.time, content)
                if progress is not None:
                    progress((message.time - bag.start) / max(1, bag.end - bag.start))
            lockstep.advance(bag.end)
        finally:
            gc.enable()
        result.wall = time.perf_counter() - began
        if not any(name == '/slip_estimate' for name, *_ in result.messages):
            raise BagError(f'{path}: no estimate came of it: {nodes["slip_estimator"].said}')
        result.start, result.duration = bag.start, bag.duration
        for message in bag.messages([prefix + TRUTH]) if judged else ():
            result.truths += 1
            ns = nanoseconds(message.message.header.stamp)
            if ns in estimates:
                # From stamps alone: those of a simulation may differ from the times of the bag.
                t = (ns - next(iter(estimates))) * 1e-9
                judge.add(t, names, *estimates[ns], message.message)
        result.errors = judge.errors(names)
    return result
