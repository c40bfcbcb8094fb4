"""The CAN bridge as a process, with a tractor on the other end of a bus over the loopback."""

import contextlib
import itertools
import math
import threading
import time

import can
import numpy as np
import pytest
from sensor_msgs.msg import JointState

from traction_node.probe import NodeProcess, Probe, executable
from traction_node.stamp import seconds
from tractor_io.can.interface import frame, free_port, open_bus
from tractor_io.can.parameter_group import FrameError, tractor_groups
from tractor_io.can.torque_limit import LimitReader

BRIDGE = executable('tractor_io', 'can_bridge')
GROUPS = tractor_groups()
BRIDGE_TSC1 = 0x0C000087
PARAMETERS = {
    'interface': 'udp_multicast', 'autostart': True, 'reference_torque': 500.0,
    'gear_ratio': 40.0, 'efficiency': 1.0, 'front_share': 0.3,
}  # fmt: skip


class Tractor:
    """Other end of the bus; keeps all received frames."""

    def __init__(self, port):
        self.bus = open_bus('udp_multicast', port=port)
        self._reader = LimitReader()
        # (source, limit or None) of every TSC1.
        self.limits = []

    def send(self, name, source=0, **values):
        identifier = GROUPS.identifier(name)._replace(source=source)
        self.bus.send(frame(identifier.bits, GROUPS.encode(name, values)))

    def drive(self):
        self.send('WBSD', WheelBasedMachineSpeed=1.7, WheelBasedMachineDirection=1)
        self.send('EEC1', ActualEnginePercentTorque=0.5, EngineSpeed=150.0)
        self.send('GBSD', GroundBasedMachineSpeed=1.5)
        self.send(
            'HRW', FrontAxleLeftWheelSpeed=1.3, FrontAxleRightWheelSpeed=1.3,
            RearAxleLeftWheelSpeed=1.7, RearAxleRightWheelSpeed=1.7,
        )  # fmt: skip

    def hear(self):
        while (message := self.bus.recv(0.0)) is not None:
            if message.is_error_frame or message.arbitration_id >> 16 & 0xFF:
                continue  # not TSC1, whose parameter group is 0
            group = GROUPS.decode(message.arbitration_id, bytes(message.data))
            if group is not None and group.name == 'TSC1':
                # In a flood some frames are lost here, so their counters have gaps.
                with contextlib.suppress(FrameError):
                    limit = self._reader.read(group, bytes(message.data))
                    self.limits.append((group.identifier.source, limit))
        return self.limits


class Setup:
    """Bridge, tractor, and a probe on the ROS side."""

    def __init__(self, probe, tractor, process, port, log):
        self.probe, self.tractor, self.process = probe, tractor, process
        self.port, self.log = port, log
        self.wheels = probe.subscribe('wheel_states')
        self.radar = probe.subscribe('radar')
        self.publisher = probe.publisher('wheel_torque')

    def drive(self, until, what, torques=None):
        """Send the tractor's frames and torques every 10 ms until a condition holds."""

        def work():
            self.tractor.drive()
            if torques is not None:
                self.publisher.publish(
                    JointState(name=['fl', 'fr', 'rl', 'rr'], effort=torques)
                )  # fmt: skip
            self.tractor.hear()

        timer = self.probe.node.create_timer(0.01, work)
        try:
            return self.probe.wait_for(until, what)
        finally:
            self.probe.node.destroy_timer(timer)

    def sent(self):
        """End the bridge; times and limits of all TSC1 that it sent, by its own log.

        Some may have been lost on the way to here, and the others been heard late.
        """
        assert self.process.interrupt() == 0
        reader = LimitReader()
        times, limits = [], []
        for message in can.CanutilsLogReader(self.log):
            if message.arbitration_id == BRIDGE_TSC1:
                group = GROUPS.decode(BRIDGE_TSC1, bytes(message.data))
                times.append(message.timestamp)
                limits.append(reader.read(group, bytes(message.data)))
        return times, limits


@pytest.fixture
def setup(request, tmp_path):
    port = free_port()
    log = tmp_path / 'all.log'
    parameters = {**PARAMETERS, 'port': port, 'log': log, **getattr(request, 'param', {})}
    with NodeProcess(BRIDGE, params=parameters) as process, Probe() as probe:
        tractor = Tractor(port)
        try:
            yield Setup(probe, tractor, process, port, log)
        finally:
            tractor.bus.shutdown()


def test_frames_become_wheel_states_and_radar(setup):
    setup.drive(lambda: len(setup.wheels) > 5 and setup.radar, 'wheel_states and radar')
    wheels = setup.wheels[-1]
    assert list(wheels.name) == ['fl', 'fr', 'rl', 'rr']
    assert list(wheels.velocity) == pytest.approx([2.0] * 4, abs=2e-3)
    # Half of 500 N·m over 40: 10 kN·m, 30 % of it in front.
    assert list(wheels.effort) == pytest.approx([1500, 1500, 3500, 3500])
    radar = setup.radar[-1]
    assert radar.twist.twist.linear.x == pytest.approx(1.5)
    assert radar.twist.covariance[0] == pytest.approx(0.0025)


