"""Bus link on a bus within this process: what it passes on, counts, keeps, sends and reports."""

import queue
import time

import can
import pytest

from traction_node.diagnostic import ERROR, OK, WARN
from tractor_io.can import bus_link
from tractor_io.can.address_claim import CLAIMED_PGN, AddressClaim, name_of
from tractor_io.can.bus_link import MAX_RAW_FRAMES, BusLink
from tractor_io.can.drivetrain import Drivetrain
from tractor_io.can.interface import BusError, frame, open_bus
from tractor_io.can.j1939 import Identifier
from tractor_io.can.parameter_group import tractor_groups
from tractor_io.can.torque_limit import PERIOD, LimitReader
from tractor_io.can.vehicle_bus import WHEEL_FIELDS, VehicleBus

GROUPS = tractor_groups()
OURS = 0x87
WALL_TIME = 1_700_000_000_000_000_000  # ns
LONGEST = 20.0  # s, on a busy machine


class Setup:
    """A link, and another device on its bus."""

    def __init__(self, name, **options):
        drivetrain = Drivetrain((True, True, False, False), 1000.0, 20.0, 1.0, 0.3)
        claim = AddressClaim(name_of(identity=1, manufacturer=2046, function=130), OURS)
        # Long times: a busy machine makes nothing silent.
        vehicle = VehicleBus(
            GROUPS, [0.65, 0.65, 0.85, 0.85], drivetrain, claim, missed=1000.0, timeout=LONGEST
        )
        self.other = can.Bus(interface='virtual', channel=name)
        self.heard = queue.Queue()
        self.link = BusLink(
            vehicle, lambda group, now: self.heard.put((group, now)), lambda: WALL_TIME,
            **{'interface': 'virtual', 'channel': name} | options,
        )  # fmt: skip

    def send_message(self, name, **values):
        """Send a message of the vehicle."""
        self.other.send(frame(GROUPS.identifier(name).bits, GROUPS.encode(name, values)))

    def next_heard(self):
        """Next message that the link passed on; all frames before it have been taken, too."""
        return self.heard.get(timeout=LONGEST)

    def next_limit(self):
        """Limit that the link sends next, with all that is due before it."""
        reader, end = LimitReader(), time.monotonic() + LONGEST
        while time.monotonic() < end:
            self.link.send_due()
            message = self.other.recv(PERIOD)
            group = message and GROUPS.decode(message.arbitration_id, bytes(message.data))
            if group is not None and group.name == 'TSC1':
                return reader.read(group, bytes(message.data))
        raise TimeoutError(f'no limit in {LONGEST} s')


@pytest.fixture
def setup(request):
    made = Setup(request.node.name)
    yield made
    made.link.close()
    made.other.shutdown()


def test_messages_of_the_vehicle_are_passed_on_with_their_time(setup):
    begun = time.monotonic()
    setup.send_message('HRW', **dict.fromkeys(WHEEL_FIELDS, 1.3))
    group, heard = setup.next_heard()
    assert group.name == 'HRW'
    assert begun <= heard <= time.monotonic()
    with setup.link.locked() as bus:
        # 1.3 m/s at 0.65 m; 1/256 km/h is 1.1 mm/s.
        assert bus.wheel_speeds(heard)[0] == pytest.approx(2.0, abs=2e-3)


def test_frames_that_say_nothing_are_counted_and_kept(setup):
    too_short = GROUPS.identifier('GBSD').bits
    setup.other.send(frame(too_short, b'\x01'))
    setup.other.send(can.Message(arbitration_id=0x123, data=b'\x01', is_extended_id=False))
    setup.other.send(can.Message(is_error_frame=True))
    setup.send_message('EEC1', ActualEnginePercentTorque=0.5)
    assert setup.next_heard()[0].name == 'EEC1'
    assert setup.heard.empty()
    counts = setup.link.counts
    assert (counts['frames'], counts['bad_frames'], counts['error_frames']) == (4, 1, 1)
    raw, missed = setup.link.take_raw()
    assert [message.arbitration_id for _, message in raw[:2]] == [too_short, 0x123]
    assert [moment for moment, _ in raw] == [WALL_TIME] * 4
    assert missed == 0
    assert setup.link.take_raw() == ([], 0)


