"""Parameter files in `config/` and parameter tables in READMEs, from the tables of the nodes.

`make docs` runs this module. Shipped values are the defaults of the tables. `FILES` has the other
values, with reasons.
"""

import importlib
import pkgutil
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from traction_node.behaviour import Behaviour
from traction_node.parameter_text import put_table, yaml_text

PACKAGES = (
    'torque_gate',
    'traction_model',
    'traction_controller',
    'tractor_io',
    'traction_bringup',
)
"""Packages with nodes."""


@dataclass(frozen=True)
class ParameterFile:
    """Shipped parameter file of a package.

    Attributes
    ----------
    package, name : str
        Package, and name of the file in its `config` folder.
    heading : str
        Purpose of the file, and why its values differ from the defaults.
    values : mapping of str to mapping
        Values by name of node that differ from the defaults.
    complete : bool
        True to write every parameter of the nodes, not only those with other values.
    """

    package: str
    name: str
    heading: str
    values: Mapping[str, Mapping[str, Any]]
    complete: bool = True


# Parameters of both ends; the launch file sets the kind of bus.
_BUS = {
    'gear_ratio': 50.0,
    'efficiency': 1.0,
    'front_share': 0.148,
}

FILES = (
    ParameterFile(
        'torque_gate',
        'torque_gate.yaml',
        'Parameters of torque_gate. Limits of torque and rate are for the vehicle tractor_4wd. '
        'The defaults have one limit for all wheels. Slip control needs a rate of about the whole '
        'torque in 0.2 s. timeout, release_time and 10 ms of watchdog must be at most 0.2 s; here '
        '30 ms of it are left for the path to the wheels.',
        {
            'torque_gate': {
                'min_torque': [-1500.0, -1500.0, -4000.0, -4000.0],
                'max_torque': [3000.0, 3000.0, 8000.0, 8000.0],
                'max_rate': [15000.0, 15000.0, 40000.0, 40000.0],
            }
        },
    ),
    ParameterFile(
        'traction_controller',
        'slip_controller.yaml',
        'Parameters of slip_controller. hold_torque and torque_rate are for the vehicle '
        'tractor_4wd, equal to max_torque and max_rate of its torque_gate; the defaults have one '
        'limit for all wheels. Law lqi: a lower weight_slip or a higher weight_torque makes the '
        'regulator faster, with larger changes of torque. The loop with the defaults is stable '
        'with 50 ms of delay; with half the weight_slip the front wheels oscillate at 30 ms.',
        {
            'slip_controller': {
                'hold_torque': [3000.0, 3000.0, 8000.0, 8000.0],
                'torque_rate': [15000.0, 15000.0, 40000.0, 40000.0],
            }
        },
    ),
    ParameterFile(
        'traction_controller',
        'slip_estimator.yaml',
        'Parameters of slip_estimator. noise_… are the process and measurement noise of the '
        'filter. Raise noise_acceleration if draft changes fast, and noise_nominal if the nominal '
        'soil is uncertain. Lower noise_gross_traction and noise_slip if the contact model is '
        'accurate for the wheels and the radar is not.',
        {'slip_estimator': {}},
    ),
    ParameterFile(
        'traction_model',
        'plant.yaml',
        'Parameters of plant_node for the demo: a draft of 12 kN at rest, sandy loam, a soft '
        'patch from 15 m on, an engine of 75 kW.',
        {
            'plant_node': {
                'soils': ['sandy_loam_chrono', 'soft_patch_chrono'],
                'soil_starts': [0.0, 15.0],
                'drawbar_pull': 12000.0,
                'drawbar_pull_per_speed': 1000.0,
                'max_power': 75000.0,
                'seed': 1,
            }
        },
    ),
    ParameterFile(
        'traction_bringup',
        'drive_cycle.yaml',
        'Parameters of drive_cycle for the demo: full throttle of a tractor, above the traction '
        'of the soft patch.',
        {'drive_cycle': {'torque': [2400.0, 2400.0, 8000.0, 8000.0]}},
    ),
    ParameterFile(
        'tractor_io',
        'can_bus.yaml',
        'Vehicle tractor_4wd with one engine on a CAN bus: parameters of both ends of the bus, '
        'which must be equal, and of a controller with one torque for all wheels at the 50 Hz of '
        'HRW. front_share is the ratio of torques at equal slip on soft soil. A steady speed '
        'within a step of HRW has the same value for tenths of a second, hence stuck_time. The '
        'gain table of the law lpv is for 100 Hz, hence lqi. Draft grows with speed. Full '
        'throttle of the engine, divided by the drivetrain, is above the traction of the soft '
        'patch.',
        {
            'can_bridge': _BUS,
            'tractor_ecu': _BUS,
            'slip_estimator': {'stuck_time': 0.5},
            'slip_controller': {
                'grouping': 'vehicle',
                'rate': 50.0,
                'law': 'lqi',
                'weight_integral_time': 0.3,
            },
            'plant_node': {
                'drawbar_pull': 8500.0,
                'drawbar_pull_per_speed': 3000.0,
                'max_power': 90000.0,
            },
            'drive_cycle': {'torque': [1800.0, 1800.0, 10200.0, 10200.0]},
            'torque_gate': {'max_torque': [3000.0, 3000.0, 12000.0, 12000.0]},
        },
        complete=False,
    ),
)
"""Shipped parameter files."""


