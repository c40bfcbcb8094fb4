"""Parameter files of ROS 2: where they lie, and what they hold."""

from pathlib import Path
from typing import Any

import yaml
from ament_index_python.packages import get_package_share_directory


def config(package: str, name: str) -> Path:
    """Path of a parameter file that a package of the suite ships.

    Parameters
    ----------
    package, name : str
        Package, and file name in its ``config`` folder.

    Returns
    -------
    Path
        The file as installed.
    """
    return Path(get_package_share_directory(package)) / 'config' / name


def read_parameters(path: Path | str) -> dict[str, dict[str, Any]]:
    """Parameters by node from a parameter file of ROS 2.

    Parameters
    ----------
    path : Path or str
        YAML file.

    Returns
    -------
    dict of str to dict
        By name of the node without namespace.

    Raises
    ------
    ValueError
        If it is no such file.
    """
    try:
        text = yaml.safe_load(Path(path).read_text(encoding='utf-8'))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ValueError(f'{path}: {" ".join(str(error).split())}') from error
    found: dict[str, dict[str, Any]] = {}
    for name, content in (text if isinstance(text, dict) else {None: None}).items():
        values = content.get('ros__parameters') if isinstance(content, dict) else None
        if not isinstance(values, dict):
            raise ValueError(f'{path}: expected node names, each with ros__parameters')
        found.setdefault(str(name).rsplit('/', 1)[-1], {}).update(values)
    return found
