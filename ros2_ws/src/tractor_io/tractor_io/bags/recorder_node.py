"""Node `bag_recorder`: writes the suite's topics into an MCAP bag."""

from types import SimpleNamespace
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.client import Client
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import (
    DurabilityPolicy,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
    qos_profile_parameter_events,
)
from rclpy.subscription import Subscription
from rclpy.task import Future

from traction_node.behaviour import Behaviour
from traction_node.diagnostic import OK, WARN
from traction_node.host import RosHost
from traction_node.parameter import NodeParameter
from traction_node.quality_of_service import QOS, Qos
from traction_node.run import run
from traction_node.topics import message_class, topic, topics
from tractor_io.bags.bag_error import BagError
from tractor_io.bags.plain_yaml import dump_plain_yaml
from tractor_io.bags.versions import versions
from tractor_io.bags.writer import BagWriter

ALL = 'all'

DEPTH = 1000
"""Queue per topic while the disk is slow, messages."""

FLUSH_PERIOD = 0.2
"""Period of the transfer of messages to the operating system, s."""

ASK_PERIOD = 1.0
"""Period of the search for nodes whose parameters are not in the bag yet, s."""

ASK_EVERY = 5
"""Searches between two requests to a node, which may be busy for seconds at its start."""

MAX_LOOKS = 60
"""Searches after which a node without response is left out."""

MAX_CHANGES = 100
"""Number of the newest parameter changes of a node that are kept."""


