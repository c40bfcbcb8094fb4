"""Vehicle bus: signs, missing messages, limits and their source address."""

import math

import numpy as np
import pytest

from torque_gate.gate import REACTION_TIME, WATCHDOG_PERIOD
from tractor_io.can.address_claim import CLAIMED_PGN, REQUEST_PGN, WAIT, AddressClaim, name_of
from tractor_io.can.drivetrain import Drivetrain
from tractor_io.can.j1939 import Identifier, Unknown
from tractor_io.can.parameter_group import tractor_groups
from tractor_io.can.torque_limit import PERIOD, LimitReader
from tractor_io.can.vehicle_bus import WHEEL_FIELDS, VehicleBus

GROUPS = tractor_groups()
RADII = [0.65, 0.65, 0.85, 0.85]
NAME = name_of(identity=1, manufacturer=2046, function=130)
OURS = 0x87


def make(**arguments):
    # 1000 N·m at 100 %, over 20: 20 kN·m, 30 % of it in front.
    drivetrain = Drivetrain((True, True, False, False), 1000.0, 20.0, 1.0, 0.3)
    return VehicleBus(GROUPS, RADII, drivetrain, AddressClaim(NAME, OURS), **arguments)


def hear(bus, t, name, source=0, **values):
    identifier = GROUPS.identifier(name)._replace(source=source)
    return bus.take(t, identifier.bits, GROUPS.encode(name, values))


def sent(bus, t):
    """TSC1 frames sent now: (source, limit)."""
    reader, found = LimitReader(), []
    for identifier, data in bus.outgoing(t):
        group = GROUPS.decode(identifier, data)
        if group is not None:
            found.append((group.identifier.source, reader.read(group, data)))
    return found


def ready(t=0.0):
    """Bus with a claimed address."""
    bus = make()
    bus.begin(t - WAIT)
    bus.outgoing(t - WAIT)
    return bus


def test_wheels_turn_backward_in_reverse():
    bus = make()
    hear(bus, 0.0, 'HRW', **dict(zip(WHEEL_FIELDS, [1.3, 1.3, 1.7, 1.7], strict=True)))
    # 1/256 km/h is 1.1 mm/s.
    assert bus.wheel_speeds(0.0) == pytest.approx([2.0] * 4, abs=2e-3)
    hear(bus, 0.0, 'WBSD', WheelBasedMachineDirection=0)
    assert bus.wheel_speeds(0.0) == pytest.approx([-2.0] * 4, abs=2e-3)
    hear(bus, 0.05, 'WBSD', WheelBasedMachineDirection=1)
    assert bus.wheel_speeds(0.05) == pytest.approx([2.0] * 4, abs=2e-3)


def test_wheel_without_a_value_has_none():
    bus = make()
    assert bus.wheel_speeds(0.0) == [Unknown.NOT_AVAILABLE] * 4
    hear(bus, 0.0, 'HRW', FrontAxleLeftWheelSpeed=1.3, FrontAxleRightWheelSpeed=Unknown.ERROR)
    speeds = bus.wheel_speeds(0.0)
    assert speeds[0] == pytest.approx(2.0, abs=2e-3)
    assert speeds[1:] == [Unknown.ERROR, Unknown.NOT_AVAILABLE, Unknown.NOT_AVAILABLE]
    # Five periods of 20 ms.
    assert bus.wheel_speeds(0.11) == [Unknown.NOT_AVAILABLE] * 4


def test_shaft_torques_by_hand():
    bus = make()
    assert bus.shaft_torques(0.0) is None
    hear(bus, 0.0, 'EEC1', ActualEnginePercentTorque=0.5)
    # 10 kN·m, 3 of it in front.
    assert bus.shaft_torques(0.0) == pytest.approx([1500, 1500, 3500, 3500])
    bus.front_engaged = False
    assert bus.shaft_torques(0.0) == pytest.approx([0, 0, 5000, 5000])
    hear(bus, 0.0, 'WBSD', WheelBasedMachineDirection=0)
    assert bus.shaft_torques(0.0) == pytest.approx([0, 0, -5000, -5000])


def test_ground_speed_has_its_own_direction_or_that_of_the_wheels():
    bus = make()
    assert bus.ground_speed(0.0) is Unknown.NOT_AVAILABLE
    hear(bus, 0.0, 'GBSD', GroundBasedMachineSpeed=1.5)
    assert bus.ground_speed(0.0) == pytest.approx(1.5)
    hear(bus, 0.0, 'WBSD', WheelBasedMachineDirection=0)
    assert bus.ground_speed(0.0) == pytest.approx(-1.5)
    hear(bus, 0.1, 'GBSD', GroundBasedMachineSpeed=1.5, GroundBasedMachineDirection=1)
    assert bus.ground_speed(0.1) == pytest.approx(1.5)


def test_status_has_si_units():
    bus = make()
    hear(bus, 0.0, 'RHS', RearDraft=12000.0)
    hear(bus, 0.0, 'EAC1', DifferentialLockStateRearAxle1=1)
    hear(bus, 0.0, 'VDC2', YawRate=0.1)
    status = bus.status(0.0)
    assert status['rear_draft'] == pytest.approx(12000.0)
    assert status['rear_differential_lock'] == 1.0
    assert status['yaw_rate'] == pytest.approx(0.1, abs=1e-4)
    assert status['front_draft'] is Unknown.NOT_AVAILABLE


