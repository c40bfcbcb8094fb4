"""Simulated control units against the bridge, frame by frame."""

import pytest

from tractor_io.can.address_claim import WAIT, AddressClaim, name_of
from tractor_io.can.drivetrain import Drivetrain
from tractor_io.can.ecu import ENGINE, LIMIT_TIMEOUT, TractorEcu
from tractor_io.can.j1939 import Unknown
from tractor_io.can.parameter_group import tractor_groups
from tractor_io.can.torque_limit import TorqueLimit
from tractor_io.can.vehicle_bus import VehicleBus

GROUPS = tractor_groups()
RADII = [0.65, 0.65, 0.85, 0.85]
# 20 kN·m at 100 %, 20 % of it in front.
DRIVETRAIN = Drivetrain((True, True, False, False), 500.0, 40.0, 1.0, 0.2)
TORQUES = [1000.0, 1000.0, 4000.0, 4000.0]


def make():
    return TractorEcu(GROUPS, RADII, DRIVETRAIN)


def other_side():
    name = name_of(identity=1, manufacturer=2046, function=130)
    return VehicleBus(GROUPS, RADII, DRIVETRAIN, AddressClaim(name, 0x87))


def speeds(v):
    return [v / radius for radius in RADII]


@pytest.mark.parametrize('v', [1.7, -1.7])
def test_what_is_sent_is_what_is_heard(v):
    ecu, bus = make(), other_side()
    ecu.ground_speed(0.9 * v)
    torques = [torque if v > 0 else -torque for torque in TORQUES]
    for identifier, data in ecu.frames(0.0, speeds(v), torques):
        assert bus.take(0.0, identifier, data) is not None
    assert bus.wheel_speeds(0.0) == pytest.approx(speeds(v), abs=2e-3)
    # Whole percents of 20 kN·m.
    assert bus.shaft_torques(0.0) == pytest.approx(torques, abs=80.0)
    assert bus.ground_speed(0.0) == pytest.approx(0.9 * v, abs=1e-3)


def test_frames_have_the_periods_of_the_standards():
    ecu = make()
    ecu.ground_speed(1.0)
    counts = {}
    for k in range(100):
        for identifier, data in ecu.frames(0.01 * k, speeds(1.0), TORQUES):
            name = GROUPS.decode(identifier, data).name
            counts[name] = counts.get(name, 0) + 1
    assert counts == {'HRW': 50, 'EEC1': 50, 'WBSD': 10, 'GBSD': 10}


def test_a_clock_that_is_set_back_silences_nobody():
    ecu = make()
    for t in (10.0, 5.0, 5.01, 5.02):
        names = [GROUPS.decode(*each).name for each in ecu.frames(t, speeds(1.0), TORQUES)]
        assert ('HRW' in names) == (t != 5.01)


def test_distance_adds_up():
    ecu, bus = make(), other_side()
    for k in range(101):
        for identifier, data in ecu.frames(0.01 * k, speeds(2.0), TORQUES):
            bus.take(0.01 * k, identifier, data)
    assert bus.watch.value(1.0, 'WBSD', 'WheelBasedMachineDistance') == pytest.approx(
        2.0, abs=2e-3
    )


def test_engine_gives_the_least_of_demand_and_limits():
    ecu = make()
    ecu.ask(TORQUES)
    assert ecu.wheel_torques(0.0) == pytest.approx(TORQUES)
    low, high = TorqueLimit(GROUPS), TorqueLimit(GROUPS)
    for sender, limit, share in ((1, high, 0.4), (2, low, 0.25)):
        ecu.take(0.0, *limit.limit(sender, share))
    assert ecu.limit(0.0) == pytest.approx(0.25)
    assert ecu.wheel_torques(0.0) == pytest.approx([500, 500, 2000, 2000])
    # A released limit no longer counts, nor one that is not repeated.
    ecu.take(0.01, *low.release(2))
    assert ecu.limit(0.01) == pytest.approx(0.4)
    assert ecu.limit(LIMIT_TIMEOUT + 0.001) is None
    assert ecu.wheel_torques(1.0) == pytest.approx(TORQUES)


def test_damaged_limits_and_those_for_others_do_not_count():
    ecu, limit = make(), TorqueLimit(GROUPS, destination=ENGINE)
    identifier, data = limit.limit(1, 0.2)
    ecu.take(0.0, identifier, bytes([*data[:3], data[3] ^ 1, *data[4:]]))
    ecu.take(0.0, identifier, data[:5])
    assert ecu.rejected == 2
    ecu.take(0.0, *TorqueLimit(GROUPS, destination=3).limit(1, 0.2))
    assert ecu.limit(0.0) is None


def test_limit_goes_all_the_way_round():
    ecu, bus = make(), other_side()
    ecu.ask([2000.0, 2000.0, 8000.0, 8000.0])
    bus.begin(0.0)
    for k in range(40):
        t = 0.01 * k
        for identifier, data in ecu.frames(t, speeds(1.0), ecu.wheel_torques(t)):
            bus.take(t, identifier, data)
        bus.command(t, TORQUES)
        for identifier, data in bus.outgoing(t):
            ecu.take(t, identifier, data)
        if t < WAIT:
            # No address yet: only the driver commands.
            assert ecu.limit(t) is None
    assert ecu.wheel_torques(0.39) == pytest.approx(TORQUES)
    assert not isinstance(bus.status(0.39)['engine_torque'], Unknown)
    bus.end()
    for identifier, data in bus.outgoing(0.4):
        ecu.take(0.4, identifier, data)
    assert ecu.limit(0.4) is None
