"""Node `bag_player`: publishes a bag's messages at the times they were recorded."""

import threading
from types import SimpleNamespace

from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from traction_node.behaviour import Behaviour
from traction_node.diagnostic import OK, WARN
from traction_node.host import RosHost
from traction_node.parameter import NodeParameter
from traction_node.run import run
from traction_node.subscribers import SubscriberWait
from traction_node.topics import message_class, topics
from tractor_io.bags.bag_error import BagError
from tractor_io.bags.reader import BagReader

ALL = 'all'

COMMANDS = (
    *(f'/{name}' for name, topic in topics().items() if topic.qos == 'command'),
    '/emergency_stop',
)
"""Topics that would move a vehicle, or end its emergency stop, in any namespace."""

ABSOLUTE = ('/clock', '/diagnostics')
"""Topics that have no namespace."""

DEPTH = 1000
"""Queue per topic, messages: slow subscribers lose none in a fast replay."""

CLOCK_STEP = 10_000_000
"""Bag time between two messages on /clock, ns."""

DELIVERY_TIME = 2.0
"""Longest wait at the end for subscribers to get the last messages, s."""

POLL_TIME = 0.01
"""Period of the search for subscribers, s."""

LAG = 0.1
"""Delay above which a warning is given, s."""


class BagPlayerBehaviour(Behaviour):
    """Publication of the messages of a bag; the node ends at the end of the bag."""

    NAME = 'bag_player'
    PARAMETERS = (
        NodeParameter(
            'bag',
            default='',
            description='bag folder, or .mcap or .db3 file',
            read_only=True,
        ),
        NodeParameter(
            'rate',
            default=1.0,
            description='speed of replay: bag time over real time',
            minimum=0.01,
            maximum=1000.0,
            read_only=True,
        ),
        NodeParameter(
            'loop',
            default=False,
            description='start again at the end',
            read_only=True,
        ),
        NodeParameter(
            'start_offset',
            default=0.0,
            description='skip the beginning of the bag',
            unit='s',
            minimum=0.0,
            read_only=True,
        ),
        NodeParameter(
            'clock',
            default=False,
            description='publish bag time on /clock',
            read_only=True,
        ),
        NodeParameter(
            'topics',
            default=[ALL],
            description=(
                f"topics to play; '{ALL}' leaves out those that carry torques, "
                'which have to be named'
            ),
            read_only=True,
        ),
        NodeParameter(
            'wait_for_subscribers',
            default=2.0,
            description='longest wait for every topic to have a subscriber',
            unit='s',
            minimum=0.0,
            read_only=True,
        ),
    )
    host: RosHost

    def check_parameters(self, p: SimpleNamespace) -> None:
        """Require a bag."""
        if not p.bag:
            raise ValueError('parameter "bag" must name a bag')

    def configure(self) -> None:
        """Open the bag and create the publishers."""
        p = self.host.p
        self._bag = BagReader(p.bag)
        if p.start_offset > self._bag.duration:
            raise ValueError(
                f'start_offset {p.start_offset} s is beyond the end of {p.bag}, '
                f'which is {self._bag.duration:.3f} s long'
            )
        if p.loop and p.start_offset == self._bag.duration:
            raise ValueError(f'{p.bag}: nothing to loop from {p.start_offset} s on')
        self._stopping = threading.Event()
        self._played = 0
        self._position = p.start_offset
        self._lag = 0.0
        names = self._bag.find(name for name in p.topics if name != ALL)
        left_out = set()
        if ALL in p.topics:
            left_out = {name for name in self._bag.topics if name.endswith(COMMANDS)} - names
            names = set(self._bag.topics) - left_out
        if p.clock:
            names.discard('/clock')  # two sources of time would contradict each other
        said = f'not played unless named in "topics": {", ".join(sorted(left_out))}'
        if not names:
            raise ValueError(f'{p.bag}: nothing to play' + (f'; {said}' if left_out else ''))
        if left_out:
            self.host.get_logger().info(said)
        self._outputs = {name: self._make_publisher(name) for name in sorted(names)}
        self._clock_publisher: Publisher | None = None
        if p.clock:
            self._clock_publisher = self.host.node.create_publisher(Clock, '/clock', 10)

    def activate(self) -> None:
        """Start to play."""
        self.host.steady_timer(1.0, self._update_diagnostic)
        self._thread = threading.Thread(target=self._play, name='player')
        self._thread.start()

    def deactivate(self) -> None:
        """End playing and close the bag."""
        self._stopping.set()
        self._thread.join()
        self._bag.close()

    def _make_publisher(self, name: str) -> Publisher:
        topic = self._bag.topics[name]
        try:
            kind = message_class(topic.type)
        except (ImportError, AttributeError):
            raise ValueError(
                f'{self.host.p.bag}: {name} has type {topic.type}, which is not installed; '
                'choose others with the parameter "topics"'
            ) from None
        # Reliable publishers match every subscriber and lose no messages in a fast replay.
        qos = QoSProfile(depth=max(DEPTH, topic.qos.depth), reliability=ReliabilityPolicy.RELIABLE)
        if topic.qos.latched:
            qos.durability = DurabilityPolicy.TRANSIENT_LOCAL
            qos.depth = topic.qos.depth
        name = name if name in ABSOLUTE else name.lstrip('/')
        publisher: Publisher = self.host.node.create_publisher(kind, name, qos)
        return publisher

    def _play(self) -> None:
        reason = ''
        try:
            wait = SubscriberWait(self._outputs, self.host.p.wait_for_subscribers)
            while not (wait.over(self.host.steady_time()) or self._stopping.wait(POLL_TIME)):
                pass
            if wait.missing and not self._stopping.is_set():
                self.host.get_logger().info(
                    f'playing without subscriber to {", ".join(wait.missing)}'
                )
            while self._play_once() and self.host.p.loop:
                pass
            if not self._stopping.is_set():
                self.host.await_delivery(self._outputs.values(), DELIVERY_TIME)
        except BagError as error:
            reason = str(error)
        self.host.finish(reason)

    def _play_once(self) -> bool:
        """Play the bag from start to end; False when told to stop."""
        first = self._bag.start + round(self.host.p.start_offset * 1e9)
        # All due times are relative to this one reading of the clock, so they do not drift.
        origin = self.host.steady_time()
        per_bag_time = 1e-9 / self.host.p.rate
        tick = first
        for message in self._bag.messages(list(self._outputs), self.host.p.start_offset, raw=True):
            while self._clock_publisher and tick <= message.time:
                if not self._wait_until(origin + (tick - first) * per_bag_time):
                    return False
                sec, nanosec = divmod(tick, 10**9)
                clock = Clock()
                clock.clock.sec, clock.clock.nanosec = sec, nanosec
                self._clock_publisher.publish(clock)
                tick += CLOCK_STEP
            if not self._wait_until(origin + (message.time - first) * per_bag_time):
                return False
            self._outputs[message.topic].publish(message.message)
            self._played += 1
            self._position = (message.time - self._bag.start) * 1e-9
        # Wait for the end of the bag, also if the played topics end earlier.
        return self._wait_until(origin + (self._bag.end - first) * per_bag_time)

    def _wait_until(self, due: float) -> bool:
        """Wait for a time of the steady clock; False when told to stop."""
        delay = due - self.host.steady_time()
        self._lag = max(0.0, -delay)
        if delay > 0.0:
            return not self._stopping.wait(delay)
        return not self._stopping.is_set()

    def _update_diagnostic(self) -> None:
        late = self._lag > LAG
        self.host.set_diagnostic(
            WARN if late else OK,
            f'this machine is too slow for rate {self.host.p.rate:g}' if late else 'playing',
            bag=self.host.p.bag,
            position_s=round(self._position, 3),
            duration_s=round(self._bag.duration, 3),
            lag_s=round(self._lag, 3),
            messages=self._played,
        )


def main() -> int:
    """Entry point of the executable `bag_player`."""
    return run(BagPlayerBehaviour)