def behaviours() -> dict[str, tuple[str, type[Behaviour]]]:
    """Package and behaviour of every node of the suite, by name of node."""
    found: dict[str, tuple[str, type[Behaviour]]] = {}
    for package in PACKAGES:
        path = importlib.import_module(package).__path__
        for info in pkgutil.walk_packages(path, f'{package}.'):
            if '.nodes.' not in info.name and not info.name.endswith('_node'):
                continue
            for thing in vars(importlib.import_module(info.name)).values():
                own = isinstance(thing, type) and thing.__module__ == info.name
                if own and hasattr(thing, 'PARAMETERS'):
                    found[thing.NAME] = package, thing
    return found


def config_text(file: ParameterFile) -> str:
    """Text of a parameter file.

    Parameters
    ----------
    file : ParameterFile
        One of `FILES`.

    Returns
    -------
    str
        YAML.

    Raises
    ------
    ValueError
        If a value is not allowed or names no parameter.
    """
    nodes = {}
    for node, values in file.values.items():
        table = {row.name: row for row in behaviours()[node][1].PARAMETERS}
        unknown = sorted(set(values) - set(table))
        if unknown:
            raise ValueError(f'{file.name}: {node} has no parameter {", ".join(unknown)}')
        rows = [row for row in table.values() if file.complete or row.name in values]
        nodes[node] = rows, values
    return yaml_text(file.heading + ' Written by make docs.', nodes)


def documents(sources: Path) -> Iterator[tuple[Path, str]]:
    """Generated files with their text.

    Parameters
    ----------
    sources : Path
        Folder of the packages, `ros2_ws/src`.

    Yields
    ------
    tuple of Path and str
        Path and text of a parameter file or a README.

    Raises
    ------
    ValueError
        If a value is not allowed, or a README lacks the comments around a table.
    """
    for file in FILES:
        yield sources / file.package / 'config' / file.name, config_text(file)
    for package in PACKAGES:
        path = sources / package / 'README.md'
        text = path.read_text(encoding='utf-8')
        for node, (owner, behaviour) in behaviours().items():
            if owner == package:
                text = put_table(text, node, behaviour.parameter_table())
        yield path, text


def main() -> None:
    """Write all files below a folder."""
    for path, text in documents(Path(sys.argv[1])):
        if path.read_text(encoding='utf-8') != text:
            path.write_text(text, encoding='utf-8')
            print(path)


if __name__ == '__main__':
    main()
