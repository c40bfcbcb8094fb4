"""Nodes as processes, and a probe of their graph, for tests.

with NodeProcess(executable('torque_gate', 'torque_gate')) as gate, Probe() as probe:
    probe.change_state('torque_gate', 'configure')
    received = probe.subscribe('wheel_torque')
    ...
    probe.wait_for(lambda: received, 5.0, 'a first torque')
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
from pathlib import Path

import rclpy
from ament_index_python.packages import get_package_prefix
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter

from traction_node.node import QOS
from traction_node.topics import message_class, topic
from traction_node.transport import use_udp

END_TIMEOUT = 15.0  # [s]
SERVICE_TIMEOUT = 15.0  # [s]
ANSWER_TIMEOUT = 5.0  # [s]
ASKED_AT_MOST = 3
SETTLE_TIME = 0.2  # [s]
DEPTH = 1000  # queue of a subscription, messages


def executable(package, name):
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


def ros_arguments(params=None, params_files=(), remaps=None, namespace='', name=''):
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


def _yaml(value):
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

    def __init__(self, path, *args, env=None, quiet=False, **ros):
        self._quiet = quiet
        self.command = [str(path), *args, *ros_arguments(**ros)]
        self._lines = []
        self._changed = threading.Condition()
        self._process = subprocess.Popen(
            self.command,
            env={**os.environ, **(env or {})},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        for line in self._process.stdout:
            with self._changed:
                self._lines.append(line)
                self._changed.notify_all()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.running:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.interrupt()
        self.kill()
        self._reader.join()
        self._process.stdout.close()
        if not self._quiet:
            # The test runner shows it if the test failed.
            print(f'--- {" ".join(self.command)}: exit status {self._process.returncode}')
            print(self.output, end='')

    @property
    def pid(self):
        """Process number."""
        return self._process.pid

    @property
    def running(self):
        """True until the process has ended."""
        return self._process.poll() is None

    @property
    def output(self):
        """Output so far, of both streams."""
        with self._changed:
            return ''.join(self._lines)

    def wait_for_output(self, text, timeout=END_TIMEOUT):
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

    def wait(self, timeout=END_TIMEOUT):
        """Wait for the end of the process and of its output; returns its exit status.

        Parameters
        ----------
        timeout : float
            Longest time [s], after which subprocess.TimeoutExpired is raised.
        """
        status = self._process.wait(timeout)
        self._reader.join(timeout)
        return status

    def interrupt(self):
        """End it with SIGINT, as Ctrl-C; returns its exit status."""
        self._process.send_signal(signal.SIGINT)
        return self.wait()

    def terminate(self):
        """End it with SIGTERM; returns its exit status."""
        self._process.terminate()
        return self.wait()

    def kill(self):
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

    def __init__(self, namespace=''):
        self._context = rclpy.Context()
        use_udp()
        rclpy.init(args=[], context=self._context)
        self.node = rclpy.create_node('probe', context=self._context, namespace=namespace)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._publishers = {}
        self._clients = {}
        self._statuses = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()

    def wait_for(self, condition, timeout, what):
        """Run callbacks until a condition holds.

        Parameters
        ----------
        condition : callable
            Called without arguments after each callback; a true result ends the wait.
        timeout : float
            Longest time [s].
        what : str
            Name of the event, for the error.

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

    def run_for(self, duration):
        """Run callbacks for a time, to show that something does not happen.

        Parameters
        ----------
        duration : float
            Time [s].
        """
        with contextlib.suppress(TimeoutError):
            self.wait_for(lambda: False, duration, 'end')

    def subscribe(self, name, callback=None):
        """Subscribe to one of the suite's topics.

        Parameters
        ----------
        name : str
            Name in `topics.yaml`.
        callback : callable, optional
            Called with each message, too.

        Returns
        -------
        list
            Received messages; it grows.
        """
        received = []

        def take(message):
            received.append(message)
            if callback is not None:
                callback(message)

        row = topic(name)
        # Long enough that a busy test loses no messages.
        qos = copy.copy(QOS[row.qos])
        qos.depth = DEPTH
        self.node.create_subscription(message_class(row.type), name, take, qos)
        return received

    def publisher(self, name):
        """Publisher of one of the suite's topics, made once and matched with a subscription.

        Parameters
        ----------
        name : str
            Name in `topics.yaml`.
        """
        if name not in self._publishers:
            row = topic(name)
            self._publishers[name] = self.node.create_publisher(
                message_class(row.type), name, QOS[row.qos]
            )
        publisher = self._publishers[name]
        # At every call, since an earlier subscriber may have ended.
        if not publisher.get_subscription_count():
            self.wait_for(
                publisher.get_subscription_count, SERVICE_TIMEOUT, f'subscriber of {name}'
            )
            # The subscriber matches later than the publisher, without notice; until then
            # best-effort messages are lost.
            self.run_for(SETTLE_TIME)
        return publisher

    def call(self, service_type, name, request):
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
        for _ in range(ASKED_AT_MOST):
            with contextlib.suppress(_NoResponseError):
                return self._ask(service_type, name, request)
        raise TimeoutError(f'no answer of {name}, asked {ASKED_AT_MOST} times')

    def _ask(self, service_type, name, request):
        if name not in self._clients:
            self._clients[name] = self.node.create_client(service_type, name)
        client = self._clients[name]
        self.wait_for(client.service_is_ready, SERVICE_TIMEOUT, f'service {name}')
        future = client.call_async(request)
        try:
            self.wait_for(future.done, ANSWER_TIMEOUT, f'answer of {name}')
        except TimeoutError as error:
            client.remove_pending_request(future)
            raise _NoResponseError from error
        return future.result()

    def change_state(self, node, transition):
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
        request = ChangeState.Request(transition=Transition(label=transition))
        before = self.state(node)
        try:
            return self._ask(ChangeState, f'{node}/change_state', request).success
        except _NoResponseError:
            # If only the response was lost, a second request would be rejected.
            if self.state(node) != before:
                return True
            return self.call(ChangeState, f'{node}/change_state', request).success

    def state(self, node):
        """State of a lifecycle node, such as 'active'."""
        return self.call(GetState, f'{node}/get_state', GetState.Request()).current_state.label

    def set_parameter(self, node, name, value):
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

    def diagnostics(self, node):
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
            self._statuses = []
            self.node.create_subscription(
                DiagnosticArray,
                '/diagnostics',
                lambda array: self._statuses.extend(array.status),
                QOS['reliable'],
            )
        return [status for status in self._statuses if status.name == node]

    def wait_for_diagnostic(self, node, text, timeout=SERVICE_TIMEOUT):
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

        def found():
            return [status for status in self.diagnostics(node) if text in status.message]

        return self.wait_for(found, timeout, f'"{text}" in the diagnostics of {node}')[-1]
