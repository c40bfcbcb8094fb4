"""Node `can_bridge`: `wheel_states` and `radar` from the bus, `wheel_torque` to a torque limit."""

from collections.abc import Collection
from types import SimpleNamespace
from typing import Any

import can

from traction_interfaces.msg import CanFrame, CanFrames
from traction_node.behaviour import Behaviour
from traction_node.joints import JointError, JointOrder
from traction_node.parameter import NodeParameter
from traction_node.run import run
from traction_node.stamp import to_stamp_exact
from tractor_io.can.address_claim import AddressClaim, name_of
from tractor_io.can.bus_link import REPORT_PERIOD, BusLink, Report
from tractor_io.can.drivetrain_parameters import DRIVETRAIN_PARAMETERS, make_drivetrain
from tractor_io.can.interface import DEFAULT_PORT, INTERFACES, find_interface
from tractor_io.can.j1939 import LAST_ADDRESS, Unknown
from tractor_io.can.parameter_group import Group, tractor_groups
from tractor_io.can.torque_limit import PERIOD
from tractor_io.can.vehicle_bus import VehicleBus

FRAMES_PERIOD = 0.02
"""Time between two messages of raw frames, s: with `MAX_RAW_FRAMES` each, 5000 frames a second,
more than a bus of 500 kbit/s can carry."""

# Manufacturer code for devices without an own code, and the function in the NAME.
_MANUFACTURER, _FUNCTION = 2046, 130


class CanBridgeBehaviour(Behaviour):
    """Bridge to a tractor's bus; messages: see `tractor_io.can.vehicle_bus`."""

    NAME = 'can_bridge'
    LIFECYCLE = True
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
            maximum=LAST_ADDRESS,
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
            maximum=LAST_ADDRESS,
            read_only=True,
        ),
        NodeParameter(
            'sources',
            default=['any'],
            description='senders to accept, as MESSAGE=ADDRESS; any: first sender of each message',
            read_only=True,
        ),
        NodeParameter(
            'missed',
            default=5.0,
            description='periods without a frame after which a message counts as missing',
            minimum=1.1,
            maximum=100.0,
            read_only=True,
        ),
        NodeParameter(
            'timeout',
            default=0.14,
            description=(
                'time after the last wheel_torque until the engine is limited to zero torque; '
                'longer than the pause of the gate before it releases'
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

    def check_parameters(self, p: SimpleNamespace) -> None:
        """Reject values that contradict each other."""
        try:
            find_interface(p.interface)
        except ValueError as error:
            raise ValueError(f'parameter "interface": {error}') from None
        if p.log and p.log == p.channel:
            raise ValueError(f'parameter "log": {p.log} is the log that is read')
        _make_bus(p)

    def parameters_changed(self, p: SimpleNamespace, names: Collection[str]) -> None:
        """Apply the engagement of the front axle."""
        if self.host.active:
            with self._link.locked() as bus:
                bus.front_engaged = p.front_engaged

    def configure(self) -> None:
        """Create publishers and subscriptions."""
        host = self.host
        self._torques = JointOrder(host.p.wheel_names, 'wheel_torque effort', only=True)
        self._wheels = host.message('wheel_states')
        self._wheels.header.frame_id = 'base_link'
        self._radar = host.message('radar')
        self._radar.header.frame_id = 'base_link'
        self._radar.twist.covariance[0] = host.p.radar_variance
        self._wheels_publisher = host.publisher('wheel_states')
        self._radar_publisher = host.publisher('radar')
        self._frames_publisher = host.publisher('can_frames')
        host.subscription('wheel_torque', self._on_torque)

    def activate(self) -> None:
        """Open the bus, claim an address and start to send the limit."""
        p = self.host.p
        self._reported: Report | None = None
        self._reported_at = 0.0
        self._bus = _make_bus(p)
        self._link = BusLink(
            self._bus, self._on_group, self.host.now,
            interface=p.interface, channel=p.channel, port=p.port, log=p.log,
        )  # fmt: skip
        self.host.steady_timer(PERIOD, self._work)
        self.host.steady_timer(FRAMES_PERIOD, self._publish_frames)

    def deactivate(self) -> None:
        """Release the engine and close the bus."""
        self._link.close()

    # Called in the receiving thread

    def _on_group(self, group: Group, now: float) -> None:
        if group.name == 'HRW':
            self._publish_wheels(now)
        elif group.name == 'GBSD':
            self._publish_radar(now)

    def _publish_wheels(self, now: float) -> None:
        speeds, torques = self._bus.wheel_speeds(now), self._bus.shaft_torques(now)
        known = [j for j, speed in enumerate(speeds) if not isinstance(speed, Unknown)]
        if not known:
            return
        message = self._wheels
        to_stamp_exact(message.header.stamp, self.host.now())
        message.name = [self.host.p.wheel_names[j] for j in known]
        message.velocity = [speeds[j] for j in known]
        message.effort = [] if torques is None else [float(torques[j]) for j in known]
        self._wheels_publisher.publish(message)

    def _publish_radar(self, now: float) -> None:
        speed = self._bus.ground_speed(now)
        if isinstance(speed, Unknown):
            return
        to_stamp_exact(self._radar.header.stamp, self.host.now())
        self._radar.twist.twist.linear.x = speed
        self._radar_publisher.publish(self._radar)

    # Called in the executor

    def _on_torque(self, message: Any) -> None:
        if not self.host.active:
            return
        with self._link.locked() as bus:
            try:
                torques = self._torques.values(message.name, message.effort)
                bus.command(self.host.steady_time(), torques)
            except JointError:
                self._link.counts['bad_torques'] += 1

    def _work(self) -> None:
        self._link.send_due()
        self._update_diagnostic()

    def _publish_frames(self) -> None:
        raw, missed = self._link.take_raw()
        if (raw or missed) and self._frames_publisher.get_subscription_count():
            frames = [_raw_frame(time, message) for time, message in raw]
            self._frames_publisher.publish(CanFrames(frames=frames, missed=missed))

    def _update_diagnostic(self) -> None:
        now = self.host.steady_time()
        report = self._link.report()
        if report == self._reported and now - self._reported_at < REPORT_PERIOD:
            return
        self._reported, self._reported_at = report, now
        with self._link.locked() as bus:
            status = {
                name: value.value if isinstance(value, Unknown) else round(value, 4)
                for name, value in bus.status(now).items()
            }
            limit = round(bus.limit(now), 3) if bus.claim.usable else 'none sent'
            refused = {f'refused_{name}': count for name, count in bus.watch.refused.items()}
            counts = dict(self._link.counts)
        self.host.set_diagnostic(
            report.level, report.text, limit=limit, **status, **counts, **refused
        )


def _raw_frame(time: int, message: can.Message) -> CanFrame:
    data = bytes(message.data)[:8]
    raw = CanFrame(
        id=message.arbitration_id,
        is_rtr=message.is_remote_frame,
        is_extended=message.is_extended_id,
        is_error=message.is_error_frame,
        dlc=len(data) if not message.is_remote_frame else min(message.dlc, 8),
    )
    to_stamp_exact(raw.header.stamp, time)
    raw.data[: len(data)] = list(data)
    return raw


def _make_bus(p: SimpleNamespace) -> VehicleBus:
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


def main() -> int:
    """Entry point of the executable `can_bridge`."""
    return run(CanBridgeBehaviour)
