"""Parameters of estimator, controller and gate as they ship: the nodes' tables and YAML files."""

import hashlib
from collections.abc import Mapping
from typing import Any

import yaml

from torque_gate.nodes.torque_gate import TorqueGateBehaviour
from traction_controller.nodes.slip_controller import SlipControllerBehaviour
from traction_controller.nodes.slip_estimator import SlipEstimatorBehaviour
from traction_model.vehicle.vehicle import load_vehicle
from traction_node.closest import closest
from traction_node.parameter import NodeParameter, resolve
from traction_node.parameter_file import config, read_parameters

BEHAVIOURS = {
    'slip_estimator': ('traction_controller', SlipEstimatorBehaviour),
    'slip_controller': ('traction_controller', SlipControllerBehaviour),
    'torque_gate': ('torque_gate', TorqueGateBehaviour),
}
"""Nodes of the loop: package and behaviour by the name of the node."""

VEHICLE, SOIL = 'tractor_4wd', 'sandy_loam_chrono'
"""Presets of the vehicle and of the nominal soil that the YAML files are for."""

Parameters = Mapping[str, Mapping[str, Any]]


def shipped_parameters(
    vehicle: str = VEHICLE, soil: str = SOIL, changes: Parameters | None = None
) -> dict[str, dict[str, Any]]:
    """Parameters of estimator, controller and gate for a vehicle, every one of them.

    The YAML files that ship are for one vehicle. Another one has the defaults of the tables, and
    the law ``lqi``, which needs no gain table.

    Parameters
    ----------
    vehicle, soil : str
        Preset, or path of a definition.
    changes : mapping of str to mapping, optional
        What differs, by node.

    Returns
    -------
    dict of str to dict
        By node, in the order in which messages pass them; SI units.

    Raises
    ------
    ValueError
        For a node that takes no part, and for a parameter that is refused.
    """
    changes = changes or {}
    for name in changes:
        if name not in BEHAVIOURS:
            raise ValueError(f"the loop has no node '{name}'{closest(name, BEHAVIOURS)}")
    chosen: dict[str, dict[str, Any]] = {
        name: dict(read_parameters(config(package, f'{name}.yaml'))[name])
        for name, (package, _) in BEHAVIOURS.items()
    }
    if vehicle != chosen['slip_controller']['vehicle']:
        chosen = {
            'slip_estimator': {},
            'slip_controller': {'law': 'lqi'},
            'torque_gate': {'wheel_names': list(load_vehicle(vehicle).wheel_names)},
        }
    for name in ('slip_estimator', 'slip_controller'):
        chosen[name] |= {'vehicle': vehicle, 'soil': soil}
    return {
        name: resolve(table(name), chosen[name] | dict(changes.get(name, {})))
        for name in BEHAVIOURS
    }


def table(node: str) -> tuple[NodeParameter, ...]:
    """Table of the parameters of a node.

    Parameters
    ----------
    node : str
        One of `BEHAVIOURS`.

    Returns
    -------
    tuple of NodeParameter
        As the node declares them.
    """
    return tuple(BEHAVIOURS[node][1].PARAMETERS)


def as_yaml(parameters: Parameters) -> str:
    """Parameters as YAML, the same text for the same values.

    Parameters
    ----------
    parameters : mapping of str to mapping
        By node.

    Returns
    -------
    str
        Sorted by name, lists in place of tuples.
    """
    plain = {
        node: {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in values.items()
        }
        for node, values in parameters.items()
    }
    return yaml.safe_dump(plain, sort_keys=True, allow_unicode=True)


def digest() -> str:
    """Digest of all that ships for `VEHICLE`: parameters and gain table.

    Returns
    -------
    str
        The first 16 hexadecimal digits of a SHA-256.
    """
    gains = config('traction_controller', f'gains/{VEHICLE}.yaml').read_bytes()
    text = as_yaml(shipped_parameters())
    return hashlib.sha256(text.encode() + gains).hexdigest()[:16]


def differences(parameters: Parameters) -> dict[str, Any]:
    """Parameters that differ from those that ship for `VEHICLE`.

    Parameters
    ----------
    parameters : mapping of str to mapping
        As of `shipped_parameters`.

    Returns
    -------
    dict of str to object
        Value by ``node.parameter``, SI units; empty where all is as it ships.
    """
    shipped = shipped_parameters()
    return {
        f'{node}.{name}': value
        for node, values in parameters.items()
        for name, value in values.items()
        if shipped[node][name] != value
    }
