"""Nodes as processes, and a probe of their graph, for tests.

with NodeProcess(executable('torque_gate', 'torque_gate')) as gate, Probe() as probe:
    probe.change_state('torque_gate', 'configure')
    received = probe.subscribe('wheel_torque')
    ...
    probe.wait_for(lambda: received, 'a first torque')
    assert gate.interrupt() == 0
"""

import contextlib
import copy
import json
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import IO, Any, cast

import rclpy
from ament_index_python.packages import get_package_prefix
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import GetParameterTypes, SetParameters
from rclpy.client import Client
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription

from traction_node.node import QOS
from traction_node.topics import message_class, topic
from traction_node.transport import use_udp

HANG_TIMEOUT = 60.0
"""Time after which a wait has failed, s; no measure of the speed of a node."""

ANSWER_TIMEOUT = 5.0
"""Time after which a service is called again, s."""

UNKNOWN = '_NODE_NAME_UNKNOWN_'
"""Name of a node of which only topics are known."""

DEPTH = 1000
"""Queue of a subscription, messages."""


def executable(package: str, name: str) -> Path:
    """Path of a node's executable, where `ros2 run` would find it.

    Parameters
    ----------
    package, name : str

    Returns
    -------
    pathlib.Path

    Raises
    ------
    FileNotFoundError
        If the package has no such executable.
    """
    path = Path(get_package_prefix(package), 'lib', package, name)
    if not path.is_file():
        raise FileNotFoundError(f'package {package} has no executable {name} ({path})')
    return path


def ros_arguments(
    params: Mapping[str, Any] | None = None,
    params_files: Sequence[str | Path] = (),
    remaps: Mapping[str, str] | None = None,
    namespace: str = '',
    name: str = '',
) -> list[str]:
    """Command line of a node, as for `ros2 run`.

    Parameters
    ----------
    params : dict, optional
        Parameter values by name.
    params_files : sequence of path-like
        YAML files of parameters; a later one overrides an earlier one.
    remaps : dict, optional
        Old names to new names.
    namespace, name : str
        Namespace and name of the node, empty for its own.

    Returns
    -------
    list of str
        Arguments from '--ros-args' on; empty if there are none.
    """
    rules = dict(remaps or {})
    if namespace:
        rules['__ns'] = '/' + namespace.strip('/')
    if name:
        rules['__node'] = name
    arguments = []
    for file in params_files:
        arguments += ['--params-file', str(file)]
    for key, value in (params or {}).items():
        arguments += ['-p', f'{key}:={_yaml(value)}']
    for old, new in rules.items():
        arguments += ['-r', f'{old}:={new}']
    return ['--ros-args', *arguments] if arguments else []


def _yaml(value: Any) -> str:
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, list | tuple):
        return '[' + ', '.join(_yaml(entry) for entry in value) + ']'
    # Quoted, as a text may look like a number or have a colon.
    return json.dumps(str(value)) if isinstance(value, str | Path) else str(value)