class BagRecorderBehaviour(Behaviour):
    """Recording of topics until the node is shut down."""

    NAME = 'bag_recorder'
    PARAMETERS = (
        NodeParameter(
            'output',
            default='',
            description='folder of the bag to write; must not exist',
            read_only=True,
        ),
        NodeParameter(
            'topics',
            default=[ALL],
            description=f"topics to record; '{ALL}': all topics of the suite",
            read_only=True,
        ),
    )
    host: RosHost

    def check_parameters(self, p: SimpleNamespace) -> None:
        """Require an output, and topics of the suite."""
        if not p.output:
            raise ValueError('parameter "output" must name a folder')
        for name in p.topics:
            if name != ALL and _table_name(name) not in topics():
                raise ValueError(
                    f'parameter "topics": the suite has no topic {name}; '
                    f'it has {", ".join(topics())}'
                )

    def activate(self) -> None:
        """Create the bag and subscribe."""
        about = {'source': 'recorded by bag_recorder', **versions()}
        # None once it has failed.
        self._writer: BagWriter | None = BagWriter(self.host.p.output, about)
        # By node: count of searches and count at the next request; clients of open requests.
        self._looks: dict[str, int] = {}
        self._ask_at: dict[str, int] = {}
        self._requests: dict[str, tuple[Client, Client]] = {}
        # By node: changes while recording; and custom data not yet written.
        self._changes: dict[str, list[dict[str, Any]]] = {}
        self._custom_data: dict[str, str] = {}
        self._qos: dict[str, QoSProfile] = {}
        self._subscriptions_by_name: dict[str, Subscription] = {}
        names = topics() if ALL in self.host.p.topics else map(_table_name, self.host.p.topics)
        for name in dict.fromkeys(names):
            # Reliable as long as all publishers are: see _relax.
            self._qos[name] = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE)
            if topic(name).qos == 'latched':
                self._qos[name].durability = DurabilityPolicy.TRANSIENT_LOCAL
            self._subscribe(name)
        self.host.node.create_subscription(
            ParameterEvent, '/parameter_events', self._note_changes, qos_profile_parameter_events
        )
        self.host.steady_timer(1.0, self._update_diagnostic)
        self.host.steady_timer(FLUSH_PERIOD, self._flush)
        self.host.steady_timer(ASK_PERIOD, self._request_parameters)
        self._update_diagnostic()

    def deactivate(self) -> None:
        """Finish the bag."""
        if self._writer is None:
            return
        self._write_custom_data(self._writer)
        self._writer.close()
        self.host.get_logger().info(
            f'{self.host.p.output}: {sum(self._writer.counts.values())} messages recorded'
        )

    def _subscribe(self, name: str) -> None:
        row = topic(name)

        def take(data: bytes) -> None:
            self._write(name, subscription.topic_name, data)

        subscription = self.host.node.create_subscription(
            message_class(row.type),
            name,
            take,
            self._qos[name],
            raw=True,
            event_callbacks=SubscriptionEventCallbacks(
                incompatible_qos=lambda info: self._relax(name, info)
            ),
        )
        self._subscriptions_by_name[name] = subscription

    def _relax(self, name: str, info: Any) -> None:
        """Lower the requested quality of service to that of a publisher that offers less."""
        qos = self._qos[name]
        if info.last_policy_kind == QoSPolicyKind.RELIABILITY:
            qos.reliability = ReliabilityPolicy.BEST_EFFORT
        elif info.last_policy_kind == QoSPolicyKind.DURABILITY:
            qos.durability = DurabilityPolicy.VOLATILE
        else:
            self.host.get_logger().warning(
                f'{name}: a publisher with other deadlines is not recorded'
            )
            return
        self.host.node.destroy_subscription(self._subscriptions_by_name[name])
        self._subscribe(name)

    def _write(self, name: str, full_name: str, data: bytes) -> None:
        writer = self._writer
        if writer is None:
            return
        try:
            if full_name not in writer.counts:
                writer.add_topic(full_name, topic(name).type, self._recorded_qos(name))
            writer.write(full_name, self.host.now(), data)
        except BagError as error:
            self._give_up(writer, error)

    # Parameters of other nodes: asynchronous requests, so that recording does not wait.

    def _request_parameters(self) -> None:
        writer = self._writer
        if writer is None:
            return
        try:
            self._write_custom_data(writer)
        except BagError as error:
            self._give_up(writer, error)
            return
        for name, namespace in self.host.node.get_node_names_and_namespaces():
            node = f'{namespace.rstrip("/")}/{name}'
            # Hidden nodes belong to tools.
            if self._is_ours(node) and not name.startswith('_') and node not in self._looks:
                self._looks[node] = self._ask_at[node] = 0
                self._requests[node] = (
                    self.host.node.create_client(ListParameters, f'{node}/list_parameters'),
                    self.host.node.create_client(GetParameters, f'{node}/get_parameters'),
                )
        for node, (listing, getting) in list(self._requests.items()):
            self._looks[node] += 1
            if self._looks[node] > MAX_LOOKS:
                self._close_requests(node)
            elif self._looks[node] < self._ask_at[node]:
                continue
            elif listing.service_is_ready() and getting.service_is_ready():
                self._ask_at[node] = self._looks[node] + ASK_EVERY
                listing.call_async(ListParameters.Request()).add_done_callback(
                    lambda future, node=node: self._take_names(node, future)
                )

    def _take_names(self, node: str, future: Future) -> None:
        if node not in self._requests or future.result() is None:
            return
        names = sorted(future.result().result.names)
        self._requests[node][1].call_async(GetParameters.Request(names=names)).add_done_callback(
            lambda answer: self._take_parameters(node, names, answer)
        )

    def _take_parameters(self, node: str, names: list[str], future: Future) -> None:
        # A node with a parameter without value sends an empty response.
        if (
            node not in self._requests
            or future.result() is None
            or len(future.result().values) != len(names)
        ):
            return
        found = map(parameter_value_to_python, future.result().values)
        values = {name: _plain(value) for name, value in zip(names, found, strict=True)}
        # The next search destroys its clients; one of them is the caller of this function.
        self._looks[node] = MAX_LOOKS
        self._custom_data[f'parameters {node}'] = dump_plain_yaml(values, inline_lists=True)

    def _note_changes(self, event: ParameterEvent) -> None:
        if not (event.changed_parameters and self._is_ours(event.node)):
            return
        time = event.stamp.sec + round(1e-9 * event.stamp.nanosec, 3)
        changes = self._changes.setdefault(event.node, [])
        for parameter in event.changed_parameters:
            value = _plain(parameter_value_to_python(parameter.value))
            changes.append({'time': time, parameter.name: value})
        del changes[:-MAX_CHANGES]
        self._custom_data[f'changed {event.node}'] = dump_plain_yaml(changes, inline_lists=True)

    def _write_custom_data(self, writer: BagWriter) -> None:
        """Write new custom data; seldom, because each record repeats all of it."""
        if self._custom_data:
            writer.say(self._custom_data)
            self._custom_data = {}

    def _is_ours(self, node: str) -> bool:
        return node.startswith(self.host.node.get_namespace().rstrip('/') + '/')

    def _close_requests(self, node: str) -> None:
        for client in self._requests.pop(node):
            self.host.node.destroy_client(client)

    def _flush(self) -> None:
        writer = self._writer
        if writer is None:
            return
        try:
            writer.flush()
        except BagError as error:
            self._give_up(writer, error)

    def _give_up(self, writer: BagWriter, error: BagError) -> None:
        writer.abort()
        self._writer = None
        self.host.finish(
            f'{error}; the bag ends without index: traction bag repair {self.host.p.output}'
        )

    def _recorded_qos(self, name: str) -> Qos:
        qos = self._qos[name]
        return Qos(
            reliable=qos.reliability == ReliabilityPolicy.RELIABLE,
            latched=qos.durability == DurabilityPolicy.TRANSIENT_LOCAL,
            depth=QOS[topic(name).qos].depth,
        )

    def _update_diagnostic(self) -> None:
        if self._writer is not None:
            counts = self._writer.counts
            self.host.set_diagnostic(
                OK if counts else WARN,
                f'{"recording" if counts else "nothing yet to record"} to {self.host.p.output}',
                messages=sum(counts.values()),
                **counts,
            )


def _plain(value: Any) -> Any:
    """Value of a parameter as plain YAML."""
    return value if value is None or isinstance(value, bool | int | float | str) else list(value)


def _table_name(name: str) -> str:
    """Name of a topic in the suite's table, whether or not given with a leading slash."""
    return name if name in topics() else name.lstrip('/')


def main() -> int:
    """Entry point of the executable `bag_recorder`."""
    return run(BagRecorderBehaviour)
