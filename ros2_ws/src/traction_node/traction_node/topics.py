"""Topics of the suite, from the table in `traction_interfaces`."""

import functools
import importlib
from dataclasses import dataclass
from pathlib import Path

import yaml
from ament_index_python.packages import get_package_share_directory


@dataclass(frozen=True)
class Topic:
    """Row of the table of topics.

    Attributes
    ----------
    name : str
        Relative name; absolute for topics without namespace.
    type : str
        Message type, such as 'sensor_msgs/msg/JointState'.
    qos : str
        'sensor_data', 'command', 'latched' or 'reliable'.
    rate : float
        Nominal rate [Hz], 0 for "on change".
    source, sink : str
        Publisher and subscriber.
    description : str
        Fields in use, with units.
    """

    name: str
    type: str
    qos: str
    rate: float
    source: str
    sink: str
    description: str


@functools.cache
def topics() -> dict[str, Topic]:
    """Topics of the suite by name."""
    share = Path(get_package_share_directory('traction_interfaces'))
    table = yaml.safe_load((share / 'config' / 'topics.yaml').read_text(encoding='utf-8'))
    return {
        name: Topic(
            name,
            row['type'],
            row['qos'],
            float(row['rate_hz']),
            row['from'],
            row['to'],
            row['description'],
        )
        for name, row in table.items()
    }


def topic(name: str) -> Topic:
    """Topic by name.

    Raises
    ------
    KeyError
        If the suite has no topic of that name.
    """
    if name not in topics():
        raise KeyError(f'the suite has no topic "{name}"; see topics.yaml')
    return topics()[name]


def message_class(type_name: str) -> type:
    """Class of a message or service type.

    Parameters
    ----------
    type_name : str
        Such as 'sensor_msgs/msg/JointState'.
    """
    package, kind, name = type_name.split('/')
    found: type = getattr(importlib.import_module(f'{package}.{kind}'), name)
    return found