class NodeProcess:
    """Node in its own process; a context manager that ends the process.

    Parameters
    ----------
    path : path-like
        Executable, see `executable`.
    *args : str
        Further arguments.
    params, params_files, remaps, namespace, name
        See `ros_arguments`.
    env : dict of str, optional
        Environment variables to add.
    quiet : bool
        True: the output of the node is not printed at the end.
    """

    def __init__(
        self,
        path: str | Path,
        *args: str,
        env: Mapping[str, str] | None = None,
        quiet: bool = False,
        **ros: Any,
    ):
        self._quiet = quiet
        self._interrupted = False
        self.command = [str(path), *args, *ros_arguments(**ros)]
        self._lines: list[str] = []
        self._changed = threading.Condition()
        self._process = subprocess.Popen(
            self.command,
            env={**os.environ, **(env or {})},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self._stdout = cast(IO[str], self._process.stdout)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        for line in self._stdout:
            with self._changed:
                self._lines.append(line)
                self._changed.notify_all()

    def __enter__(self) -> 'NodeProcess':
        return self

    def __exit__(self, *_: object) -> None:
        if self.running:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.interrupt()
        self.kill()
        self._reader.join()
        self._stdout.close()
        if not self._quiet:
            # The test runner shows it if the test failed.
            print(f'--- {" ".join(self.command)}: exit status {self._process.returncode}')
            print(self.output, end='')

    @property
    def pid(self) -> int:
        """Process number."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """True until the process has ended."""
        return self._process.poll() is None

    @property
    def output(self) -> str:
        """Output so far, of both streams."""
        with self._changed:
            return ''.join(self._lines)

    def wait_for_output(self, text: str, timeout: float = HANG_TIMEOUT) -> None:
        """Wait until its output contains a text.

        Parameters
        ----------
        text : str
            Text to wait for.
        timeout : float
            Longest time [s].

        Raises
        ------
        TimeoutError
            If it does not come; the text has the whole output.
        """
        with self._changed:
            if not self._changed.wait_for(lambda: text in ''.join(self._lines), timeout):
                raise TimeoutError(f'no "{text}" in {timeout:g} s in:\n{"".join(self._lines)}')

    def wait(self, timeout: float = HANG_TIMEOUT) -> int:
        """Wait for the end of the process and of its output; returns its exit status.

        Parameters
        ----------
        timeout : float
            Longest time [s], after which subprocess.TimeoutExpired is raised.
        """
        status = self._process.wait(timeout)
        self._reader.join(timeout)
        return status

    def send_interrupt(self) -> None:
        """Send SIGINT, without waiting for the end; only once, as a second one aborts a node."""
        if self.running and not self._interrupted:
            self._interrupted = True
            self._process.send_signal(signal.SIGINT)

    def interrupt(self) -> int:
        """End it with SIGINT, as Ctrl-C; returns its exit status."""
        self.send_interrupt()
        return self.wait()

    def terminate(self) -> int:
        """End it with SIGTERM; returns its exit status."""
        self._process.terminate()
        return self.wait()

    def kill(self) -> int:
        """End it at once with SIGKILL; returns its exit status."""
        self._process.kill()
        return self.wait()


class _NoResponseError(TimeoutError):
    """An existing service did not respond."""


class Probe:
    """Node of a test, with its own context and executor.

    Parameters
    ----------
    namespace : str
        Namespace of the topics and nodes under test.

    Attributes
    ----------
    node : rclpy.node.Node
        Node of rclpy.
    """

    def __init__(self, namespace: str = ''):
        self._context = rclpy.Context()
        use_udp()
        rclpy.init(args=[], context=self._context)
        self.node = rclpy.create_node('probe', context=self._context, namespace=namespace)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._publishers: dict[str, Publisher] = {}
        self._subscriptions: dict[str, Subscription] = {}
        self._clients: dict[str, Client] = {}
        self._met: set[bytes] = set()
        self._statuses: list[DiagnosticStatus] | None = None

    def __enter__(self) -> 'Probe':
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()

    def wait_for(
        self, condition: Callable[[], Any], what: str, timeout: float = HANG_TIMEOUT
    ) -> Any:
        """Run callbacks until a condition holds.

        Parameters
        ----------
        condition : callable
            Called without arguments after each callback; a true result ends the wait.
        what : str
            Name of the event, for the error.
        timeout : float
            Longest time [s].

        Returns
        -------
        object
            Result of `condition`.

        Raises
        ------
        TimeoutError
            If it does not happen; the text has `what`.
        """
        end = time.monotonic() + timeout
        while not (result := condition()):
            if time.monotonic() > end:
                raise TimeoutError(f'no {what} in {timeout:g} s')
            self._executor.spin_once(timeout_sec=0.02)
        return result

    def run_for(self, duration: float) -> None:
        """Run callbacks for a time, to show that something does not happen.

        Parameters
        ----------
        duration : float
            Time [s].
        """
        with contextlib.suppress(TimeoutError):
            self.wait_for(lambda: False, 'end', timeout=duration)

    def subscribe(
        self,
        name: str,
        callback: Callable[[Any], None] | None = None,
        sent: list[float] | None = None,
    ) -> list[Any]:
        """Subscribe to one of the suite's topics.

        Messages from before the match with a publisher are lost, see `meet`.

        Parameters
        ----------
        name : str
            Name in `topics.yaml`.
        callback : callable, optional
            Called with each message, too.
        sent : list, optional
            Receives the time of publication of each message, in s of the system clock. With it, a
            probe that receives late still measures the speed of a node.

        Returns
        -------
        list
            Received messages; it grows.
        """
        received: list[Any] = []

        def take(message: Any, info: Any) -> None:
            received.append(message)
            if sent is not None:
                sent.append(info['source_timestamp'] * 1e-9)
            if callback is not None:
                callback(message)

        row = topic(name)
        # Long enough that a busy test loses no messages.
        qos = copy.copy(QOS[row.qos])
        qos.depth = DEPTH
        self._subscriptions[name] = self.node.create_subscription(
            message_class(row.type), name, cast(Callable[[Any], None], take), qos
        )
        return received

    def publisher(self, name: str) -> Publisher:
        """Publisher of one of the suite's topics, created once and matched with its subscribers.

        Parameters
        ----------
        name : str
            Name in `topics.yaml`.

        Returns
        -------
        rclpy.publisher.Publisher
            Publisher with at least one subscriber, matched on both sides.
        """
        if name not in self._publishers:
            row = topic(name)
            self._publishers[name] = self.node.create_publisher(
                message_class(row.type), name, QOS[row.qos]
            )
        publisher = self._publishers[name]
        # At every call, since an earlier subscriber may have ended.
        subscribers = self.wait_for(lambda: self._subscribers(publisher), f'subscriber of {name}')
        for identifier, node in subscribers.items():
            if identifier not in self._met:
                self.meet(node)
                self._met.add(identifier)
        return publisher

    def _subscribers(self, publisher: Publisher) -> dict[bytes, str]:
        """Names of the subscribed nodes by endpoint identifier; empty until all are known."""
        found = {
            bytes(info.endpoint_gid): (info.node_namespace, info.node_name)
            for info in self.node.get_subscriptions_info_by_topic(publisher.topic_name)
            if info.node_name != self.node.get_name()
        }
        if publisher.get_subscription_count() < len(found) or any(
            name == UNKNOWN for _, name in found.values()
        ):
            return {}
        return {gid: f'{space.rstrip("/")}/{name}' for gid, (space, name) in found.items()}

    def meet(self, node: str, *names: str) -> None:
        """Wait until a node is matched with all publishers and subscriptions of this probe.

        Messages are lost until both sides of a topic are matched, and each side knows only of
        itself. A process announces its endpoints in order, on reliable channels. So a node that
        responds to a new client is matched with all endpoints created before that client.

        Parameters
        ----------
        node : str
            Name of the node, which has the services for parameters.
        *names : str
            Topics that the node publishes and this probe has subscribed to, by their names in
            `topics.yaml`: their subscriptions are matched, too.

        Raises
        ------
        TimeoutError
            If nobody publishes one of the topics, or the node does not respond.
        """
        for name in names:
            self.wait_for(self._subscriptions[name].get_publisher_count, f'publisher of {name}')
        service = f'{node}/get_parameter_types'
        client = self.node.create_client(GetParameterTypes, service)
        try:
            self._ask(client, service, GetParameterTypes.Request())
        finally:
            self.node.destroy_client(client)

    def call(self, service_type: Any, name: str, request: Any) -> Any:
        """Call a service and wait for its response.

        DDS may lose the response to a new client, so a call without response is repeated. The
        service must allow this.

        Parameters
        ----------
        service_type : type
        name : str
        request : object
            Request of that type.

        Returns
        -------
        object
            Response.

        Raises
        ------
        TimeoutError
            If the service does not exist or does not respond.
        """
        return self._ask(self._client(service_type, name), name, request)

    def _client(self, service_type: Any, name: str) -> Client:
        if name not in self._clients:
            self._clients[name] = self.node.create_client(service_type, name)
        return self._clients[name]

    def _ask(self, client: Client, name: str, request: Any) -> Any:
        """Call a service until it responds."""
        end = time.monotonic() + HANG_TIMEOUT
        while time.monotonic() < end:
            with contextlib.suppress(_NoResponseError):
                return self._ask_once(client, name, request)
        raise TimeoutError(f'no response of {name} in {HANG_TIMEOUT:g} s')

    def _ask_once(self, client: Client, name: str, request: Any) -> Any:
        self.wait_for(client.service_is_ready, f'service {name}')
        future = client.call_async(request)
        try:
            self.wait_for(future.done, f'response of {name}', timeout=ANSWER_TIMEOUT)
        except TimeoutError as error:
            client.remove_pending_request(future)
            raise _NoResponseError from error
        return future.result()

    def change_state(self, node: str, transition: str) -> bool:
        """Request a transition of a lifecycle node.

        Parameters
        ----------
        node : str
            Name of the node.
        transition : str
            'configure', 'activate', 'deactivate', 'cleanup' or 'shutdown'.

        Returns
        -------
        bool
            True if it succeeded.
        """
        service = f'{node}/change_state'
        request = ChangeState.Request(transition=Transition(label=transition))
        before = self.state(node)
        try:
            client = self._client(ChangeState, service)
            return bool(self._ask_once(client, service, request).success)
        except _NoResponseError:
            # If only the response was lost, a second request would be rejected.
            if self.state(node) != before:
                return True
            return bool(self.call(ChangeState, service, request).success)

    def state(self, node: str) -> str:
        """State of a lifecycle node, such as 'active'."""
        return str(
            self.call(GetState, f'{node}/get_state', GetState.Request()).current_state.label
        )

    def set_parameter(self, node: str, name: str, value: Any) -> str:
        """Set a parameter of a running node.

        Returns
        -------
        str
            Reason of the rejection; empty if the value was accepted.
        """
        request = SetParameters.Request(
            parameters=[Parameter(name, value=value).to_parameter_msg()]
        )
        result = self.call(SetParameters, f'{node}/set_parameters', request).results[0]
        return '' if result.successful else result.reason or 'refused without a reason'

    def diagnostics(self, node: str) -> list[DiagnosticStatus]:
        """Entries of a node in `/diagnostics` so far, oldest first.

        Parameters
        ----------
        node : str
            Name in `/diagnostics`: name of the node with namespace.

        Returns
        -------
        list of diagnostic_msgs.msg.DiagnosticStatus
        """
        if self._statuses is None:
            statuses = self._statuses = []

            def take(array: Any) -> None:
                statuses.extend(array.status)

            self.node.create_subscription(DiagnosticArray, '/diagnostics', take, QOS['reliable'])
        return [status for status in self._statuses if status.name == node]

    def wait_for_diagnostic(
        self, node: str, text: str, timeout: float = HANG_TIMEOUT
    ) -> DiagnosticStatus:
        """Wait until a node's message in `/diagnostics` contains a text.

        Parameters
        ----------
        node, text : str
        timeout : float
            Longest time [s].

        Returns
        -------
        diagnostic_msgs.msg.DiagnosticStatus
            The newest entry with the text.
        """

        def found() -> list[DiagnosticStatus]:
            return [status for status in self.diagnostics(node) if text in status.message]

        return self.wait_for(found, f'"{text}" in the diagnostics of {node}', timeout=timeout)[-1]
