"""CAN bridge node: bus to `wheel_states` and `radar`, `wheel_torque` to the engine's limit."""

import collections
import threading
import time

import can
from geometry_msgs.msg import TwistWithCovarianceStamped
from sensor_msgs.msg import JointState

from traction_interfaces.msg import CanFrame, CanFrames
from traction_node.diagnostic import ERROR, OK, WARN
from traction_node.joints import JointError, JointOrder
from traction_node.node import TractionLifecycleNode
from traction_node.parameter import NodeParameter
from traction_node.run import run
from tractor_io.can.address_claim import AddressClaim, Claim, name_of
from tractor_io.can.drivetrain import Drivetrain
from tractor_io.can.interface import DEFAULT_PORT, INTERFACES, frame, open_bus
from tractor_io.can.j1939 import Unknown
from tractor_io.can.parameter_group import FrameError, tractor_groups
from tractor_io.can.torque_limit import PERIOD
from tractor_io.can.vehicle_bus import VehicleBus

TELL_PERIOD = 1.0
"""Time between two regular reports, s."""

LISTEN_PERIOD = 0.1
"""Longest wait for a frame before looking whether to end, s."""

FULL_BUS = 0.9 * 250_000 / 128
"""Frames of eight bytes from which on a bus of 250 kbit/s counts as full, 1/s."""

RETRY_PERIOD = 0.5
"""Wait after the bus has failed twice in a row, s."""

FRAMES_PERIOD = 0.02
"""Time between two messages of raw frames, s."""

MAX_RAW_FRAMES = 100
"""Raw frames in one message: 5000 a second, more than a bus of 500 kbit/s can carry."""

MAX_FRAMES = 100
"""Frames taken in within a period of the limit: more is a flood, and waits for the next one."""

# Manufacturer code for those without one of their own, and the function of a NAME.
_MANUFACTURER, _FUNCTION = 2046, 130


DRIVETRAIN_PARAMETERS = (
    NodeParameter(
        'wheel_names',
        default=['fl', 'fr', 'rl', 'rr'],
        description='wheels front left and right, rear left and right',
        read_only=True,
    ),
    NodeParameter(
        'wheel_radii',
        default=[0.65, 0.65, 0.85, 0.85],
        description='their rolling radii',
        unit='m',
        minimum=0.01,
        maximum=5.0,
        read_only=True,
    ),
    NodeParameter(
        'reference_torque',
        default=500.0,
        description='engine torque of 100 %',
        unit='N·m',
        minimum=1.0,
        maximum=1e5,
        read_only=True,
    ),
    NodeParameter(
        'gear_ratio',
        default=40.0,
        description='engine speed over wheel speed',
        minimum=1e-3,
        maximum=1e4,
        read_only=True,
    ),
    NodeParameter(
        'efficiency',
        default=0.9,
        description='torque at the wheels over ratio and engine torque',
        minimum=0.01,
        maximum=1.0,
        read_only=True,
    ),
    NodeParameter(
        'front_share',
        default=0.3,
        description='share of torque of the front axle while engaged',
        minimum=0.0,
        maximum=0.99,
        read_only=True,
    ),
    NodeParameter(
        'front_engaged',
        default=True,
        description='whether the front axle is driven',
    ),
)
"""Parameters of wheels and drivetrain."""


