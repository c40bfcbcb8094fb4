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

    def __init__(self, step=0.0, **settings):
        self.check = Plausibility(TRACTOR, **settings)
        self.step = [step] * 4
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
            torque = [pull * ripple * torque for torque in PULL]
            self.check.wheels(self.t, omega, torque, v, self.step)
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
    assert check.speed('radar', 0.0, -scale * V) == 'is faster than any vehicle'


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
    # 60 pulses a turn, counted over 10 ms.
    counted = Drive(step=2.0 * math.pi / 60 / 0.01)
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
    assert drive.check.speed('radar', drive.t, V) == ''
    why = drive.check.speed('radar', drive.t, 10.0 * V)
    assert why == 'is faster than all wheels while they drive'
    # Wheels that are locked by brakes.
    drive.last(5, pull=-0.5)
    assert drive.check.speed('radar', drive.t, 10.0 * V) == ''
    assert drive.check.speed('radar', drive.t, math.nan) == ''


def test_a_radar_without_direction_is_not_believed_in_reverse():
    reverse = Drive()
    assert reverse.last(50, scale=(-1.0,) * 4, pull=-1.0, v=-V) == ''
    why = reverse.check.speed('radar', reverse.t, V)
    assert why == 'has no sign: the wheels turn the other way'
    assert reverse.check.speed('radar', reverse.t, -V) == ''
    # Sliding back slowly while all wheels spin forward, as on a slope.
    reverse = Drive()
    reverse.last(50)
    assert reverse.check.speed('radar', reverse.t, -0.3 * V) == ''


def test_tachometers_without_direction_are_refused_in_reverse():
    # Torque and ground are backward, the wheels are said to turn forward.
    reverse = Drive()
    assert reverse.last(5, pull=-1.0, v=math.nan) == ''
    assert reverse.check.speed('radar', reverse.t, -V) == ''
    assert 'speeds of all wheels have no sign' in reverse.read(pull=-1.0, v=math.nan)
    # With the right sign they are believed again within a second.
    for k in range(100):
        why = reverse.read(scale=(-1.0,) * 4, pull=-1.0, v=-V)
        # Not the same to the last bit.
        reverse.check.speed('radar', reverse.t, -V * (1.0 + 0.001 * (k % 3)))
    assert why == ''


def test_stuck_radar_is_not_believed(drive):
    believed = []
    for _ in range(12):
        drive.last(5)
        believed.append(drive.check.speed('radar', drive.t, V))
    assert believed == [''] * 7 + ['is stuck'] * 5


class CountedDrive:
    """The tractor again, at a speed of its own, with tachometers that count pulses over 10 ms."""

    def __init__(self, pulses):
        self.check = Plausibility(TRACTOR)
        self.pulse = 2.0 * math.pi / pulses
        self.t = 0.0
        self.angle, self.counted = [0.0] * 4, [0] * 4

    def read(self, rim, v, pull, extra=0, standing=False):
        """One reading, the first wheel `standing` or `extra` pulses on; why it is refused."""
        self.t += 0.01
        omega = []
        for j, radius in enumerate(RADII):
            # No two wheels count at the same moment.
            self.angle[j] += (1.0 + 0.001 * j) * rim / radius * 0.01
            before, self.counted[j] = self.counted[j], math.floor(self.angle[j] / self.pulse)
            omega.append((self.counted[j] - before) * self.pulse / 0.01)
        omega[0] = 0.0 if standing else omega[0] + extra * self.pulse / 0.01
        step = [self.pulse / 0.01] * 4
        try:
            self.check.wheels(self.t, omega, [pull * torque for torque in PULL], v, step)
        except ImplausibleError as error:
            return str(error)
        self.check.speed('radar', self.t, v)
        return ''


@pytest.mark.parametrize('pulses', [60, 100, 200, 400, 1000, 4000])
def test_pulling_away_on_counted_pulses_is_never_refused(pulses):
    drive = CountedDrive(pulses)
    for k in range(1000):
        # 0.5 m/s^2 up to 3 m/s, pulling, at 15 % of slip: many samples have no pulse.
        v = min(0.005 * k, 3.0)
        assert drive.read(v / 0.85, v, 1.0) == ''


@pytest.mark.parametrize('extra', [-1, 1])
def test_a_pulse_back_or_forth_at_standstill_is_normal(extra):
    drive = CountedDrive(1000)
    for k in range(100):
        assert drive.read(0.0, 0.0, 0.5, extra=extra if k == 20 else 0) == ''
    assert all(drive.read(0.01 * k / 0.9, 0.01 * k, 1.0) == '' for k in range(200))


def test_a_counted_wheel_that_stands_while_it_drives_is_told():
    drive = CountedDrive(60)
    assert all(drive.read(2.4, 2.0, 1.0) == '' for _ in range(200))
    # No pulse in 0.3 s: at most 0.35 rad/s.
    told = [drive.read(2.4, 2.0, 1.0, standing=True) for _ in range(30)]
    assert told[-1] == "wheel 'fl' drives, yet is slower than the ground"
    assert told[1] == ''


def test_a_first_reading_of_nought_on_the_move_is_soon_behind():
    drive = Drive()
    said = [drive.read(scale=(0.0,) * 4, pull=0.0)]
    for _ in range(100):
        drive.check.speed('radar', drive.t, V)
        said.append(drive.read(pull=0.0))
    assert 'jumps' in said[1]
    # A trial of 0.2 s.
    assert said[22:] == [''] * 79


def test_without_a_speed_over_ground_wheels_that_agree_are_believed_after_a_while():
    drive = Drive()
    drive.read(scale=(0.0,) * 4, pull=0.0, v=math.nan)
    said = [drive.read(pull=0.0, v=math.nan) for _ in range(300)]
    assert 'jumps' in said[150]
    assert said[205:] == [''] * 95


def test_a_tachometer_that_times_its_pulses_holds_a_speed_between_them():
    # 60 pulses a turn, from standstill up to 3 rad/s, down to 1 and up again: one each 35 ms and
    # more.
    pulse = 2.0 * math.pi / 60
    check = Plausibility(TRACTOR)
    angle, held, last = 0.0, [0.0] * 4, 0.0
    for k in range(1, 2000):
        t = 0.01 * k
        omega = min(t, 2.0 - math.cos(0.5 * t))
        angle += omega * 0.01
        if angle >= pulse:
            angle -= pulse
            # When the pulse came, to the timer's resolution.
            came = t - angle / omega
            held, last = [pulse / (came - last)] * 4, came
        torque = [(0.5 + 0.3 * math.sin(t)) * pull for pull in PULL]
        check.wheels(t, held, torque, 0.6 * omega)
