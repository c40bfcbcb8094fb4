"""Plausibility: impossible readings are rejected; slip, shocks and standstill are accepted."""

import math

import pytest

from traction_controller.estimation.plausibility import ImplausibleError, Plausibility
from traction_model.vehicle.vehicle import load_vehicle

TRACTOR = load_vehicle('tractor_4wd')
RADII = [wheel.radius for wheel in TRACTOR.wheels]
V, SLIP = 2.0, 0.2
PULL = [0.3 * load * radius for load, radius in zip(TRACTOR.static_loads(), RADII, strict=True)]


class Drive:
    """Readings of a tractor at 2 m/s and 20 % slip, never equal twice."""

    def __init__(self, **settings):
        self.check = Plausibility(TRACTOR, **settings)
        self.t = 0.0
        self.steps = 0

    def read(self, scale=(1.0, 1.0, 1.0, 1.0), pull=1.0, stuck=(), v=V):
        """Check one reading; returns the reason of a rejection, or an empty text."""
        self.steps += 1
        self.t += 0.01
        ripple = 1.0 + 0.01 * math.sin(0.7 * self.steps)
        omega = [
            s * V / (1 - SLIP) / r * (1.0 if j in stuck else ripple)
            for j, (s, r) in enumerate(zip(scale, RADII, strict=True))
        ]
        try:
            self.check.wheels(self.t, omega, [pull * ripple * torque for torque in PULL], v)
        except ImplausibleError as error:
            return str(error)
        return ''

    def last(self, n, **reading):
        return [self.read(**reading) for _ in range(n)][-1]


@pytest.fixture
def drive():
    drive = Drive()
    assert [drive.read() for _ in range(100)] == [''] * 100
    return drive


@pytest.mark.parametrize('wheels', [(10.0,) * 4, (1.0, 10.0, 1.0, 1.0)])
def test_ten_times_the_speed_at_once_is_refused_until_it_is_gone(drive, wheels):
    assert 'jumps beyond what torque and ground can do' in drive.read(scale=wheels)
    assert drive.last(200, scale=wheels)
    # Back again, and for a moment watched.
    assert drive.read()
    assert drive.last(30) == ''


@pytest.mark.parametrize('wheels', [(0.1,) * 4, (1.0, 1.0, 1.0, 0.1)])
def test_a_driving_wheel_slower_than_the_ground_is_refused(drive, wheels):
    assert drive.read(scale=wheels)
    assert drive.last(30) == ''


def test_wheels_that_brake_or_roll_may_be_slower(drive):
    # Possible on the ground: a decrease by 2 % per reading.
    for k in range(100):
        assert drive.read(scale=(0.98**k,) * 4, pull=-0.5) == ''


def test_a_wheel_that_spins_up_is_slip(drive):
    # The whole torque of a rear wheel and no ground at all: 8000/60 = 133 rad/s^2.
    for k in range(50):
        assert drive.read(scale=(1.0, 1.0, 1.0 + k * 1.3 * RADII[2] / 2.5, 1.0)) == ''


def test_stuck_tachometer_is_told_after_its_time(drive):
    # All others ripple by 1 %: half a change of 2 %, and half of that at a mean.
    reasons = [drive.read(stuck=(1,)) for _ in range(60)]
    assert reasons[14] == ''
    assert "wheel 'fr' is stuck" in reasons[-1]
    assert drive.last(30) == ''


def test_all_tachometers_stuck_are_told_of_sooner(drive):
    reasons = [drive.read(stuck=(0, 1, 2, 3)) for _ in range(20)]
    assert reasons[4] == ''
    assert reasons[5] == 'speeds of all wheels are stuck'
    assert Drive(stuck_time=0.0).last(20, stuck=(0, 1, 2, 3)) == ''


@pytest.mark.parametrize('scale', [1e4, 1e300])
def test_what_no_engine_gives_and_no_vehicle_does_is_refused_from_the_first_on(scale):
    omega = [V / radius for radius in RADII]
    with pytest.raises(ImplausibleError, match="torque of wheel 'fl' is beyond any engine"):
        Plausibility(TRACTOR).wheels(0.0, omega, [scale * PULL[0], *PULL[1:]])
    with pytest.raises(ImplausibleError, match="speed of wheel 'fl' is beyond any vehicle"):
        Plausibility(TRACTOR).wheels(0.0, [scale * omega[0], *omega[1:]], PULL)
    check = Plausibility(TRACTOR)
    check.wheels(0.0, omega, PULL)
    assert not check.speed('radar', 0.0, -scale * V)


def test_a_reading_of_the_same_time_is_refused_with_those_before(drive):
    assert drive.read(scale=(10.0,) * 4)
    drive.t -= 0.01
    assert drive.read(scale=(10.0,) * 4)


def test_steps_of_a_bus_are_not_stuck():
    # HRW has steps of 1/256 km/h. A steady tractor whose torque wavers by 0.1 % and speed by
    # 0.2 mm/s tells one speed for seconds; also while the front axle loses 0.5 % for 0.5 s.
    step = 1 / 256 / 3.6
    check = Plausibility(TRACTOR, stuck_time=0.5)
    for k in range(500):
        t = 0.02 * k
        front = 0.995 if 200 <= k < 225 else 1.0
        rims = [2.5 * front, 2.5 * front, 2.5, 2.5]
        rims = [step * round((rim + 0.0002 * math.sin(0.9 * k)) / step) for rim in rims]
        omega = [rim / radius for rim, radius in zip(rims, RADII, strict=True)]
        torque = [(1.0 + 0.001 * math.sin(t)) * pull for pull in PULL]
        check.wheels(t, omega, torque, V)


def test_pulses_and_standing_wheels_repeat_themselves():
    counted = Drive(tachometer_pulses=60.0)
    assert counted.last(100, stuck=(0, 1, 2, 3)) == ''
    standing = Drive()
    assert standing.last(100, scale=(0.0,) * 4, v=0.0) == ''


def test_refusal_ends_when_the_vehicle_stands(drive):
    assert drive.read(scale=(10.0,) * 4)
    drive.check.speed('radar', drive.t, 1.0)
    assert drive.last(20, scale=(0.0,) * 4, pull=0.0, v=0.0)
    # The radar agrees, or has no reading.
    assert drive.last(100, scale=(0.0,) * 4, pull=0.0, v=0.0) == ''


def test_ground_faster_than_driving_wheels_is_not_believed(drive):
    assert drive.check.speed('radar', drive.t, V)
    assert not drive.check.speed('radar', drive.t, 10.0 * V)
    # Wheels that are locked by brakes.
    drive.last(5, pull=-0.5)
    assert drive.check.speed('radar', drive.t, 10.0 * V)
    assert drive.check.speed('radar', drive.t, math.nan)


def test_stuck_radar_is_not_believed(drive):
    believed = []
    for _ in range(12):
        drive.last(5)
        believed.append(drive.check.speed('radar', drive.t, V))
    assert believed == [True] * 7 + [False] * 5