class CanBridgeNode(TractionLifecycleNode):
    """Bridge to a tractor's bus; see `tractor_io.can.vehicle_bus` for what it hears and sends."""

    NAME = 'can_bridge'
    PARAMETERS = (
        NodeParameter(
            'interface',
            default='socketcan',
            description=f'kind of bus: {", ".join(INTERFACES)}',
            read_only=True,
        ),
        NodeParameter(
            'channel',
            default='',
            description=(
                'name of the bus, multicast address, or path of the candump log; empty '
                'for can0, 239.74.163.2'
            ),
            read_only=True,
        ),
        NodeParameter(
            'port',
            default=DEFAULT_PORT,
            description='port of a bus over UDP',
            minimum=1,
            maximum=65535,
            read_only=True,
        ),
        NodeParameter(
            'log',
            default='',
            description='candump log to write all frames to; empty for none',
            read_only=True,
        ),
        *DRIVETRAIN_PARAMETERS,
        NodeParameter(
            'address',
            default=0x87,
            description='address to claim first',
            minimum=0,
            maximum=253,
            read_only=True,
        ),
        NodeParameter(
            'identity',
            default=1,
            description='number of this device in its NAME',
            minimum=0,
            maximum=2**21 - 1,
            read_only=True,
        ),
        NodeParameter(
            'engine_address',
            default=0,
            description='address of the engine',
            minimum=0,
            maximum=253,
            read_only=True,
        ),
        NodeParameter(
            'sources',
            default=['any'],
            description='who is heard, as MESSAGE=ADDRESS; any: whoever is first',
            read_only=True,
        ),
        NodeParameter(
            'missed',
            default=5.0,
            description='periods without a frame after which a message is silent',
            minimum=1.1,
            maximum=100.0,
            read_only=True,
        ),
        NodeParameter(
            'timeout',
            default=0.14,
            description=(
                'time after the last wheel_torque from which on the engine is limited to '
                'none: longer than the gate is silent before it releases'
            ),
            unit='s',
            minimum=0.01,
            maximum=0.19,
            read_only=True,
        ),
        NodeParameter(
            'radar_variance',
            default=0.0025,
            description='variance of the speed over ground',
            unit='m²/s²',
            minimum=1e-8,
            maximum=100.0,
            read_only=True,
        ),
    )
    _bus = None

    def check_parameters(self, p):
        """Refuse what does not fit together."""
        if p.interface not in INTERFACES:
            raise ValueError(
                f'parameter "interface": unknown \'{p.interface}\', '
                f'there are {", ".join(INTERFACES)}'
            )
        if p.log and p.log == p.channel:
            raise ValueError(f'parameter "log": {p.log} is the log that is heard')
        _make_bus(p)

    def parameters_changed(self, p, names):
        """Follow the engagement of the front axle."""
        if self._bus is not None:
            with self._lock:
                self._bus.front_engaged = p.front_engaged

    def configure(self):
        """Build the bus as it is seen, and topics."""
        self._lock = threading.Lock()
        self._bus = _make_bus(self.p)
        self._torques = JointOrder(self.p.wheel_names, 'wheel_torque effort', only=True)
        self._wheels = JointState()
        self._wheels.header.frame_id = 'base_link'
        self._radar = TwistWithCovarianceStamped()
        self._radar.header.frame_id = 'base_link'
        self._radar.twist.covariance[0] = self.p.radar_variance
        self._wheels_publisher = self.publisher('wheel_states')
        self._radar_publisher = self.publisher('radar')
        self._frames_publisher = self.publisher('can_frames')
        self.subscription('wheel_torque', self._command)

    def activate(self):
        """Open the bus, listen, claim an address, and limit the engine from then on."""
        self._counts = dict.fromkeys(
            (
                'frames', 'error_frames', 'bad_frames', 'floods', 'bad_torques', 'failures',
                'log_failures',
            ), 0,
        )  # fmt: skip
        self._failure = ''
        # Frames that are still to be told, with their times, and how many were too many.
        self._raw = []
        self._missed = 0
        # What was sent last and has not come back.
        self._echoes = collections.deque(maxlen=16)
        # Until when a flood was last met, s.
        self._flooded = 0.0
        self._told = None
        self._told_at = 0.0
        self._trouble = ''
        self._counted_at = time.monotonic()
        self._counted = dict(self._counts)
        self._can = open_bus(self.p.interface, self.p.channel, self.p.port)
        try:
            # What an earlier drive left there stays.
            self._log = can.CanutilsLogWriter(self.p.log, append=True) if self.p.log else None
        except OSError:
            self._can.shutdown()
            raise
        self._ended = threading.Event()
        # A log is heard, and not sent to.
        self._sends = self.p.interface != 'candump'
        if self._sends:
            self._bus.begin(time.monotonic())
        self._thread = threading.Thread(target=self._listen, name='can', daemon=True)
        self._thread.start()
        self.steady_timer(PERIOD, self._work)
        self.steady_timer(FRAMES_PERIOD, self._tell_frames)

    def deactivate(self):
        """Give the engine back to its driver, and let go of the bus."""
        self._ended.set()
        with self._lock:
            self._bus.end()
            self._send(self._bus.outgoing(time.monotonic()))
        self._thread.join()
        self._can.shutdown()
        if self._log is not None:
            self._log.stop()

    # The bus, in a thread of its own

    def _listen(self):
        taken, until = 0, 0.0
        failing = False
        while not self._ended.is_set():
            try:
                message = self._can.recv(LISTEN_PERIOD)
            except (can.CanError, OSError) as error:
                with self._lock:
                    self._failed(error)
                if failing:
                    self._ended.wait(RETRY_PERIOD)
                failing = True
                continue
            failing = False
            if message is None:
                continue
            now = time.monotonic()
            if now >= until:
                taken, until = 0, now + PERIOD
            elif taken >= MAX_FRAMES:
                # Leaves the processor to the limit; the driver's own queue drops what is too much.
                with self._lock:
                    self._counts['floods'] += 1
                    self._flooded = now + TELL_PERIOD
                self._ended.wait(until - now)
            taken += 1
            with self._lock:
                self._take(message)

    def _take(self, message):
        now = time.monotonic()
        sent = message.arbitration_id, bytes(message.data)
        if sent in self._echoes:
            # A bus over UDP gives back what was sent.
            self._echoes.remove(sent)
            return
        self._counts['frames'] += 1
        self._failure = ''
        self._keep(message)
        if message.is_error_frame:
            self._counts['error_frames'] += 1
            return
        if not message.is_extended_id or message.is_remote_frame:
            # Not J1939.
            return
        try:
            group = self._bus.take(now, message.arbitration_id, bytes(message.data))
        except FrameError:
            self._counts['bad_frames'] += 1
            return
        if group is None:
            return
        if group.name == 'HRW':
            self._publish_wheels(now)
        elif group.name == 'GBSD':
            self._publish_radar(now)

    def _publish_wheels(self, now):
        speeds, torques = self._bus.wheel_speeds(now), self._bus.shaft_torques(now)
        known = [j for j, speed in enumerate(speeds) if not isinstance(speed, Unknown)]
        if not known:
            return
        message = self._wheels
        message.header.stamp = self.get_clock().now().to_msg()
        message.name = [self.p.wheel_names[j] for j in known]
        message.velocity = [speeds[j] for j in known]
        message.effort = [] if torques is None else [float(torques[j]) for j in known]
        self._wheels_publisher.publish(message)

    def _publish_radar(self, now):
        speed = self._bus.ground_speed(now)
        if isinstance(speed, Unknown):
            return
        self._radar.header.stamp = self.get_clock().now().to_msg()
        self._radar.twist.twist.linear.x = speed
        self._radar_publisher.publish(self._radar)

    # The node

    def _command(self, message):
        if not self.active:
            return
        with self._lock:
            try:
                torques = self._torques.values(message.name, message.effort)
                self._bus.command(time.monotonic(), torques)
            except JointError:
                self._counts['bad_torques'] += 1

    def _work(self):
        now = time.monotonic()
        with self._lock:
            self._send(self._bus.outgoing(now))
            self._tell(now)

    def _send(self, frames):
        for k, (identifier, data) in enumerate(frames):
            message = frame(identifier, data)
            try:
                self._can.send(message)
            except (can.CanError, OSError) as error:
                self._failed(error)
                self._bus.unsent(time.monotonic(), frames[k:])
                return
            message.timestamp = time.time()
            self._keep(message)
            if self.p.interface == 'udp_multicast':
                self._echoes.append((identifier, data))

    def _keep(self, message):
        """Note a frame in the log, and for those who record."""
        if self._log is not None:
            try:
                self._log.on_message_received(message)
            except (OSError, ValueError):
                # A full disk must not stop the limit.
                self._counts['log_failures'] += 1
        if len(self._raw) < MAX_RAW_FRAMES:
            self._raw.append((self.get_clock().now(), message))
        else:
            self._missed += 1

    def _tell_frames(self):
        with self._lock:
            raw, self._raw = self._raw, []
            missed, self._missed = self._missed, 0
        if (raw or missed) and self._frames_publisher.get_subscription_count():
            frames = [_raw_frame(time, message) for time, message in raw]
            self._frames_publisher.publish(CanFrames(frames=frames, missed=missed))

    def _failed(self, error):
        self._counts['failures'] += 1
        self._failure = str(error)

    def _count(self, now):
        """Look once a second at what came in that second."""
        passed = now - self._counted_at
        if passed < TELL_PERIOD:
            return
        new = {name: count - self._counted[name] for name, count in self._counts.items()}
        self._counted_at, self._counted = now, dict(self._counts)
        troubles = (
            ('error frames', new['error_frames'] > 0),
            ('frames of a wrong length', new['bad_frames'] > 0),
            ('full of frames', new['frames'] > FULL_BUS * passed),
        )
        self._trouble = ', '.join(text for text, there in troubles if there)

    def _tell(self, now):
        bus = self._bus
        self._count(now)
        silent = [name for name in ('HRW', 'EEC1', 'GBSD') if bus.watch.silent(now, name)]
        level, text = OK, f'limits the engine from address {bus.claim.address}'
        if not self._sends:
            text = f'listens to {self.p.channel}'
        if self._failure:
            level, text = ERROR, f'the bus fails: {self._failure}'
        elif self._sends and not bus.claim.usable:
            # Nothing is sent: the engine obeys its driver alone.
            level = ERROR if bus.claim.state is Claim.LOST else WARN
            text = f'no address: {bus.claim.state.value}'
        elif now < self._flooded:
            level, text = WARN, f'flooded: over {MAX_FRAMES / PERIOD:.0f} frames/s'
        elif silent:
            level = ERROR if 'HRW' in silent else WARN
            text = f'silent: {", ".join(silent)}'
        elif self._sends and not bus.commanded(now):
            level, text = WARN, 'no wheel_torque: the engine is limited to none'
        elif self._trouble:
            level, text = WARN, f'bus: {self._trouble}'
        if (level, text) != self._told or now - self._told_at >= TELL_PERIOD:
            self._told, self._told_at = (level, text), now
            status = {
                name: value.value if isinstance(value, Unknown) else round(value, 4)
                for name, value in bus.status(now).items()
            }
            self.set_diagnostic(
                level, text, limit=round(bus.limit(now), 3) if bus.claim.usable else 'none sent',
                **status, **self._counts,
                **{f'refused_{name}': count for name, count in bus.watch.refused.items()},
            )  # fmt: skip


