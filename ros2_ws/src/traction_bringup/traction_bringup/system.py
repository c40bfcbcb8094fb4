"""The one description of the suite as a system, for launch files and for the runner."""

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
    """Describe the suite's nodes in the order in which to start them.

    Parameters
    ----------
    simulated : bool
        With plant and drive cycle in place of tractor and autonomy.
    controlled : bool
        With the slip controller; without, the drive cycle commands the gate directly.
    bag : Path or str
        Folder to record all topics into; empty for none.
    can : str
        CAN interface between the vehicle and the suite, of `tractor_io.can.interface.INTERFACES`;
        empty for topics. A simulated tractor then has one engine.
    autostart : bool
        Lifecycle nodes configure and activate by themselves.
    parameter_file : Path or str
        YAML file with parameters of one's own vehicle, for any of the nodes; overrules the
        files that come with the packages. Empty for none.
    parameters : mapping of str to mapping, optional
        Parameters by node name that differ from the files.

    Returns
    -------
    list of NodeSpec
        The nodes; the drive cycle comes last, when all others can listen.

    Raises
    ------
    ValueError
        If `parameters` names a node that is not part of the system, or `parameter_file` is
        not there.
    """

    own = (Path(parameter_file),) if parameter_file else ()
    if own and not own[0].is_file():
        raise ValueError(f'{parameter_file}: no such parameter file')

    bus = (config('tractor_io', 'can_bus.yaml'),) if can else ()
    # In between plant and bus, so that all else hears frames only.
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
                # Who acts on the request, the engine on the bus, and the recorder.
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
"""Nodes of a simulated tractor behind a bus."""


def tractor(
    *,
    can: str,
    parameter_file: Path | str = '',
    parameters: Mapping[str, Mapping[str, Any]] | None = None,
) -> list[NodeSpec]:
    """Describe a simulated tractor behind a CAN bus, with its driver, for a suite elsewhere.

    Parameters
    ----------
    can : str
        CAN interface, of `tractor_io.can.interface.INTERFACES`.
    parameter_file, parameters
        As `system` takes them.

    Returns
    -------
    list of NodeSpec
        The nodes; the drive cycle, which is the driver's foot, comes last.

    Raises
    ------
    ValueError
        As `system` does.
    """
    nodes = system(
        simulated=True, can=can, parameter_file=parameter_file, parameters=parameters
    )  # fmt: skip
    *others, driver = (node for node in nodes if node.name in TRACTOR)
    # The driver takes his time from the tractor, and waits for no suite.
    alone = {**driver.parameters, 'listeners': 1}
    behind = {**driver.remappings, 'wheel_states': 'tractor/wheel_states'}
    return [*others, replace(driver, parameters=alone, remappings=behind)]
