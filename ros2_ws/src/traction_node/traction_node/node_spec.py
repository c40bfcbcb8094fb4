"""One node of a system: what to run, under which name, with which parameters and topics."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class NodeSpec:
    """One node of the system.

    Attributes
    ----------
    package, executable : str
        What `ros2 run` would be told.
    name : str
        Name of the node.
    parameter_files : tuple of Path
        Its parameters, SI units; a later file overrules an earlier one.
    parameters : dict
        What differs from those files.
    remappings : dict of str to str
        Topic names, from and to.
    lifecycle : bool
        Whether the node has to be active before it works.
    """

    package: str
    executable: str
    name: str
    parameter_files: tuple[Path, ...] = ()
    parameters: Mapping[str, Any] = field(default_factory=dict)
    remappings: Mapping[str, str] = field(default_factory=dict)
    lifecycle: bool = False