def _raw_frame(time, message):
    data = bytes(message.data)[:8]
    raw = CanFrame(
        id=message.arbitration_id,
        is_rtr=message.is_remote_frame,
        is_extended=message.is_extended_id,
        is_error=message.is_error_frame,
        dlc=len(data) if not message.is_remote_frame else min(message.dlc, 8),
    )
    raw.header.stamp = time.to_msg()
    raw.data[: len(data)] = list(data)
    return raw


def make_drivetrain(p):
    """Drivetrain of the parameters of a node.

    Parameters
    ----------
    p : types.SimpleNamespace
        Values of `DRIVETRAIN_PARAMETERS`, SI units.

    Returns
    -------
    Drivetrain
        Of four wheels, front and rear.

    Raises
    ------
    ValueError
        Naming what does not fit together.
    """
    if len(p.wheel_names) != len(p.wheel_radii) or len(set(p.wheel_names)) != len(p.wheel_names):
        raise ValueError('parameter "wheel_radii" must give one radius for each of "wheel_names"')
    if len(p.wheel_names) != 4:
        raise ValueError('parameter "wheel_names" must name four wheels, as HRW tells of four')
    front = (True, True, False, False)
    return Drivetrain(front, p.reference_torque, p.gear_ratio, p.efficiency, p.front_share)


def _make_bus(p):
    sources = {}
    for entry in p.sources:
        if entry == 'any':
            continue
        name, _, address = entry.partition('=')
        if not address.isdecimal():
            raise ValueError(f'parameter "sources": expected MESSAGE=ADDRESS, got \'{entry}\'')
        sources[name] = int(address)
    drivetrain = make_drivetrain(p)
    name = name_of(identity=p.identity, manufacturer=_MANUFACTURER, function=_FUNCTION)
    return VehicleBus(
        tractor_groups(),
        p.wheel_radii,
        drivetrain,
        AddressClaim(name, p.address, p.identity),
        engine=p.engine_address,
        front_engaged=p.front_engaged,
        sources=sources,
        missed=p.missed,
        timeout=p.timeout,
    )


def main():
    """Entry point of the executable `can_bridge`."""
    return run(CanBridgeNode)
