"""Base classes of the suite's nodes: parameters, topics, diagnostics, lifecycle."""

import gc
import math
import sys
import time
import traceback
from types import SimpleNamespace

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
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.executors import Executor
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.task import Future

from traction_node import diagnostic
from traction_node.parameter import Parameter, ParameterError, resolve, unknown
from traction_node.topics import message_class, topic

QOS = {
    'sensor_data': QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT),
    'command': QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE),
    'latched': QoSProfile(
        depth=1,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    ),
    'reliable': QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE),
}
DIAGNOSTIC_PERIOD = 1.0  # [s]


def descriptor(parameter):
    """Description of a parameter for `ros2 param describe` and graphical tools.

    Parameters
    ----------
    parameter : traction_node.parameter.Parameter
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


class _Suite:
    """What both kinds of node have; mixed in before an rclpy node class."""

    NAME = ''
    PARAMETERS = ()

    def __init__(self, **kwargs):
        super().__init__(self.NAME, **kwargs)
        self.finished = Future()
        self._entities = []
        self._diagnostic = diagnostic.Diagnostic()
        self._diagnostic_publisher = self._create_publisher('/diagnostics')
        self._steady_clock = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(DIAGNOSTIC_PERIOD, self._report, clock=self._steady_clock)
        self._table = {parameter.name: parameter for parameter in self.parameter_table()}
        overrides = {name: p.value for name, p in self._parameter_overrides.items()}
        values = resolve(self._table.values(), overrides, others=self._parameters)
        self.p = SimpleNamespace(**values)
        self._check(self.p)
        for name, value in values.items():
            self.declare_parameter(
                name, value, descriptor(self._table[name]), ignore_override=True
            )

    def parameter_table(self):
        """All parameters of the node, those of its base class included."""
        return self.PARAMETERS

    # Hooks

    def check_parameters(self, p):
        """Refuse a combination of parameters; each value by itself is already checked.

        Parameters
        ----------
        p : types.SimpleNamespace
            The values as they would be.

        Raises
        ------
        ValueError
            With the reason, if they do not fit together.
        """

    def parameters_changed(self, p, names):
        """Take note of parameters that were set at run time.

        Parameters
        ----------
        p : types.SimpleNamespace
            The values, also at `self.p`.
        names : set of str
            Those that were set, be it to the value they had.
        """

    def finish(self, reason=''):
        """End the process from within, say at the end of a bag.

        Parameters
        ----------
        reason : str
            What went wrong, printed in one line with exit status 1; empty for a regular end.
        """
        if not self.finished.done():
            self.finished.set_result(reason)

    # Parameters

    def _check(self, p):
        try:
            self.check_parameters(p)
        except ParameterError:
            raise
        except ValueError as error:
            raise ParameterError(str(error)) from error

    def set_parameters_atomically(self, parameter_list):
        """Set parameters at run time, all or none; also what the parameter services call.

        Returns
        -------
        rcl_interfaces.msg.SetParametersResult
            With the reason if a value is refused.
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
            self.parameters_changed(p, {new.name for new in parameter_list})
        return result

    # Topics and timers

    def _create_publisher(self, name):
        row = topic(name)
        return Node.create_publisher(self, message_class(row.type), name, QOS[row.qos])

    def publisher(self, name):
        """Publisher of one of the suite's topics, type and quality of service from its table.

        Parameters
        ----------
        name : str
            Name in `topics.yaml`; remapping and namespaces apply.
        """
        publisher = self._create_publisher(name)
        self._entities.append((self.destroy_publisher, publisher))
        return publisher

    def message(self, name):
        """New message of one of the suite's topics, all zero.

        Parameters
        ----------
        name : str
            As for `publisher`.
        """
        return message_class(topic(name).type)()

    def subscription(self, name, callback):
        """Subscription to one of the suite's topics.

        Parameters
        ----------
        name : str
            As for `publisher`.
        callback : callable
            Called with each message.
        """
        row = topic(name)
        subscription = self.create_subscription(
            message_class(row.type), name, callback, QOS[row.qos]
        )
        self._entities.append((self.destroy_subscription, subscription))
        return subscription

    def service(self, name, type_name, callback):
        """Service of the node, such as `torque_gate/emergency_stop`.

        Parameters
        ----------
        name : str
            Name below that of the node, such as 'emergency_stop'.
        type_name : str
            Such as 'std_srvs/srv/SetBool'.
        callback : callable
            Called with request and response, gives the response.
        """
        service = self.create_service(message_class(type_name), f'~/{name}', callback)
        self._entities.append((self.destroy_service, service))
        return service

    def steady_timer(self, period, callback):
        """Timer that no simulated or stepped clock disturbs: for watchdogs.

        Parameters
        ----------
        period : float
            Period [s].
        callback : callable
            Called without arguments.
        """
        timer = self.create_timer(period, callback, clock=self._steady_clock)
        self._entities.append((self.destroy_timer, timer))
        return timer

    def steady_time(self):
        """Time of the clock of `steady_timer` [s]."""
        return time.monotonic()

    def _destroy_entities(self, first=0):
        """Destroy what was created by the methods above, from the one numbered `first`."""
        while len(self._entities) > first:
            destroy, entity = self._entities.pop()
            destroy(entity)

    # Diagnostics

    def set_diagnostic(self, level, message, **values):
        """Say how the node is; told at once if level or message are new, and once a second.

        Parameters
        ----------
        level : int
            `traction_node.diagnostic.OK`, `WARN`, `ERROR` or `STALE`.
        message : str
            One line for a person.
        **values
            Numbers and words behind it.
        """
        if self._diagnostic.change(level, message, values):
            self._report()

    def _diagnostic_values(self):
        return self._diagnostic.values

    def _report(self):
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