def test_torques_become_a_limit_that_the_end_takes_back(setup):
    torques = [750.0, 750.0, 1750.0, 1750.0]
    limits = setup.tractor.limits

    def limited():
        return len(limits) > 20 and all(limit == pytest.approx(0.25) for _, limit in limits[-10:])

    setup.drive(limited, 'a limit of 25 %', torques)
    assert {source for source, _ in limits} == {0x87}
    times, sent = setup.sent()
    assert np.median(np.diff(times)) == pytest.approx(0.01, abs=0.002)
    assert sent[-1] is None
    setup.tractor.hear()
    assert limits[-1] == (0x87, None)


def test_silence_of_the_gate_limits_to_nothing(setup):
    limits = setup.tractor.limits
    torques = [750.0, 750.0, 1750.0, 1750.0]
    setup.drive(
        lambda: limits and limits[-1][1] == pytest.approx(0.25), 'a limit of 25 %', torques
    )
    ended = time.time()
    setup.drive(lambda: limits[-1][1] == 0.0, 'a limit of 0')
    times, sent = setup.sent()
    nothing = next(t for t, limit in zip(times, sent, strict=True) if t > ended and limit == 0.0)
    assert nothing - ended < 0.2


def test_silence_of_the_bus_is_told_and_ends(setup):
    diagnostics = setup.probe.diagnostics

    def told(text):
        return lambda: any(text in each.message for each in diagnostics('can_bridge')[-1:])

    torques = [750.0, 750.0, 1750.0, 1750.0]
    setup.drive(told('limits the engine'), 'all well', torques)
    setup.probe.wait_for(told('silent: HRW, EEC1, GBSD'), 'silence')
    setup.drive(told('limits the engine'), 'all well again', torques)


@pytest.mark.parametrize('setup', [{'sources': ['EEC1=7', 'HRW=0']}], indirect=True)
def test_pinned_engine_alone_counts(setup):
    setup.drive(lambda: len(setup.wheels) > 5, 'wheel_states')
    assert list(setup.wheels[-1].effort) == []
    for _ in range(3):
        setup.tractor.send('EEC1', source=7, ActualEnginePercentTorque=0.1)
    setup.drive(lambda: len(setup.wheels[-1].effort), 'torque of the pinned engine')
    assert setup.wheels[-1].effort[2] == pytest.approx(700.0)


def test_raw_frames_are_told_in_both_directions(setup):
    told = setup.probe.subscribe('can_frames')

    def both():
        frames = [frame for message in told for frame in message.frames]
        sources = {frame.id & 0xFF for frame in frames}
        return frames if {0, 0x87} <= sources and len(frames) > 50 else None

    # TSC1 starts when the claim is complete.
    frames = setup.drive(both, 'frames of tractor and bridge')
    speed = next(f for f in frames if f.id == GROUPS.identifier('GBSD')._replace(source=0).bits)
    assert (speed.is_extended, speed.is_rtr, speed.is_error, speed.dlc) == (True, False, False, 8)
    setup.tractor.bus.send(can.Message(is_error_frame=True, arbitration_id=4, data=[0, 8]))
    (error,) = setup.probe.wait_for(
        lambda: [f for message in told for f in message.frames if f.is_error], 'error frame'
    )
    assert (error.dlc, list(error.data)) == (2, [0, 8, 0, 0, 0, 0, 0, 0])
    values = GROUPS.decode(speed.id, bytes(speed.data)).values
    assert values['GroundBasedMachineSpeed'] == pytest.approx(1.5)
    assert speed.header.stamp.sec > 0
    # UDP echoes sent frames, but each is published once: consecutive counters differ.
    limits = [f.data.tobytes() for f in frames if f.id == BRIDGE_TSC1]
    assert all(first != second for first, second in itertools.pairwise(limits))
    stamps = [f.header.stamp.sec + 1e-9 * f.header.stamp.nanosec for f in frames]
    assert stamps == sorted(stamps)


