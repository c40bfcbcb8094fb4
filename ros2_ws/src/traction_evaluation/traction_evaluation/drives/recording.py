"""Recorded drive as arrays, for evaluation and pictures."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from traction_node.stamp import nanoseconds
from tractor_io.bags.bag_error import BagError
from tractor_io.bags.reader import BagReader

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Series:
    """Quantity over time.

    Attributes
    ----------
    t : ndarray, shape (k,)
        Time of the stamps, s after the start of the drive.
    values : ndarray, shape (k,) or (k, n)
        Values, SI units.
    logged : ndarray, shape (k,)
        Log time, s, on the recorder's clock.
    """

    t: Array
    values: Array
    logged: Array

    def at(self, t: Array) -> Array:
        """Values at other times, by linear interpolation.

        Parameters
        ----------
        t : ndarray, shape (m,)
            Times, s.

        Returns
        -------
        ndarray, shape (m,) or (m, n)
            Values, SI units.
        """
        columns = self.values.reshape(len(self.t), -1).T
        sampled = np.stack([np.interp(t, self.t, column) for column in columns], axis=-1)
        return np.asarray(sampled[:, 0] if self.values.ndim == 1 else sampled)


# Quantities: name, topic, and function to read them from a message.
_QUANTITIES: tuple[tuple[str, str, Callable[[Any], Any]], ...] = (
    ('wheel_speed', 'wheel_states', lambda m: m.velocity),
    ('shaft_torque', 'wheel_states', lambda m: m.effort),
    ('radar', 'radar', lambda m: m.twist.twist.linear.x),
    ('torque_request', 'torque_request', lambda m: m.effort),
    ('torque_command', 'wheel_torque_command', lambda m: m.effort),
    ('torque', 'wheel_torque', lambda m: m.effort),
    ('slip_estimate', 'slip_estimate', lambda m: m.slip),
    ('speed_estimate', 'slip_estimate', lambda m: m.ground_based_speed),
    ('slip', 'ground_truth/slip_estimate', lambda m: m.slip),
    ('slip_valid', 'ground_truth/slip_estimate', lambda m: m.valid),
    ('rim_speed', 'ground_truth/slip_estimate', lambda m: m.wheel_based_speed),
    ('speed', 'ground_truth/slip_estimate', lambda m: m.ground_based_speed),
    ('distance', 'ground_truth/odometry', lambda m: m.pose.pose.position.x),
)


@dataclass(frozen=True)
class Recording:
    """Recorded drive.

    Attributes
    ----------
    path : Path
        The bag.
    wheel_names : tuple of str
        The wheels, in the order of all columns.
    series : dict of str to Series
        Quantities in the bag: ``wheel_speed`` rad/s, ``shaft_torque``,
        ``torque_request``, ``torque_command`` and ``torque`` N·m, ``radar``, ``speed``,
        ``speed_estimate`` and ``rim_speed`` m/s, ``slip`` and ``slip_estimate``
        (dimensionless), ``distance`` m.
    slip_target : float or None
        Target, dimensionless; None if the bag has none.
    """

    path: Path
    wheel_names: tuple[str, ...]
    series: dict[str, Series] = field(default_factory=dict)
    slip_target: float | None = None

    def __getitem__(self, name: str) -> Series:
        if name not in self.series:
            raise BagError(f'{self.path}: holds no {name}; it holds: {", ".join(self.series)}')
        return self.series[name]

    def __contains__(self, name: object) -> bool:
        return name in self.series

    @property
    def end(self) -> float:
        """Time of the last torque request, or of the last reading of the wheels, s."""
        asked = [name for name in ('torque_request', 'torque_command') if name in self]
        return float(self[asked[0] if asked else 'wheel_speed'].t[-1])

    def rate(self, name: str) -> float:
        """Mean rate of a quantity, Hz."""
        logged = self[name].logged
        span = float(logged[-1] - logged[0])
        return (len(logged) - 1) / span if span > 0 else 0.0


def vehicle_prefix(bag: BagReader) -> str:
    """Namespace of the vehicle's topics in a bag, with slashes.

    Parameters
    ----------
    bag : BagReader
        An open bag.

    Returns
    -------
    str
        ``/``, or such as ``/tractor1/``.

    Raises
    ------
    BagError
        If no topic, or more than one, is a `wheel_states`.
    """
    found: list[str] = [name for name in bag.topics if name.endswith('/wheel_states')]
    if len(found) > 1:
        raise BagError(f'{bag.path}: holds several vehicles: {", ".join(found)}')
    if not found:
        bag.find(['wheel_states'])  # raises, naming what there is
    return found[0].removesuffix('wheel_states')


def vehicle_and_soil(bag: BagReader, vehicle: str = '', soil: str = '') -> tuple[str, str]:
    """Vehicle of a bag, and soil at its start.

    Parameters
    ----------
    bag : BagReader
        An open bag.
    vehicle, soil : str
        Names or paths of definitions; empty: from the bag.

    Returns
    -------
    tuple of str
        Vehicle and soil.

    Raises
    ------
    BagError
        If one is neither given nor in the bag.
    """
    found = {}
    for what, given in (('vehicle', vehicle), ('soil', soil)):
        found[what] = given or bag.custom_data.get(what, '')
        if not found[what]:
            raise BagError(f'{bag.path}: names no {what}; give --{what}')
    return found['vehicle'], found['soil']


def read_recording(path: Path | str) -> Recording:
    """Read a bag as a recording.

    Parameters
    ----------
    path : Path or str
        Bag folder or file.

    Returns
    -------
    Recording
        Quantities of the bag.

    Raises
    ------
    BagError
        If it is no bag, or has no `wheel_states`, or those of several vehicles.
    """
    with BagReader(path) as bag:
        prefix = vehicle_prefix(bag)
        wanted = {topic for _, topic, _ in _QUANTITIES} | {'slip_target'}
        there = [prefix + topic for topic in sorted(wanted) if prefix + topic in bag.topics]
        collected: dict[str, list[tuple[int, int, Any]]] = {topic: [] for topic in wanted}
        target = None
        names: tuple[str, ...] = ()
        for message in bag.messages(there):
            topic = message.topic.removeprefix(prefix)
            if topic == 'slip_target':
                target = float(message.message.data)
                continue
            if topic == 'wheel_states' and not names:
                names = tuple(message.message.name)
            ns = nanoseconds(message.message.header.stamp)
            collected[topic].append((ns, message.time, message.message))
    # The drive starts with the first torque request, or else with the bag.
    begun = ('torque_request', 'wheel_torque_command', 'wheel_states')
    start = next((collected[topic][0][0] for topic in begun if collected[topic]), None)
    if start is None:
        raise BagError(f'{path}: no message on {prefix}wheel_states')
    series = {}
    for name, topic, take in _QUANTITIES:
        entries = collected[topic]
        if entries:
            series[name] = Series(
                np.array([(ns - start) * 1e-9 for ns, _, _ in entries]),
                np.array([take(message) for _, _, message in entries], dtype=float),
                np.array([(logged - start) * 1e-9 for _, logged, _ in entries]),
            )
    return Recording(Path(path), names, series, target)
