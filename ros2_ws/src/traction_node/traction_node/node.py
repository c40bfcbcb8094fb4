"""rclpy nodes that run a behaviour: parameters, topics, diagnostics, lifecycle."""

import gc
import math
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy import parameter as rclpy_parameter
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.executors import Executor
from rclpy.lifecycle import (
    LifecycleNode,
    LifecyclePublisher,
    LifecycleState,
    TransitionCallbackReturn,
)
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.task import Future
from rclpy.timer import Timer

from traction_node import diagnostic, quality_of_service
from traction_node.behaviour import Behaviour
from traction_node.parameter import NodeParameter, ParameterError, resolve, unknown
from traction_node.parameter_file import node_parameters
from traction_node.topics import message_class, topic

QOS = {
    name: QoSProfile(
        depth=qos.depth,
        reliability=(
            ReliabilityPolicy.RELIABLE if qos.reliable else ReliabilityPolicy.BEST_EFFORT
        ),
        durability=(
            DurabilityPolicy.TRANSIENT_LOCAL if qos.latched else DurabilityPolicy.VOLATILE
        ),
    )
    for name, qos in quality_of_service.QOS.items()
}
DIAGNOSTIC_PERIOD = 1.0  # [s]


def descriptor(parameter: NodeParameter) -> ParameterDescriptor:
    """Description of a parameter for `ros2 param describe` and graphical tools.

    Parameters
    ----------
    parameter : traction_node.parameter.NodeParameter
        Row of a node's table.

    Returns
    -------
    rcl_interfaces.msg.ParameterDescriptor
    """
    result = ParameterDescriptor(read_only=parameter.read_only)
    result.description = parameter.description + (f' [{parameter.unit}]' if parameter.unit else '')
    result.additional_constraints = parameter.range_text
    low, high = parameter.minimum, parameter.maximum
    if not parameter.is_list and (low is not None or high is not None):
        if parameter.type is int:
            low = -(2**63) if low is None else math.ceil(low)
            high = 2**63 - 1 if high is None else math.floor(high)
            result.integer_range = [IntegerRange(from_value=low, to_value=high)]
        else:
            low = -sys.float_info.max if low is None else float(low)
            high = sys.float_info.max if high is None else float(high)
            result.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    return result