def test_a_claim_that_could_not_be_sent_is_claimed_again():
    bus = make()
    bus.begin(0.0)
    # The bus is down for 1 s.
    for k in range(100):
        frames = bus.outgoing(0.01 * k)
        assert [Identifier.parse(identifier).pgn for identifier, _ in frames] == [CLAIMED_PGN]
        bus.unsent(0.01 * k, frames)
    ((identifier, _),) = bus.outgoing(1.0)
    assert Identifier.parse(identifier).pgn == CLAIMED_PGN
    assert sent(bus, 1.0 + 0.9 * WAIT) == []
    assert sent(bus, 1.0 + WAIT) == [(OURS, 0.0)]
    # An unsent limit is not repeated: the next one replaces it.
    bus.unsent(2.0, bus.outgoing(2.0))
    assert len(sent(bus, 2.01)) == 1


def test_limit_holds_as_long_as_a_gate_holds_its_command():
    bus = ready()
    bus.command(0.0, [1500, 1500, 3500, 3500])
    # No torque for 0.1 s plus a watchdog period; then 100 Hz again.
    assert bus.limit(0.1 + WATCHDOG_PERIOD) == pytest.approx(0.5)
    assert bus.limit(REACTION_TIME - PERIOD) == 0.0


def test_limit_comes_every_10_ms_from_the_claimed_address():
    bus = make()
    bus.begin(0.0)
    ((identifier, _),) = bus.outgoing(0.0)
    assert Identifier.parse(identifier).pgn == CLAIMED_PGN
    # Not before the address may be used.
    bus.command(0.2, [1500, 1500, 3500, 3500])
    assert sent(bus, 0.2) == []
    found = []
    for k in range(25, 35):
        bus.command(0.01 * k, [1500, 1500, 3500, 3500])
        found += sent(bus, 0.01 * k)
    assert [source for source, _ in found] == [OURS] * 10
    assert [limit for _, limit in found] == pytest.approx([0.5] * 10)
    # More calls do not give more frames.
    assert sent(bus, 0.341) == []


def test_wheel_that_may_get_least_decides():
    bus = ready()
    bus.command(0.0, [300, 1500, 3500, 3500])
    # 300 of 15 % of 20 kN·m.
    assert bus.limit(0.0) == pytest.approx(0.1)
    bus.command(0.0, [-300, 1500, 3500, 3500])
    assert bus.limit(0.0) == 0.0
    bus.command(0.0, [9e9] * 4)
    assert bus.limit(0.0) == 1.25


def test_reverse_is_limited_by_magnitude():
    bus = ready()
    hear(bus, 0.0, 'WBSD', WheelBasedMachineDirection=0)
    bus.command(0.0, [-1500, -1500, -3500, -3500])
    assert bus.limit(0.0) == pytest.approx(0.5)


def test_silence_of_the_gate_limits_to_nothing():
    bus = ready()
    assert sent(bus, 0.0) == [(OURS, 0.0)]
    bus.command(0.01, [1500, 1500, 3500, 3500])
    assert sent(bus, 0.1) == [(OURS, pytest.approx(0.5))]
    assert sent(bus, 0.16) == [(OURS, 0.0)]


@pytest.mark.parametrize('torques', [[1.0, 2.0], [math.nan] * 4, [math.inf] * 4])
def test_bad_torques_do_not_count(torques):
    bus = ready()
    bus.command(0.0, [1500, 1500, 3500, 3500])
    with pytest.raises(ValueError, match='wheel torques'):
        bus.command(0.05, torques)
    assert bus.limit(0.05) == pytest.approx(0.5)


def test_end_releases_the_engine_once():
    bus = ready()
    bus.command(0.0, [1500, 1500, 3500, 3500])
    sent(bus, 0.0)
    bus.end()
    assert sent(bus, 0.01) == [(OURS, None)]
    bus.end()
    assert sent(bus, 0.02) == []


def test_lost_address_silences_the_limit():
    bus = ready()
    lower = (NAME - 1).to_bytes(8, 'little')
    assert sent(bus, 0.0) != []
    bus.take(0.01, Identifier(CLAIMED_PGN, OURS).bits, lower)
    assert not bus.claim.usable
    assert sent(bus, 0.02) == []
    # The next address is claimed; limits start when it may be used.
    assert [source for source, _ in sent(bus, 0.03 + WAIT)] == [bus.claim.address]
    assert bus.claim.address != OURS


def test_sources_are_pinned():
    bus = make(sources={'EEC1': 7})
    assert hear(bus, 0.0, 'EEC1', ActualEnginePercentTorque=0.5) is None
    assert hear(bus, 0.0, 'EEC1', source=7, ActualEnginePercentTorque=0.5) is not None
    assert np.all(bus.shaft_torques(0.0) > 0)


@pytest.mark.parametrize(
    ('arguments', 'text'),
    [
        ({'timeout': 0.0}, 'timeout must be above 0'),
        ({'engine': 254}, 'engine must be an address of 0 to 253, got 254'),
        ({'sources': {'EEC9': 0}}, "unknown message 'EEC9'"),
        ({'missed': 0.5}, 'missed must be above 1'),
    ],
)
def test_what_is_refused(arguments, text):
    with pytest.raises(ValueError, match=text):
        make(**arguments)
    drivetrain = Drivetrain((True, True, False, False), 1000.0, 20.0)
    for radii, said in (([0.6] * 3, 'expected 4 radii'), ([0.6] * 3 + [0.0], 'radius 3 must be')):
        with pytest.raises(ValueError, match=said):
            VehicleBus(GROUPS, radii, drivetrain, AddressClaim(NAME, OURS))


def test_flood_of_requests_is_answered_once_a_period():
    bus = ready()
    request = Identifier(REQUEST_PGN, 3, OURS).bits
    for _ in range(1000):
        bus.take(0.0, request, CLAIMED_PGN.to_bytes(3, 'little'))
    assert len(bus.outgoing(0.0)) == 2  # the claim and a limit
