"""Base class of the behaviour of a node, without middleware."""

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
"""Parameter of every lifecycle node."""


class Behaviour:
    """Behaviour of a node: parameters, and hooks called by its host.

    `traction_node.run.run` runs it as a ROS 2 node. Transitions of a lifecycle node call the
    hooks. Any other node is configured and activated at its start, and deactivated and cleaned up
    at its end.

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
        True for a lifecycle node: it acts on the vehicle, and other nodes configure and activate
        it. It has the additional parameter `autostart`.
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
        """Check the combination of parameters; single values are already checked.

        Parameters
        ----------
        p : types.SimpleNamespace
            New values; `host.p` still has the old ones.

        Raises
        ------
        ValueError
            If they contradict each other; the text has the reason.
        """

    def parameters_changed(self, p: SimpleNamespace, names: Collection[str]) -> None:
        """Apply parameters that were set at run time.

        Parameters
        ----------
        p : types.SimpleNamespace
            Values, also at `host.p`.
        names : collection of str
            Parameters that were set, also those set to their old value.
        """

    def configure(self) -> None:
        """Construct the core; create topics and timers.

        Raises
        ------
        ValueError, OSError
            To fail the transition, with the reason.
        """

    def activate(self) -> None:
        """Start to act; topics and timers created here exist until deactivation.

        Raises
        ------
        ValueError, OSError
            To fail the transition, with the reason.
        """

    def deactivate(self) -> None:
        """Stop acting; topics can still be published to."""

    def cleanup(self) -> None:
        """Delete the objects of `configure`; the host destroys topics and timers afterwards."""