class TractionNode(_Suite, Node):
    """A node that works from its start to its end: a simulator, a player, a recorder.

    Class attributes
    ----------------
    NAME : str
        Name of the node, unless remapped.
    PARAMETERS : tuple of traction_node.parameter.Parameter
        Its parameters.
    """

    def start(self):
        """Hook: begin. Raise ValueError or OSError with a clear text to end the process."""

    def stop(self):
        """Hook: end; topics can still be published to."""

    def begin(self):
        """Start the node; called by `traction_node.run`."""
        self.start()

    def end(self):
        """Stop the node; called by `traction_node.run`."""
        self.stop()


class TractionLifecycleNode(_Suite, LifecycleNode):
    """A node that acts on the vehicle, and therefore is configured and activated from outside.

    Class attributes
    ----------------
    NAME, PARAMETERS
        As for `TractionNode`. The parameter `autostart` is always there.

    Attributes
    ----------
    active : bool
        True from before `activate` to after `deactivate`.
    """

    AUTOSTART = Parameter(
        'autostart', False, 'configure and activate at start, without being told', read_only=True
    )

    def __init__(self, **kwargs):
        self.active = False
        self._configured = 0
        super().__init__(**kwargs)
        self._diagnostic.message = 'unconfigured'
        # rclpy lets a request for an impossible transition end the process: answer it instead.
        self._change_state = self._service_change_state.callback
        self._service_change_state.callback = self._answer_change_state

    def parameter_table(self):
        """All parameters of the node, `autostart` first."""
        return (self.AUTOSTART, *self.PARAMETERS)

    # Hooks

    def configure(self):
        """Hook: read parameters, build the core, create topics and timers.

        Raises
        ------
        ValueError, OSError
            To refuse, with a clear text.
        """

    def activate(self):
        """Hook: begin to act. May refuse like `configure`.

        Topics and timers created here live until the node is deactivated.
        """

    def deactivate(self):
        """Hook: stop acting; topics can still be published to."""

    def cleanup(self):
        """Hook: forget what `configure` built. Topics and timers are destroyed afterwards."""

    # Transitions

    def _create_publisher(self, name):
        if name == '/diagnostics':
            return super()._create_publisher(name)
        row = topic(name)
        return self.create_lifecycle_publisher(message_class(row.type), name, QOS[row.qos])

    def publisher(self, name):
        """As `TractionNode.publisher`; what it publishes is dropped unless the node is active."""
        publisher = self._create_publisher(name)
        if self.active:
            publisher.on_activate(None)
        self._entities.append((self.destroy_lifecycle_publisher, publisher))
        return publisher

    def _diagnostic_values(self):
        return {'state': self._state_machine.current_state[1], **super()._diagnostic_values()}

    def _answer_change_state(self, request, response):
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

    def _call(self, hook):
        """Call a hook; a refusal is told in one line, a defect with its traceback."""
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

    def on_configure(self, state):
        """Transition of rclpy; write the hook `configure` instead."""
        result = self._call(self.configure)
        if result == TransitionCallbackReturn.SUCCESS:
            self._configured = len(self._entities)
            self.set_diagnostic(diagnostic.OK, 'inactive')
        else:
            self._destroy_entities()
        return result

    def on_activate(self, state):
        """Transition of rclpy; write the hook `activate` instead."""
        super().on_activate(state)
        self.active = True
        self.set_diagnostic(diagnostic.OK, 'active')
        result = self._call(self.activate)
        if result != TransitionCallbackReturn.SUCCESS:
            self._leave_active(state)
            return result
        # Collecting garbage takes milliseconds in which no torque would be checked. The executors
        # written in Python leave garbage behind with every callback, the EventsExecutor none.
        gc.collect()
        gc.freeze()
        if not isinstance(self.executor, Executor):
            gc.disable()
        return result

    def on_deactivate(self, state):
        """Transition of rclpy; write the hook `deactivate` instead."""
        result = self._call(self.deactivate)
        if result == TransitionCallbackReturn.SUCCESS:
            self._leave_active(state)
            self.set_diagnostic(diagnostic.OK, 'inactive')
        return result

    def _leave_active(self, state):
        self.active = False
        super().on_deactivate(state)
        self._destroy_entities(self._configured)
        gc.enable()
        gc.unfreeze()

    def on_cleanup(self, state):
        """Transition of rclpy; write the hook `cleanup` instead."""
        result = self._call(self.cleanup)
        if result == TransitionCallbackReturn.SUCCESS:
            self._destroy_entities()
            self.set_diagnostic(diagnostic.OK, 'unconfigured')
        return result

    def on_shutdown(self, state):
        """Transition of rclpy; goes through `deactivate` and `cleanup` as far as they are due."""
        if state.label == 'active':
            self._call(self.deactivate)
            self._leave_active(state)
        if state.label in ('active', 'inactive'):
            self._call(self.cleanup)
            self._destroy_entities()
        self.set_diagnostic(diagnostic.STALE, 'shut down')
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state):
        """Transition of rclpy after a defect: back to unconfigured, with nothing left over."""
        if self.active:
            self._leave_active(state)
        self._destroy_entities()
        return TransitionCallbackReturn.SUCCESS

    def begin(self):
        """Configure and activate if `autostart` says so; called by `traction_node.run`."""
        if self.p.autostart and self.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            self.trigger_activate()

    def end(self):
        """Shut down from whatever state; called by `traction_node.run`."""
        if self._state_machine.current_state[1] in ('unconfigured', 'inactive', 'active'):
            self.trigger_shutdown()
