"""Spinning and end of a node."""

import os
import re
import signal
import sys
import threading
import traceback
from collections.abc import Sequence

import rclpy
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.exceptions import ParameterException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.utilities import remove_ros_args

from traction_node.behaviour import Behaviour
from traction_node.node import HostNode, LifecycleHostNode
from traction_node.parameter_file import take_parameter_files
from traction_node.transport import use_udp

try:
    from rclpy.experimental import EventsExecutor
except ImportError:  # older releases of rclpy
    EventsExecutor = None  # type: ignore[assignment]

SIGNALS = {signal.SIGINT, signal.SIGTERM}
RCLError = rclpy_implementation.RCLError
DEFECT, BAD_INPUT = 1, 2
# Without a timeout the EventsExecutor of some releases waits in a busy loop. The future ends the
# spinning; after the timeout it only starts again.
SPIN_TIMEOUT = 60.0  # [s]
# An executor that works passes at once, but a busy machine may stand still for a second.
SELF_TEST_TIMEOUT = 10.0  # [s]


def self_test(executor: Executor, node: Node) -> bool:
    """True if an executor runs a timer, ends on a future, and ends on a timeout.

    Parameters
    ----------
    executor : rclpy.executors.Executor
        Executor with the node.
    node : rclpy.node.Node
        Node to create the timer with.
    """
    fired = Future()

    def fire() -> None:
        if not fired.done():
            fired.set_result(None)

    timer = node.create_timer(0.001, fire, clock=Clock(clock_type=ClockType.STEADY_TIME))
    try:
        executor.spin_until_future_complete(fired, timeout_sec=SELF_TEST_TIMEOUT)
        executor.spin_until_future_complete(Future(), timeout_sec=0.001)
        return bool(fired.done())
    except RuntimeError:
        return False
    finally:
        node.destroy_timer(timer)


def executor_for(node: Node) -> Executor:
    """Fastest executor that works on this machine, with the node added.

    The EventsExecutor takes a quarter of the processor time of the others and its timers are
    accurate to 0.1 ms. It is experimental, so it must pass a test first.
    """
    if EventsExecutor is not None:
        executor = EventsExecutor()
        executor.add_node(node)
        if self_test(executor, node):
            return executor
        executor.remove_node(node)
        executor.shutdown()
        node.get_logger().warning('EventsExecutor does not work here; using the slower one')
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    return executor


def catch_signals() -> int:
    """Write SIGINT and SIGTERM to a pipe, in any thread at any time.

    Python's handlers run in the main thread only, which is inside a C++ executor. Threads started
    by libraries at import can receive signals, too.

    Returns
    -------
    int
        File descriptor for reading: one byte per signal, its number.
    """
    receiving, sending = os.pipe()
    os.set_blocking(sending, False)
    for number in SIGNALS:
        signal.signal(number, lambda *_: None)
    signal.set_wakeup_fd(sending)
    return receiving


def stop_on_signal(signals: int, executor: Executor, stop: Future) -> None:
    """End spinning on the first SIGINT or SIGTERM, and the process on the second.

    After the first the node can still publish, which the signal handler of rclpy prevents.

    Parameters
    ----------
    signals : int
        Result of `catch_signals`.
    executor : rclpy.executors.Executor
        Executor that spins until `stop` is done.
    stop : rclpy.task.Future
        Future to complete.
    """

    def wait() -> None:
        os.read(signals, 1)
        if not stop.done():
            stop.set_result(None)
        executor.wake()
        second = os.read(signals, 1)[0]
        os._exit(128 + second)

    threading.Thread(target=wait, name='signals', daemon=True).start()


def spin(executor: Executor, stop: Future) -> None:
    """Run callbacks until `stop` is done or the context is shut down.

    Parameters
    ----------
    executor : rclpy.executors.Executor
    stop : rclpy.task.Future
    """
    try:
        while rclpy.ok() and not stop.done():
            executor.spin_until_future_complete(stop, timeout_sec=SPIN_TIMEOUT)
    except ExternalShutdownException:
        pass


def make_node(
    behaviour: type[Behaviour], parameter_files: Sequence[str] = ()
) -> HostNode | LifecycleHostNode:
    """Node of a behaviour, with or without lifecycle.

    Parameters
    ----------
    behaviour : type
        Subclass of `traction_node.behaviour.Behaviour`.
    parameter_files : sequence of str
        Parameter files; a later one overrides an earlier one.
    """
    return (LifecycleHostNode if behaviour.LIFECYCLE else HostNode)(behaviour, parameter_files)


def run(behaviour: type[Behaviour], args: list[str] | None = None) -> int:
    """Run a behaviour as a node until its end.

    Parameters
    ----------
    behaviour : type
        Subclass of `traction_node.behaviour.Behaviour`.
    args : list of str, optional
        Command line with the program name; default: that of the process.

    Returns
    -------
    int
        Exit status: 0 after SIGINT, SIGTERM, `finish()` or a shutdown of the context; 1 after
        `finish(reason)` or a defect (its traceback is printed); 2 after invalid input (printed in
        one line).
    """
    args = sys.argv if args is None else args
    signals = catch_signals()
    node = None
    try:
        try:
            use_udp()
            args, files = take_parameter_files(args)
            rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
            extra = remove_ros_args(args)[1:]
            if extra:
                raise ValueError(f'unknown argument "{extra[0]}"; give --ros-args -p NAME:=VALUE')
            node = make_node(behaviour, files)
            executor = executor_for(node)
            stop_on_signal(signals, executor, node.finished)
            node.begin()
        except (ValueError, OSError, ParameterException, RCLError) as error:
            report(behaviour, error)
            return BAD_INPUT
        reason: object = ''
        try:
            spin(executor, node.finished)
        finally:
            try:
                node.end()
            except (ValueError, OSError) as error:
                reason = error
        if node.finished.done() and node.finished.result():
            reason = node.finished.result()
        if reason:
            report(behaviour, reason)
            return DEFECT
        return 0
    except Exception:
        traceback.print_exc()
        return DEFECT
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()


def report(behaviour: type[Behaviour], reason: object) -> None:
    """Print the reason why a node does not run, in one line."""
    # rcl appends places in its source code, which do not help users.
    reason = re.sub(r', at \S+\.c:\d+', '', ' '.join(str(reason).split()))
    print(f'{behaviour.NAME}: {reason}', file=sys.stderr)
