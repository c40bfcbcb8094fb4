"""Description of the suite as a system of nodes, for launch files and the runner."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from traction_node.node_spec import NodeSpec
from traction_node.parameter_file import config


def system(
    *,
    simulated: bool,
    controlled: bool = True,
    bag: Path | str = '',
    can: str = '',
    autostart: bool = True,
    parameter_file: Path | str = '',
    parameters: Mapping[str, Mapping[str, Any]] | None = None,
) -> list[NodeSpec]:
    """Nodes of the suite, in the order of their start.

    Parameters
    ----------
    simulated : bool
        True: plant and drive cycle in place of tractor and autonomy.
    controlled : bool
        True: with the slip controller. False: the drive cycle commands the gate directly.
    bag : Path or str
        Folder for a recording of all topics; empty for none.
    can : str
        CAN interface between the vehicle and the suite, of `tractor_io.can.interface.INTERFACES`;
        empty for topics. A simulated tractor then has one engine.
    autostart : bool
        True: lifecycle nodes configure and activate at their start.
    parameter_file : Path or str
        YAML file with the user's parameters, for any of the nodes; it overrides the shipped
        files. Empty for none.
    parameters : mapping of str to mapping, optional
        Parameters by name of node that override the files.

    Returns
    -------
    list of NodeSpec
        The nodes; the drive cycle is last, when all others receive.

    Raises
    ------
    ValueError
        If `parameters` names an unknown node, or `parameter_file` does not exist.
    """

    own = (Path(parameter_file),) if parameter_file else ()
    if own and not own[0].is_file():
        raise ValueError(f'{parameter_file}: no such parameter file')

    bus = (config('tractor_io', 'can_bus.yaml'),) if can else ()
    # Topics between plant and bus are remapped, so that other nodes receive only frames.
    behind = {name: f'tractor/{name}' for name in ('wheel_states', 'radar', 'wheel_torque')}

    def lifecycle(package: str, name: str) -> NodeSpec:
        shipped = () if name == 'can_bridge' else (config(package, f'{name}.yaml'),)
        return NodeSpec(
            package, name, name, (*shipped, *bus, *own), {'autostart': autostart},
            lifecycle=True,
        )  # fmt: skip

    nodes = [lifecycle('torque_gate', 'torque_gate')]
    if controlled:
        nodes.append(lifecycle('traction_controller', 'slip_controller'))
    nodes.append(lifecycle('traction_controller', 'slip_estimator'))
    if simulated:
        nodes.append(
            NodeSpec(
                'traction_model',
                'plant_node',
                'plant_node',
                (config('traction_model', 'plant.yaml'), *bus, *own),
                remappings=behind if can else {},
            )
        )
    direct = {} if controlled else {'torque_request': 'wheel_torque_command'}
    if can:
        nodes.append(lifecycle('tractor_io', 'can_bridge'))
        nodes[-1] = replace(nodes[-1], parameters={**nodes[-1].parameters, 'interface': can})
    if can and simulated:
        nodes.append(
            NodeSpec(
                'tractor_io',
                'tractor_ecu',
                'tractor_ecu',
                (*bus, *own),
                {'interface': can},
                {**behind, **direct},
            )
        )
    if bag:
        nodes.append(
            NodeSpec('tractor_io', 'bag_recorder', 'bag_recorder', parameters={'output': str(bag)})
        )
    if simulated:
        nodes.append(
            NodeSpec(
                'traction_bringup',
                'drive_cycle',
                'drive_cycle',
                (config('traction_bringup', 'drive_cycle.yaml'), *bus, *own),
                # Receivers of the request: gate or controller, engine on the bus, recorder.
                {'listeners': 1 + bool(can) + bool(bag)},
                direct,
            )
        )
    changes = dict(parameters or {})
    described = [
        replace(node, parameters={**node.parameters, **changes.pop(node.name, {})})
        for node in nodes
    ]
    if changes:
        raise ValueError(f'the system has no node {", ".join(changes)}')
    return described


TRACTOR = ('plant_node', 'tractor_ecu', 'drive_cycle')
"""Nodes of a simulated tractor on a bus."""


def tractor(
    *,
    can: str,
    parameter_file: Path | str = '',
    parameters: Mapping[str, Mapping[str, Any]] | None = None,
) -> list[NodeSpec]:
    """Nodes of a simulated tractor on a CAN bus, with driver, for a suite started separately.

    Parameters
    ----------
    can : str
        CAN interface, of `tractor_io.can.interface.INTERFACES`.
    parameter_file, parameters
        As for `system`.

    Returns
    -------
    list of NodeSpec
        The nodes; the drive cycle is last.

    Raises
    ------
    ValueError
        As `system`.
    """
    nodes = system(
        simulated=True, can=can, parameter_file=parameter_file, parameters=parameters
    )  # fmt: skip
    *others, driver = (node for node in nodes if node.name in TRACTOR)
    # The driver uses the time of the tractor and does not wait for the suite.
    alone = {**driver.parameters, 'listeners': 1}
    behind = {**driver.remappings, 'wheel_states': 'tractor/wheel_states'}
    return [*others, replace(driver, parameters=alone, remappings=behind)]
