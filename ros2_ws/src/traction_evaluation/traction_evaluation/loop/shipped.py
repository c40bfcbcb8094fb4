"""Shipped parameters of estimator, controller and gate, from the nodes' tables and YAML files."""

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
"""Nodes of the loop: package and behaviour by name of node."""

VEHICLE, SOIL = 'tractor_4wd', 'sandy_loam_chrono'
"""Presets of vehicle and nominal soil of the YAML files."""

Parameters = Mapping[str, Mapping[str, Any]]


def shipped_parameters(
    vehicle: str = VEHICLE, soil: str = SOIL, changes: Parameters | None = None
) -> dict[str, dict[str, Any]]:
    """All parameters of estimator, controller and gate for a vehicle.

    The shipped YAML files are for one vehicle. Other vehicles have the defaults of the tables, and
    the law ``lqi``, which needs no gain table.

    Parameters
    ----------
    vehicle, soil : str
        Preset, or path of a definition.
    changes : mapping of str to mapping, optional
        Parameters that override these, by node.

    Returns
    -------
    dict of str to dict
        Parameters by node, in the order of the messages; SI units.

    Raises
    ------
    ValueError
        If a node is unknown, or a parameter is invalid.
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
        Its parameters.
    """
    return tuple(BEHAVIOURS[node][1].PARAMETERS)


def as_yaml(parameters: Parameters) -> str:
    """Parameters as YAML; equal values give equal texts.

    Parameters
    ----------
    parameters : mapping of str to mapping
        Parameters by node.

    Returns
    -------
    str
        YAML, sorted by name, with lists in place of tuples.
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
    """Digest of parameters and gain table shipped for `VEHICLE`.

    Returns
    -------
    str
        The first 16 hexadecimal digits of a SHA-256.
    """
    gains = config('traction_controller', f'gains/{VEHICLE}.yaml').read_bytes()
    text = as_yaml(shipped_parameters())
    return hashlib.sha256(text.encode() + gains).hexdigest()[:16]


def differences(parameters: Parameters) -> dict[str, Any]:
    """Parameters that differ from those shipped for `VEHICLE`.

    Parameters
    ----------
    parameters : mapping of str to mapping
        As from `shipped_parameters`.

    Returns
    -------
    dict of str to object
        Value by ``node.parameter``, SI units; empty without differences.
    """
    shipped = shipped_parameters()
    return {
        f'{node}.{name}': value
        for node, values in parameters.items()
        for name, value in values.items()
        if shipped[node][name] != value
    }
