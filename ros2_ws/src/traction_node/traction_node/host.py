"""Interface between the behaviour of a node and the host that runs it.

`traction_node.node` implements it on rclpy, `traction_evaluation.replay.lockstep` without
middleware.
"""

from collections.abc import Callable, Iterable
from types import SimpleNamespace
from typing import Any, Protocol


class Logger(Protocol):
    """Log of a node; rclpy's logger and Python's `logging.Logger` have these methods."""

    def info(self, message: str) -> Any:
        """Log an event of normal operation."""

    def warning(self, message: str) -> Any:
        """Log a problem that the node can handle."""

    def error(self, message: str) -> Any:
        """Log a failure."""


class Publisher(Protocol):
    """Publisher of one topic."""

    def publish(self, message: Any) -> None:
        """Publish a message; a lifecycle node drops it unless it is active.

        Parameters
        ----------
        message : object
            Message of the topic's type.
        """

    def get_subscription_count(self) -> int:
        """Number of subscribers that are matched with this publisher."""


class Host(Protocol):
    """Parameters, topics, clocks, diagnostics and log for a behaviour.

    Topics have names, types and quality of service from `topics.yaml`. Remapping and namespaces
    apply.
    """

    @property
    def p(self) -> SimpleNamespace:
        """Checked value of every parameter, by name; replaced when a parameter is set."""

    @property
    def active(self) -> bool:
        """True from before `Behaviour.activate` until after `Behaviour.deactivate`."""

    def publisher(self, name: str) -> Publisher:
        """Publisher of a topic.

        Parameters
        ----------
        name : str
            Name in `topics.yaml`.
        """

    def subscription(self, name: str, callback: Callable[[Any], None]) -> Any:
        """Subscribe to a topic.

        Parameters
        ----------
        name : str
            Name in `topics.yaml`.
        callback : callable
            Called with each message.
        """

    def publisher_count(self, name: str) -> int:
        """Number of publishers of a topic, in all processes.

        Parameters
        ----------
        name : str
            Name in `topics.yaml`.

        Returns
        -------
        int
            Number of publishers.
        """

    def service(self, name: str, type_name: str, callback: Callable[[Any, Any], Any]) -> Any:
        """Create a service in the namespace of the node, such as `torque_gate/emergency_stop`.

        Parameters
        ----------
        name : str
            Name without that of the node, such as 'emergency_stop'.
        type_name : str
            Service type, such as 'std_srvs/srv/SetBool'.
        callback : callable
            Called with request and response, returns the response.
        """

    def message(self, name: str) -> Any:
        """New message of a topic, all fields zero or empty.

        Parameters
        ----------
        name : str
            Name in `topics.yaml`.
        """

    def steady_timer(self, period: float, callback: Callable[[], None]) -> Any:
        """Timer on the steady clock, independent of simulated and corrected time.

        Parameters
        ----------
        period : float
            Period, s.
        callback : callable
            Called without arguments.
        """

    def steady_time(self) -> float:
        """Time of the steady clock, s."""

    def now(self) -> int:
        """ROS time, ns: wall-clock time, or that of `/clock` with `use_sim_time`."""

    def set_diagnostic(self, level: int, message: str, **values: Any) -> None:
        """Set the node's entry in `/diagnostics`; a new level or message is published at once.

        Parameters
        ----------
        level : int
            `traction_node.diagnostic.OK`, `WARN`, `ERROR` or `STALE`.
        message : str
            One line for a person.
        **values
            Values for the message.
        """

    def get_logger(self) -> Logger:
        """Log of the node."""

    def finish(self, reason: str = '') -> None:
        """End the process, for example at the end of a bag; may be called from any thread.

        Parameters
        ----------
        reason : str
            Failure, printed in one line with exit status 1; empty for a regular end.
        """


class RosHost(Host, Protocol):
    """Host on rclpy, for nodes that use the middleware directly, such as a bag recorder."""

    @property
    def node(self) -> Any:
        """The rclpy node."""

    def await_delivery(self, publishers: Iterable[Publisher], timeout: float) -> bool:
        """Block until reliable subscribers have received all messages, before a node ends.

        Messages not received are lost with the publisher. Best-effort subscribers are ignored.

        Parameters
        ----------
        publishers : iterable of Publisher
            Publishers of this node.
        timeout : float
            Longest wait for all of them together, s, 0 or more.

        Returns
        -------
        bool
            True if all were received; False at the timeout.
        """
