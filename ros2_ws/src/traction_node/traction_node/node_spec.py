"""Description of a node in a system: executable, name, parameters and topics."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class NodeSpec:
    """Node of a system.

    Attributes
    ----------
    package, executable : str
        Arguments of `ros2 run`.
    name : str
        Name of the node.
    parameter_files : tuple of Path
        Parameter files, SI units; a later file overrides an earlier one.
    parameters : dict
        Parameters that override those of the files.
    remappings : dict of str to str
        Topic names, from and to.
    lifecycle : bool
        True for a lifecycle node.
    """

    package: str
    executable: str
    name: str
    parameter_files: tuple[Path, ...] = ()
    parameters: Mapping[str, Any] = field(default_factory=dict)
    remappings: Mapping[str, str] = field(default_factory=dict)
    lifecycle: bool = False