class _HostNode(Node):
    """Host on rclpy; base class of the two kinds of node below.

    Parameters
    ----------
    behaviour : type
        Subclass of `traction_node.behaviour.Behaviour`.
    parameter_files : sequence of path-like
        Parameter files; a later one overrides an earlier one, and `-p` overrides all.
    **kwargs
        For `rclpy.node.Node`.

    Attributes
    ----------
    behaviour : traction_node.behaviour.Behaviour
        Behaviour with this node as host.
    p : types.SimpleNamespace
        Values of its parameters.
    active : bool
        True from before `activate` to after `deactivate`.
    finished : rclpy.task.Future
        Done when the node has to end; its result is the reason.
    """

    def __init__(
        self,
        behaviour: type[Behaviour],
        parameter_files: Sequence[str | Path] = (),
        **kwargs: Any,
    ):
        self.active = False
        super().__init__(behaviour.NAME, **kwargs)
        self.finished = Future()
        self._entities: list[tuple[Callable[[Any], Any], Any]] = []
        self._diagnostic = diagnostic.Diagnostic()
        self._diagnostic_publisher = self._create_publisher('/diagnostics')
        self._steady_clock = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(DIAGNOSTIC_PERIOD, self._report, clock=self._steady_clock)
        self._table = {row.name: row for row in behaviour.parameter_table()}
        given: dict[str, Any] = {}
        for file in parameter_files:
            given |= self._read(file)
        overrides = given | {name: p.value for name, p in self._parameter_overrides.items()}
        values = resolve(self._table.values(), overrides, others=self._parameters)
        self.p = SimpleNamespace(**values)
        self.behaviour = behaviour(self)
        self._check(self.p)
        for name, value in values.items():
            self.declare_parameter(
                name, value, descriptor(self._table[name]), ignore_override=True
            )
        # Parameters of rclpy, such as use_sim_time, which it reads from the command line only.
        own = [
            rclpy_parameter.Parameter(name, value=value)
            for name, value in given.items()
            if name not in self._table and name not in self._parameter_overrides
        ]
        if own:
            self.set_parameters_atomically(own)

    def _read(self, file: str | Path) -> dict[str, Any]:
        """Checked parameters of this node from a file."""
        node = self.get_fully_qualified_name()
        known = [*self._table, *self._parameters]
        values = node_parameters(file, node, known)
        try:
            for name, value in values.items():
                if name not in known:
                    raise unknown(name, known)
                if name in self._table:
                    self._table[name].check(value)
        except ParameterError as error:
            raise ParameterError(f'{file}: {node}: {error}') from error
        return values

    @property
    def node(self) -> Node:
        """This node."""
        return self

    def finish(self, reason: str = '') -> None:
        """End the process; see `traction_node.host.Host.finish`."""
        if not self.finished.done():
            self.finished.set_result(reason)
        if self.executor is not None:
            self.executor.wake()

    # Parameters

    def _check(self, p: SimpleNamespace) -> None:
        try:
            self.behaviour.check_parameters(p)
        except ParameterError:
            raise
        except ValueError as error:
            raise ParameterError(str(error)) from error

    def set_parameters_atomically(
        self, parameter_list: list[rclpy_parameter.Parameter]
    ) -> SetParametersResult:
        """Set parameters at run time, all or none; the parameter services call it, too.

        Returns
        -------
        rcl_interfaces.msg.SetParametersResult
            With the reason if a value is rejected.
        """
        values = dict(vars(self.p))
        accepted = []
        try:
            for new in parameter_list:
                row = self._table.get(new.name)
                if row is None:
                    if not self.has_parameter(new.name):
                        raise unknown(new.name, self._parameters)
                    accepted.append(new)
                    continue
                if row.read_only:
                    raise ParameterError(
                        f'parameter "{new.name}" cannot change while the node runs'
                    )
                values[new.name] = row.check(new.value)
                accepted.append(rclpy_parameter.Parameter(new.name, value=values[new.name]))
            p = SimpleNamespace(**values)
            self._check(p)
            result = super().set_parameters_atomically(accepted)
        except (ParameterError, ParameterNotDeclaredException) as error:
            return SetParametersResult(successful=False, reason=str(error))
        if result.successful:
            self.p = p
            self.behaviour.parameters_changed(p, {new.name for new in parameter_list})
        return result

    # Topics and timers: see `traction_node.host.Host`.

    def _create_publisher(self, name: str) -> Publisher:
        row = topic(name)
        return Node.create_publisher(self, message_class(row.type), name, QOS[row.qos])

    def publisher(self, name: str) -> Publisher:
        """Publisher of a topic."""
        publisher = self._create_publisher(name)
        self._entities.append((self.destroy_publisher, publisher))
        return publisher

    def message(self, name: str) -> Any:
        """New message of a topic, all fields zero or empty."""
        return message_class(topic(name).type)()

    def subscription(self, name: str, callback: Callable[[Any], None]) -> Subscription:
        """Subscribe to a topic."""
        row = topic(name)
        live = [True]

        def deliver(message: Any) -> None:
            # An executor may have a message queued when the subscription is destroyed.
            if live:
                callback(message)

        def destroy(entity: Subscription) -> None:
            live.clear()
            self.destroy_subscription(entity)

        subscription = self.create_subscription(
            message_class(row.type), name, deliver, QOS[row.qos]
        )
        self._entities.append((destroy, subscription))
        return subscription

    def publisher_count(self, name: str) -> int:
        """Number of publishers of a topic, in all processes."""
        return self.count_publishers(name)

    def service(self, name: str, type_name: str, callback: Callable[[Any, Any], Any]) -> Service:
        """Create a service in the namespace of the node."""
        service = self.create_service(message_class(type_name), f'~/{name}', callback)
        self._entities.append((self.destroy_service, service))
        return service

    def steady_timer(self, period: float, callback: Callable[[], None]) -> Timer:
        """Timer on the steady clock."""
        live = [True]

        def fire() -> None:
            if live:
                callback()

        def destroy(entity: Timer) -> None:
            live.clear()
            self.destroy_timer(entity)

        timer = self.create_timer(period, fire, clock=self._steady_clock)
        self._entities.append((destroy, timer))
        return timer

    def steady_time(self) -> float:
        """Time of the steady clock, s."""
        return time.monotonic()

    def await_delivery(self, publishers: Iterable[Publisher], timeout: float) -> bool:
        """Block until reliable subscribers have all messages; False at the timeout."""
        end = self.steady_time() + timeout
        return all(
            publisher.wait_for_all_acked(Duration(seconds=max(0.0, end - self.steady_time())))
            for publisher in publishers
        )

    def now(self) -> int:
        """ROS time, ns."""
        return self.get_clock().now().nanoseconds

    def _destroy_entities(self, first: int = 0) -> None:
        """Destroy entities created by the methods above, from index `first` on."""
        while len(self._entities) > first:
            destroy, entity = self._entities.pop()
            destroy(entity)

    # Diagnostics

    def set_diagnostic(self, level: int, message: str, **values: Any) -> None:
        """Set the entry in `/diagnostics`, published once a second and at changes."""
        if self._diagnostic.change(level, message, values):
            self._report()

    def _diagnostic_values(self) -> dict[str, object]:
        return self._diagnostic.values

    def _report(self) -> None:
        status = DiagnosticStatus(
            level=bytes([self._diagnostic.level]),
            name=self.get_fully_qualified_name().removeprefix('/'),
            message=self._diagnostic.message,
            values=[
                KeyValue(key=key, value=diagnostic.text(value))
                for key, value in self._diagnostic_values().items()
            ],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostic_publisher.publish(array)


class HostNode(_HostNode):
    """Node without lifecycle, active from start to end: a simulator, a player, a recorder."""

    def begin(self) -> None:
        """Configure and activate; called by `traction_node.run`.

        Raises
        ------
        ValueError, OSError
            If a hook of the behaviour fails.
        """
        self.behaviour.configure()
        self.active = True
        self.behaviour.activate()

    def end(self) -> None:
        """Deactivate and clean up, as far as necessary; called by `traction_node.run`.

        Raises
        ------
        ValueError, OSError
            If work in progress cannot be completed, such as a file.
        """
        if self.active:
            self.behaviour.deactivate()
            self.active = False
            self.behaviour.cleanup()


class LifecycleHostNode(_HostNode, LifecycleNode):
    """Lifecycle node: it acts on the vehicle, so other nodes configure and activate it."""

    def __init__(
        self,
        behaviour: type[Behaviour],
        parameter_files: Sequence[str | Path] = (),
        **kwargs: Any,
    ):
        self._configured = 0
        super().__init__(behaviour, parameter_files, **kwargs)
        self._diagnostic.message = 'unconfigured'
        # In rclpy a request for an impossible transition ends the process; this service responds.
        self._change_state = self._service_change_state.callback
        self._service_change_state.callback = self._answer_change_state

    # Transitions

    def _create_publisher(self, name: str) -> Publisher:
        if name == '/diagnostics':
            return super()._create_publisher(name)
        row = topic(name)
        publisher: LifecyclePublisher = self.create_lifecycle_publisher(
            message_class(row.type), name, QOS[row.qos]
        )
        return publisher

    def publisher(self, name: str) -> Publisher:
        """Publisher of a topic; messages are dropped unless the node is active."""
        publisher = self._create_publisher(name)
        if self.active and isinstance(publisher, LifecyclePublisher):
            publisher.on_activate(None)
        self._entities.append((self.destroy_lifecycle_publisher, publisher))
        return publisher

    def _diagnostic_values(self) -> dict[str, object]:
        return {'state': self._state_machine.current_state[1], **super()._diagnostic_values()}

    def _answer_change_state(self, request: Any, response: Any) -> Any:
        possible = {
            key: True
            for number, label, *_ in self._state_machine.available_transitions
            for key in (number, label)
        }
        wanted = request.transition.label or request.transition.id
        if wanted not in possible:
            state = self._state_machine.current_state[1]
            self.get_logger().warning(f'transition {wanted} refused: not possible when {state}')
            response.success = False
            return response
        return self._change_state(request, response)

    def _call(self, hook: Callable[[], None]) -> TransitionCallbackReturn:
        """Call a hook; log a failure in one line, a defect with its traceback."""
        name = hook.__name__
        try:
            hook()
        except (ValueError, OSError) as error:
            self.get_logger().error(f'{name} refused: {error}')
            self.set_diagnostic(diagnostic.ERROR, f'{name} refused: {error}')
            return TransitionCallbackReturn.FAILURE
        except Exception as error:
            self.get_logger().error(f'{name} failed\n{traceback.format_exc()}')
            self.set_diagnostic(diagnostic.ERROR, f'{name} failed: {error!r}')
            return TransitionCallbackReturn.ERROR
        return TransitionCallbackReturn.SUCCESS

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Transition of rclpy; calls the hook `configure`."""
        result = self._call(self.behaviour.configure)
        if result == TransitionCallbackReturn.SUCCESS:
            self._configured = len(self._entities)
            self.set_diagnostic(diagnostic.OK, 'inactive')
        else:
            self._destroy_entities()
        return result

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Transition of rclpy; calls the hook `activate`."""
        super().on_activate(state)
        self.active = True
        self.set_diagnostic(diagnostic.OK, 'active')
        result = self._call(self.behaviour.activate)
        if result != TransitionCallbackReturn.SUCCESS:
            self._leave_active(state)
            return result
        # Garbage collection takes milliseconds without a check of torque. Executors in Python
        # create garbage with every callback, the EventsExecutor does not.
        gc.collect()
        gc.freeze()
        if not isinstance(self.executor, Executor):
            gc.disable()
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Transition of rclpy; calls the hook `deactivate`."""
        result = self._call(self.behaviour.deactivate)
        if result == TransitionCallbackReturn.SUCCESS:
            self._leave_active(state)
            self.set_diagnostic(diagnostic.OK, 'inactive')
        return result

    def _leave_active(self, state: LifecycleState) -> None:
        self.active = False
        super().on_deactivate(state)
        self._destroy_entities(self._configured)
        gc.enable()
        gc.unfreeze()

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Transition of rclpy; calls the hook `cleanup`."""
        result = self._call(self.behaviour.cleanup)
        if result == TransitionCallbackReturn.SUCCESS:
            self._destroy_entities()
            self.set_diagnostic(diagnostic.OK, 'unconfigured')
        return result

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Transition of rclpy; calls `deactivate` and `cleanup` as far as necessary."""
        if state.label == 'active':
            self._call(self.behaviour.deactivate)
            self._leave_active(state)
        if state.label in ('active', 'inactive'):
            self._call(self.behaviour.cleanup)
            self._destroy_entities()
        self.set_diagnostic(diagnostic.STALE, 'shut down')
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Transition of rclpy after a defect: back to unconfigured."""
        if self.active:
            self._leave_active(state)
        self._destroy_entities()
        return TransitionCallbackReturn.SUCCESS

    def begin(self) -> None:
        """Configure and activate if `autostart` is set; called by `traction_node.run`."""
        if self.p.autostart and self.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            self.trigger_activate()

    def end(self) -> None:
        """Shut down from any state; called by `traction_node.run`."""
        if self._state_machine.current_state[1] in ('unconfigured', 'inactive', 'active'):
            self.trigger_shutdown()