def test_raw_frames_that_nobody_takes_are_counted(setup):
    for _ in range(MAX_RAW_FRAMES + 6):
        setup.other.send(can.Message(arbitration_id=0x123, is_extended_id=False))
    setup.send_message('EEC1', ActualEnginePercentTorque=0.5)
    setup.next_heard()
    raw, missed = setup.link.take_raw()
    assert (len(raw), missed) == (MAX_RAW_FRAMES, 7)


def test_address_is_claimed_and_the_engine_limited_until_the_end(setup):
    setup.link.send_due()
    claim = setup.other.recv(LONGEST)
    assert Identifier.parse(claim.arbitration_id).pgn == CLAIMED_PGN
    # Frames sent are kept as those heard are.
    assert setup.link.take_raw()[0][0][1].arbitration_id == claim.arbitration_id
    assert setup.next_limit() == 0.0
    setup.link.close()
    last = setup.other.recv(LONGEST)
    # Taken back: the engine obeys its driver.
    assert LimitReader().read(GROUPS.decode(last.arbitration_id, last.data), last.data) is None


def test_report_names_the_gravest_fault(setup):
    setup.next_limit()
    assert setup.link.report() == (ERROR, 'silent: HRW, EEC1, GBSD')
    setup.send_message('HRW', **dict.fromkeys(WHEEL_FIELDS, 1.3))
    setup.send_message('EEC1', ActualEnginePercentTorque=0.5)
    setup.send_message('GBSD', GroundBasedMachineSpeed=1.3)
    for _ in range(3):
        setup.next_heard()
    assert setup.link.report() == (WARN, 'no wheel_torque: the engine is limited to none')
    with setup.link.locked() as bus:
        bus.command(time.monotonic(), [1500.0, 1500.0, 3500.0, 3500.0])
    assert setup.link.report() == (OK, 'limits the engine from address 135')
    # 10 of 20 kN·m, 30 % of them in front.
    assert setup.next_limit() == pytest.approx(0.5)


def test_bus_that_fails_is_said_until_a_frame_comes(monkeypatch, request):
    down = False

    class Bus(can.interfaces.virtual.VirtualBus):
        def send(self, msg, timeout=None):
            if down:
                raise can.CanOperationError('bus off')
            super().send(msg, timeout)

    monkeypatch.setattr(bus_link, 'open_bus', lambda _, channel, __: Bus(channel))
    setup = Setup(request.node.name)
    down = True
    setup.link.send_due()
    assert setup.link.report() == (ERROR, 'the bus fails: bus off')
    assert setup.link.counts['failures'] == 1
    down = False
    setup.send_message('EEC1', ActualEnginePercentTorque=0.5)
    setup.next_heard()
    assert setup.link.report() == (WARN, 'no address: claimed')
    # The claim that was lost is sent again.
    setup.link.send_due()
    claim = setup.other.recv(LONGEST)
    assert Identifier.parse(claim.arbitration_id).pgn == CLAIMED_PGN
    setup.link.close()
    setup.other.shutdown()


def test_log_gets_all_frames_and_is_a_bus_itself(tmp_path, request):
    log = tmp_path / 'frames.log'
    for speed in (1.3, 2.6):
        setup = Setup(request.node.name, log=str(log))
        setup.send_message('GBSD', GroundBasedMachineSpeed=speed)
        setup.next_heard()
        setup.link.close()
        setup.other.shutdown()
    played = Setup(request.node.name, interface='candump', channel=str(log))
    assert [played.next_heard()[0].name for _ in range(2)] == ['GBSD'] * 2
    # It is listened to only.
    played.link.send_due()
    assert played.link.counts['failures'] == 0
    played.link.close()
    played.other.shutdown()


def test_bus_that_cannot_be_opened_is_refused(tmp_path, request):
    with pytest.raises(BusError, match='no such candump log'):
        Setup(request.node.name, interface='candump', channel=str(tmp_path / 'none.log'))
    with pytest.raises(OSError, match='absent'):
        Setup(request.node.name, log=str(tmp_path / 'absent' / 'frames.log'))
    # And is let go of: the name is free again.
    open_bus('virtual', request.node.name).shutdown()
