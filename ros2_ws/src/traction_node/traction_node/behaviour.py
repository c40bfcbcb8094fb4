"""Base class of what a node does, without middleware: see `Behaviour`."""

from collections.abc import Collection
from types import SimpleNamespace
from typing import ClassVar

from traction_node.host import Host
from traction_node.parameter import NodeParameter

AUTOSTART = NodeParameter(
    'autostart',
    default=False,
    description='configure and activate at start',
    read_only=True,
)
"""NodeParameter that every lifecycle node has."""


class Behaviour:
    """What a node does: parameters, and hooks that a host calls.

    `traction_node.run.run` makes a ROS 2 node of it. A lifecycle node goes through the hooks when
    it is told to. Any other node is configured and activated at its start, and deactivated and
    cleaned up at its end.

    Parameters
    ----------
    host : Host
        Parameters, topics, clocks, diagnostics and log.

    Class attributes
    ----------------
    NAME : str
        Name of the node, unless remapped.
    PARAMETERS : tuple of NodeParameter
        Its parameters.
    LIFECYCLE : bool
        True for a lifecycle node: it acts on the vehicle, and is configured and activated from
        outside. Such a node has the parameter `autostart` besides its own.
    """

    NAME: ClassVar[str] = ''
    PARAMETERS: ClassVar[tuple[NodeParameter, ...]] = ()
    LIFECYCLE: ClassVar[bool] = False

    def __init__(self, host: Host):
        self.host = host

    @classmethod
    def parameter_table(cls) -> tuple[NodeParameter, ...]:
        """All parameters of the node, `autostart` of a lifecycle node first."""
        return (AUTOSTART, *cls.PARAMETERS) if cls.LIFECYCLE else cls.PARAMETERS

    def check_parameters(self, p: SimpleNamespace) -> None:
        """Refuse a combination of parameters; each value by itself is already checked.

        Parameters
        ----------
        p : types.SimpleNamespace
            Values as they would be; `host.p` still holds those before.

        Raises
        ------
        ValueError
            With the reason, if they do not fit together.
        """

    def parameters_changed(self, p: SimpleNamespace, names: Collection[str]) -> None:
        """Apply parameters that were set at run time.

        Parameters
        ----------
        p : types.SimpleNamespace
            Values, also at `host.p`.
        names : collection of str
            Parameters that were set, also those set to the value they had.
        """

    def configure(self) -> None:
        """Build the core, and create topics and timers.

        Raises
        ------
        ValueError, OSError
            To refuse, with a clear text.
        """

    def activate(self) -> None:
        """Begin to act; topics and timers created here live until the node is deactivated.

        Raises
        ------
        ValueError, OSError
            To refuse, with a clear text.
        """

    def deactivate(self) -> None:
        """Stop acting; topics can still be published to."""

    def cleanup(self) -> None:
        """Drop what `configure` built; the host destroys topics and timers afterwards."""