def test_flood_and_error_frames_stall_neither_limit_nor_its_end(setup):
    torques = [750.0, 750.0, 1750.0, 1750.0]
    limits, told = setup.tractor.limits, setup.probe.subscribe('can_frames')
    setup.drive(
        lambda: limits and limits[-1][1] == pytest.approx(0.25), 'a limit of 25 %', torques
    )
    ended = threading.Event()

    def flood():
        bus = open_bus('udp_multicast', port=setup.port)
        while not ended.is_set():
            # Unknown frames, frames of wrong length, requests for addresses, error frames.
            bus.send(can.Message(arbitration_id=0x18FF0012, data=bytes(8)))
            bus.send(can.Message(arbitration_id=0x0CFE4812, data=bytes(3)))
            bus.send(can.Message(arbitration_id=0x18EAFF12, data=[0x00, 0xEE, 0x00]))
            bus.send(can.Message(is_error_frame=True, arbitration_id=4, data=bytes(8)))
        bus.shutdown()

    flooding = threading.Thread(target=flood)
    flooding.start()
    try:
        begun = time.monotonic()
        setup.drive(lambda: time.monotonic() > begun + 2.0, 'two seconds', torques)
        setup.probe.wait_for_diagnostic('can_bridge', 'flooded')
        # The gate no longer sends here.
        setup.probe.wait_for(lambda: setup.tractor.hear() and limits[-1][1] == 0.0, 'a limit of 0')
    finally:
        ended.set()
        flooding.join()
    times, _ = setup.sent()
    assert max(len(message.frames) for message in told) <= 100
    # An engine drops a limit after 100 ms. The flood takes one core of a machine that may be
    # busy, so frames may come later than the 10 ms of their period, and a few later than 50 ms.
    assert np.percentile(np.diff(times), 95) < 0.05
    assert np.median(np.diff(times)) > 0.005


def test_candump_log_is_heard_at_its_pace(tmp_path):
    path = tmp_path / 'drive.log'
    writer = can.CanutilsLogWriter(str(path))
    for k in range(100):
        for name, values in (
            ('HRW', {'RearAxleLeftWheelSpeed': 0.0085 * k}),
            ('GBSD', {'GroundBasedMachineSpeed': 0.01 * k}),
        ):
            message = frame(GROUPS.identifier(name)._replace(source=3).bits,
                            GROUPS.encode(name, values))  # fmt: skip
            message.timestamp = 1000.0 + 0.02 * k
            writer.on_message_received(message)
    writer.stop()
    parameters = {**PARAMETERS, 'interface': 'candump', 'channel': path, 'autostart': False}
    with Probe() as probe, NodeProcess(BRIDGE, params=parameters):
        assert probe.change_state('can_bridge', 'configure')
        radar = probe.subscribe('radar')
        wheels = probe.subscribe('wheel_states')
        probe.diagnostics('can_bridge')
        probe.meet('can_bridge', 'radar', 'wheel_states')
        # The log begins now.
        assert probe.change_state('can_bridge', 'activate')
        probe.wait_for(
            lambda: radar and radar[-1].twist.twist.linear.x == pytest.approx(0.99),
            'the last frame',
        )
        # Speed grows by 0.01 m/s every 20 ms. One frame that is late does not shift the others.
        stamps = [seconds(message.header.stamp) for message in radar]
        speeds = [message.twist.twist.linear.x for message in radar]
        slope, _ = np.polyfit(speeds, np.subtract(stamps, stamps[0]), 1)
        # Slower only by what the bridge waits for a core.
        assert 1.8 < slope < 3.5
        # Only the wheel that has a value.
        assert list(wheels[-1].name) == ['rl']
        # After its end.
        said = probe.wait_for_diagnostic('can_bridge', 'silent: HRW')
        limit = next(value.value for value in said.values if value.key == 'limit')
        assert limit == 'none sent'
        assert not any('bus fails' in status.message for status in probe.diagnostics('can_bridge'))


@pytest.mark.parametrize(
    ('parameters', 'text'),
    [
        (
            {'interface': 'canbus'},
            "unknown CAN interface 'canbus': there are socketcan",
        ),
        ({'log': 'a.log', 'channel': 'a.log'}, 'is the log that is read'),
        ({'wheel_names': ['l', 'r'], 'wheel_radii': [0.8, 0.8]}, 'must name four wheels'),
        ({'sources': ['EEC1']}, "expected MESSAGE=ADDRESS, got 'EEC1'"),
        ({'sources': ['EEC9=1']}, "unknown message 'EEC9'"),
        ({'wheel_radii': [0.5]}, 'must give one radius for each'),
        ({'gear_ratio': math.nan}, 'gear_ratio'),
    ],
)
def test_bridge_refuses_bad_input_in_one_line(parameters, text):
    with NodeProcess(BRIDGE, params={**PARAMETERS, **parameters}) as bridge:
        assert bridge.wait() == 2
        (line,) = bridge.output.splitlines()
    assert text in line


def test_bus_that_is_not_there_is_told():
    parameters = {**PARAMETERS, 'interface': 'socketcan', 'channel': 'none0'}
    with NodeProcess(BRIDGE, params=parameters) as bridge:
        bridge.wait_for_output("CAN interface socketcan, channel 'none0'")
