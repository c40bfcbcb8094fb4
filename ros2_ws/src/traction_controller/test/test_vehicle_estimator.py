"""Vehicle estimator: its parts together, jumps of time, rejected sources."""

import copy
import math
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from traction_controller.estimation.immobilisation import Level
from traction_controller.estimation.slip_filter import SlipFilter, Source
from traction_controller.estimation.tachometer import Tachometers
from traction_controller.estimation.vehicle_estimator import Health, VehicleEstimator
from traction_controller.nodes.slip_estimator import SlipEstimatorBehaviour
from traction_model.contact.tractive import tractive_figures
from traction_model.definition import DefinitionError
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import GRAVITY, load_vehicle
from traction_node.parameter import resolve

RIG, SAND, CLAY = load_vehicle('single_wheel_rig'), load_soil('paper_sand'), 'heavy_clay_25'
[WHEEL] = RIG.wheels
# Rim speed 0.5 m * 2 rad/s against 0.9 m/s: slip 1 - 0.9/1.
OMEGA, V, SLIP = 2.0, 0.9, 0.1


def torque_for(soil, slip):
    """Torque with which the rig runs steadily at a slip: gross traction times radius."""
    figures = tractive_figures(soil, WHEEL, slip, RIG.mass * GRAVITY)
    return WHEEL.radius * float(figures.gross_traction)


TORQUE = torque_for(SAND, SLIP)


def parameters(**overrides):
    """Parameters of the node with the shipped defaults, for the rig."""
    given = {'vehicle': 'single_wheel_rig', 'soil': 'paper_sand'} | overrides
    return SimpleNamespace(**resolve(SlipEstimatorBehaviour.PARAMETERS, given))


def estimator(**overrides):
    return VehicleEstimator.from_parameters(parameters(**overrides))


class Drive:
    """A steady drive, a reading of the wheels every 10 ms and of the radar every 100 ms."""

    def __init__(self, estimator, omega=OMEGA, torque=TORQUE, v=V):
        self.estimator = estimator
        self.omega, self.torque, self.v = omega, torque, v
        self.t = 0.0

    def step(self, radar=None):
        self.t += 0.01
        if radar is not None:
            self.estimator.radar(self.t, radar, 0.0025)
        n = len(self.estimator.slip)
        return self.estimator.wheel_states(self.t, [self.omega] * n, [self.torque] * n)

    def run(self, steps, radar=True):
        for k in range(steps):
            assert self.step(self.v if radar and k % 10 == 0 else None)
        return self.estimator

    def jump(self, off):
        """Set the time and step until it is believed; returns the number of rejected steps."""
        self.t += off
        for k in range(20):
            if self.step():
                return k
        raise AssertionError('time is not believed')


@pytest.fixture
def drive():
    """Rig with a known speed: 2 s on the nominal soil."""
    drive = Drive(estimator())
    drive.run(200)
    return drive


def test_slip_is_the_filters_with_the_same_parameters():
    # None of these is the default, so that one that is not handed on shows.
    p = parameters(
        min_speed=0.2, radar_timeout=1.0, radar_variance=0.01, method='ekf',
        tachometer_pulses=100.0, radar_latency=0.03, radar_min_speed=0.1, gnss_latency=0.02,
        noise_slip=0.05, noise_soil=0.02, stuck_time=0.0,
    )  # fmt: skip
    whole = VehicleEstimator.from_parameters(p)
    alone = SlipFilter(
        RIG, SAND, whole.slip_filter.noise, 0.2, 1.0, 0.01, method='ekf',
        radar_latency=0.03, radar_min_speed=0.1, gnss_latency=0.02,
    )  # fmt: skip
    tachometers = Tachometers(1, 100.0)
    assert (alone.noise.slip, alone.noise.soil, alone.noise.speed) == (0.05, 0.02, 0.04)
    for k in range(60):
        t, omega = 0.01 * k, [OMEGA + 0.01 * k]
        whole.wheel_states(t, omega, [TORQUE])
        tachometers.update(t, np.array(omega))
        alone.wheel_states(t, omega, [TORQUE], tachometers.pulse, tachometers.counted)
        for one in (whole, alone):
            one.radar(t, V, 0.0)
        whole.gnss_velocity(t, V, 0.0)
        alone.gnss(t, V, 0.0)
        for name in (
            't', 'slip', 'slip_variance', 'valid', 'rim_speed', 'v', 'v_variance', 'v_valid',
            'source', 'gross_traction', 'slip_stiffness',
        ):  # fmt: skip
            assert np.array_equal(getattr(whole, name), getattr(alone, name)), name


@pytest.mark.parametrize(
    ('overrides', 'error', 'reason'),
    [
        ({'vehicle': 'tracter_4wd'}, DefinitionError, "unknown vehicle 'tracter_4wd'"),
        ({'soil': 'dry_snad'}, DefinitionError, "unknown soil 'dry_snad'"),
        ({'method': 'ufk'}, ValueError, "unknown method 'ufk'; did you mean 'ukf'"),
        ({'track_width': 1.8}, ValueError, 'track_width 1.8 m needs a rear axle of two wheels'),
    ],
)
def test_parameters_that_give_no_estimator_are_named(overrides, error, reason):
    p = parameters(**overrides)
    for build in (VehicleEstimator.check_parameters, VehicleEstimator.from_parameters):
        with pytest.raises(error, match=reason):
            build(p)


def test_health_before_and_after_the_first_readings(drive):
    assert drive.estimator.health == (Health.OK, 'estimating')
    drive.estimator.reset()
    assert drive.estimator.health == (Health.WARN, 'waiting for wheel_states')
    # Nothing that they could belong to.
    assert not drive.estimator.radar(drive.t, V, 0.0025)
    assert not drive.estimator.gnss_velocity(drive.t, V, 0.0025)
    assert not drive.estimator.gnss(drive.t, [0.0, 0.0])
    assert drive.estimator.t is None
    drive.step()
    assert drive.estimator.health == (
        Health.WARN, 'radar silent: slip rests on shaft torque'
    )  # fmt: skip


@pytest.mark.parametrize(
    ('feed', 'source', 'reason'),
    [
        (lambda e, t: e.wheel_states(t, [math.nan], [TORQUE]), 'wheel_states',
         "wheel speed of wheel 'wheel' is nan"),
        (lambda e, t: e.wheel_states(t, [OMEGA], [TORQUE, TORQUE]), 'wheel_states',
         'expected a shaft torque for each of 1 wheels, got 2'),
        (lambda e, t: e.wheel_states(math.nan, [OMEGA], [TORQUE]), 'wheel_states',
         'time of measurement is not finite: nan'),
        # 50 rad/s in 10 ms: 5000 rad/s^2, where torque and grip of the load give less than a
        # tenth of that.
        (lambda e, t: e.wheel_states(t, [50.0], [TORQUE]), 'wheel_states',
         "speed of wheel 'wheel' jumps beyond what torque and ground can do"),
        (lambda e, t: e.radar(t, math.nan, 0.0025), 'radar', 'radar reading nan m/s'),
        (lambda e, t: e.gnss_velocity(t + 1.0, V, 0.0025), 'gnss_velocity',
         'gnss reading is +1.010 s off the wheels in time'),
        (lambda e, t: e.gnss(t, [math.inf, 0.0]), 'gnss', 'position is not finite'),
    ],
)  # fmt: skip
def test_reading_that_cannot_be_used_changes_nothing_but_health(drive, feed, source, reason):
    before = copy.deepcopy(drive.estimator.slip_filter)
    assert not feed(drive.estimator, drive.t + 0.01)
    assert reason in drive.estimator.refused[source]
    assert drive.estimator.health_due
    health, words = drive.estimator.health
    assert health is Health.ERROR
    assert words.startswith('refused: ')
    assert reason in words
    after = drive.estimator.slip_filter
    assert (after.t, after.v, after.v_variance) == (before.t, before.v, before.v_variance)
    assert np.array_equal(after.slip, before.slip)


def test_good_reading_ends_a_refusal(drive):
    estimator = drive.estimator
    estimator.radar(drive.t, math.nan, 0.0025)
    estimator.wheel_states(drive.t, [math.nan], [TORQUE])
    assert set(estimator.refused) == {'radar', 'wheel_states'}
    drive.step(V)
    assert estimator.refused == {}
    assert estimator.health == (Health.OK, 'estimating')


def test_speed_against_wheels_and_torque_is_not_believed(drive):
    estimator = drive.estimator
    v = estimator.v
    # 0.4 m/s off: eight standard deviations of the reading alone, 0.05 m/s.
    assert not estimator.radar(drive.t, V - 0.4, 0.0025)
    assert estimator.disbelieved == {'radar': 'against wheels and torque'}
    assert estimator.v == v
    assert estimator.health == (
        Health.WARN, 'radar against wheels and torque: not believed'
    )  # fmt: skip
    drive.step(V)
    assert estimator.disbelieved == {}


def test_radar_below_its_least_speed_is_no_reading():
    drive = Drive(estimator(radar_min_speed=0.5))
    drive.run(100)
    # Far off, but below the smallest speed of the radar.
    assert not drive.estimator.radar(drive.t, 0.01, 0.0025)
    assert drive.estimator.disbelieved == {}
    assert drive.estimator.health == (Health.OK, 'estimating')


def test_clock_set_back_starts_anew_and_slip_waits_for_a_speed(drive):
    estimator = drive.estimator
    assert estimator.valid.all()
    distance = estimator.odometry.distance
    # 2 s at 0.9 m/s, less the first reading, from which there is no way yet.
    assert distance == pytest.approx(1.99 * V, abs=0.05)
    # Readings of a tenth of a second, 11 of them, show the new time; the last one is believed.
    assert drive.jump(-1.5) == 10
    # From 2.00 s to 0.61 s.
    assert estimator.time_jump == pytest.approx(-1.39)
    assert estimator.health_due
    assert estimator.health == (Health.WARN, 'time jumped back by 1.390 s: estimating anew')
    assert estimator.t == pytest.approx(0.61)
    assert estimator.source is Source.WHEEL
    # Of the jump there is no way.
    assert estimator.odometry.distance == distance
    # The filter has a slip, which could as well be speed.
    # From torque it is known to 0.5 m/s within 2 s.
    for _ in range(200):
        drive.step()
        assert estimator.time_jump == 0.0
        assert not estimator.valid.any()
        assert not estimator.v_valid
    assert estimator.slip_filter.valid.all()
    drive.step(V)
    drive.step()
    assert estimator.valid.all()
    assert estimator.v_valid
    assert estimator.odometry.distance > distance


def test_gap_of_the_wheels_on_the_move_invalidates_slip_until_a_speed_comes(drive):
    assert drive.jump(SlipFilter.LONGEST_GAP) in (10, 11)
    # The gap, and the readings until it was believed.
    assert drive.estimator.time_jump == pytest.approx(SlipFilter.LONGEST_GAP + 0.11, abs=0.02)
    assert not drive.estimator.valid.any()
    drive.run(20, radar=False)
    assert not drive.estimator.valid.any()
    drive.step(V)
    drive.step()
    assert drive.estimator.valid.all()


def test_vehicle_that_stands_after_a_gap_needs_no_speed(drive):
    drive.jump(SlipFilter.LONGEST_GAP)
    # Rejected as a jump for a short time, then recognised as standstill.
    drive.omega = drive.torque = 0.0
    for _ in range(60):
        drive.step()
    assert not drive.estimator.valid.any()
    # Start without radar: slip is valid as soon as the filter has a valid one.
    drive.torque = TORQUE
    known = False
    for omega in np.linspace(0.0, OMEGA, 100):
        drive.omega = omega
        drive.step()
        known = known or drive.estimator.slip_filter.valid.all()
        assert np.array_equal(drive.estimator.valid, drive.estimator.slip_filter.valid)
    assert known
    assert drive.estimator.source is Source.WHEEL


def test_a_second_clock_is_refused_and_named_once(drive):
    estimator = drive.estimator
    said = set()
    for _ in range(200):
        assert drive.step(V)
        # Of another publisher, 1000 s behind and at half the speed.
        assert not estimator.wheel_states(drive.t - 1000.0, [0.5 * OMEGA], [TORQUE])
        said.add(estimator.health)
        assert estimator.time_jump == 0.0
    assert said == {
        (Health.ERROR, 'refused: stamp is -1000.0 s off the last one: '
         'a gap of 0.5 s or more, or a second clock')
    }  # fmt: skip
    assert estimator.slip[0] == pytest.approx(SLIP, abs=0.01)
    drive.run(110)
    assert estimator.health == (Health.OK, 'estimating')


def test_one_reading_a_second_is_refused_with_the_reason():
    estimator = VehicleEstimator.from_parameters(parameters())
    assert estimator.wheel_states(0.0, [OMEGA], [TORQUE])
    for k in range(1, 60):
        assert not estimator.wheel_states(float(k), [OMEGA], [TORQUE])
        assert 'a gap of 0.5 s or more' in estimator.health[1]
    assert not estimator.valid.any()


def test_torque_of_the_other_sign_is_named_and_not_used(drive):
    estimator = drive.estimator
    drive.torque = -TORQUE
    for k in range(500):
        drive.step(V if k % 10 == 0 else None)
        # The model's error is known after half a second of radar.
        assert k < 50 or estimator.v == pytest.approx(V, abs=0.05)
    assert 'shaft torque has the other sign than slip' in estimator.health[1]
    assert estimator.source is Source.GROUND
    assert estimator.slip[0] == pytest.approx(SLIP, abs=0.02)
    # Mended: the model starts anew within 5 s, and is used again some seconds later.
    drive.torque = TORQUE
    drive.run(1000)
    assert estimator.source is Source.BLENDED
    assert estimator.slip[0] == pytest.approx(SLIP, abs=0.02)


def test_torque_that_nobody_asks_for_is_no_immobilisation():
    for command, level in ((None, Level.IMMOBILISED), (TORQUE, Level.IMMOBILISED),
                           (0.0, Level.NONE)):  # fmt: skip
        drive = Drive(estimator(), omega=0.0, v=0.0)
        for k in range(500):
            if command is not None:
                drive.estimator.commanded_torque([command])
            drive.step(0.0 if k % 10 == 0 else None)
        assert drive.estimator.immobilisation.level is level


def test_inertial_unit_tells_drawbar_from_grade(drive):
    estimator = drive.estimator
    # On a slope of 3 % and with a bias of 0.1 m/s^2.
    offset = 0.1 + GRAVITY * 0.03
    for k in range(500):
        assert estimator.imu(drive.t + 0.01, offset, 0.01, 0.0, 0.0)
        drive.step(V if k % 10 == 0 else None)
    assert estimator.v == pytest.approx(V, abs=0.02)
    before = estimator.slip_filter.external_resistance
    # Less drawbar pull: 0.5 m/s^2, known within 0.2 s, without radar.
    for _ in range(20):
        estimator.imu(drive.t + 0.01, offset + 0.5, 0.01, 0.0, 0.0)
        drive.step()
    less = before - estimator.slip_filter.external_resistance
    assert less == pytest.approx(0.5 * RIG.mass, rel=0.2)


def test_yaw_rate_of_the_inertial_unit_turns_the_pose(drive):
    estimator = drive.estimator
    before = estimator.odometry.yaw
    for k in range(100):
        estimator.imu(drive.t + 0.01, 0.0, 0.01, 0.3, 0.0)
        drive.step(V if k % 10 == 0 else None)
    assert estimator.yaw_rate == pytest.approx(0.3)
    assert estimator.odometry.yaw - before == pytest.approx(0.3, abs=0.01)


def test_ground_speed_of_each_wheel_in_a_turn():
    # A turn to the left at 0.25 rad/s and 2 m/s; no slip: rims have the speed of their centres.
    tractor = VehicleEstimator.from_parameters(
        parameters(vehicle='tractor_4wd', soil='sandy_loam_chrono')
    )
    v, rate = 2.0, 0.25
    # Track 1.6 m, wheelbase 2.4 m: front wheels move along their steered direction.
    left, right = v - 0.8 * rate, v + 0.8 * rate
    ground = [math.hypot(left, 2.4 * rate), math.hypot(right, 2.4 * rate), left, right]
    radii = [wheel.radius for wheel in tractor.vehicle.wheels]
    omega = [speed / radius for speed, radius in zip(ground, radii, strict=True)]
    for k in range(1, 300):
        t = 0.01 * k
        tractor.imu(t, 0.0, 0.01, rate, 0.0)
        tractor.wheel_states(t, omega, [0.0] * 4)
        if k % 10 == 0:
            tractor.radar(t, v, 0.0025)
    assert tractor.slip == pytest.approx([0.0] * 4, abs=0.01)


def test_bad_reading_of_the_inertial_unit_is_told(drive):
    estimator = drive.estimator
    assert not estimator.imu(drive.t, math.nan, 0.0, 0.0, 0.0)
    assert estimator.health == (Health.ERROR, 'refused: acceleration of imu is nan')
    assert not estimator.imu(drive.t + 9.0, 0.0, 0.0, 0.0, 0.0)
    assert 'imu reading is +9.000 s off the wheels in time' in estimator.health[1]
    assert estimator.imu(drive.t, 0.0, 0.0, 0.0, 0.0)
    assert estimator.health == (Health.OK, 'estimating')


def test_several_publishers_are_named(drive):
    drive.estimator.note_publishers('wheel_states', 2)
    assert drive.run(10).health == (Health.ERROR, 'refused: 2 publishers of wheel_states')
    drive.estimator.note_publishers('wheel_states', 1)
    assert drive.run(10).health == (Health.OK, 'estimating')


def test_reading_that_came_late_moves_neither_pose_nor_time(drive):
    estimator = drive.estimator
    t, distance = estimator.t, estimator.odometry.distance
    assert estimator.wheel_states(drive.t - 0.005, [OMEGA], [TORQUE])
    assert (estimator.t, estimator.odometry.distance) == (t, distance)
    # Two tenths later than all that is kept.
    assert not estimator.wheel_states(drive.t - 0.51 + 0.02, [OMEGA], [math.inf])
    assert estimator.time_jump == 0.0


def test_soil_and_pose_are_due_at_their_rates():
    estimator = VehicleEstimator.from_parameters(parameters(terrain_rate=10.0, odometry_rate=50.0))
    drive = Drive(estimator)
    terrain = odometry = 0
    for _ in range(100):
        drive.step()
        terrain += estimator.terrain_due
        odometry += estimator.odometry_due
        assert estimator.health_due or not estimator.terrain_due
    # 1 s of readings.
    assert terrain == 10
    assert odometry == 50
    estimator.wheel_states(drive.t, [math.nan], [TORQUE])
    assert not estimator.terrain_due
    assert not estimator.odometry_due


def test_jump_of_positions_is_refused_and_said(drive):
    estimator = drive.estimator
    for k in range(200):
        drive.step()
        if k % 10 == 0:
            assert estimator.gnss(drive.t, [V * drive.t, 0.0])
    assert estimator.source is Source.BLENDED
    refused = estimator.gnss_track.refused
    # 3 m aside is 150 times a position's deviation.
    assert not estimator.gnss(drive.t + 0.1, [V * drive.t, 3.0])
    assert estimator.gnss_track.refused == refused + 1
    assert estimator.health == (Health.WARN, 'gnss has jumped: refused')


def test_calibrated_radius_is_what_slip_is_computed_with(tmp_path):
    # 6 % more in the file than the 0.5 m that really roll, hardly pulling on firm ground at 3 m/s.
    axle = RIG.axles[0].model_copy(
        update={'wheel': WHEEL.model_copy(update={'radius': 1.06 * 0.5})}
    )
    path = tmp_path / 'larger.yaml'
    path.write_text(
        yaml.safe_dump(RIG.model_copy(update={'axles': (axle,)}).model_dump(mode='json'))
    )
    found = {}
    for calibrate in (False, True):
        built = estimator(vehicle=str(path), soil=CLAY, calibrate_radius=calibrate)
        drive = Drive(built, omega=6.0, torque=torque_for(load_soil(CLAY), 0.003), v=3.0)
        for k in range(600):
            drive.step()
            if k % 10 == 0:
                built.gnss(drive.t, [3.0 * drive.t, 0.0])
        found[calibrate] = built
    assert found[True].slip_filter.rolling_radius == pytest.approx([0.5], rel=0.01)
    assert found[True].rim_speed == pytest.approx([3.0], rel=0.01)
    assert found[True].radius_state == 'calibrating'
    assert found[False].slip_filter.rolling_radius == pytest.approx([0.53])
    assert found[False].radius_state == 'off'
    # Radii outlast a new start.
    found[True].reset()
    assert found[True].slip_filter.rolling_radius == pytest.approx([0.5], rel=0.01)


def test_warning_is_said_before_the_vehicle_stands(drive):
    drive.run(100)
    said = []
    # From 0.9 m/s down by 0.25 m/s^2 under the same torque: 3.6 s. Slip stays as it is.
    for k in range(600):
        drive.v = max(0.0, V - 0.0025 * k)
        drive.omega = drive.v / V * OMEGA
        level = drive.estimator.immobilisation.level
        drive.step(drive.v if k % 5 == 0 else None)
        if drive.estimator.immobilisation.level is not level:
            # Not only when soil is due.
            assert drive.estimator.health_due
            said.append((drive.v, *drive.estimator.health))
    (v, near, words), (_, stuck, last) = said
    # 1.5 s before it is down to 0.3 m/s it has 0.675 m/s; 0.1 s to be sure, and the trend's lag.
    assert 0.45 < v < 0.7
    assert (near, stuck) == (Health.WARN, Health.ERROR)
    assert words == 'immobilisation is near: ground speed falls though torque goes on'
    assert last == 'immobilised: stands though torque goes on'
    assert drive.estimator.immobilisation.level is Level.IMMOBILISED


def test_yaw_comes_from_the_rear_wheels():
    built = estimator(
        vehicle='tractor_4wd', soil='sandy_loam_chrono', track_width=1.8, stuck_time=0.0
    )
    # Rear rims of 0.85 m at 1.95 and 2.05 m/s.
    omega = [2.0 / 0.65, 2.0 / 0.65, 1.95 / 0.85, 2.05 / 0.85]
    for k in range(100):
        built.radar(0.01 * k, 1.95, 0.0025)
        built.wheel_states(0.01 * k, omega, [500.0] * 4)
    # To the left by 0.1/1.8 rad/s, less the slip.
    slip = float(built.slip[built.valid].mean())
    assert built.yaw_rate == pytest.approx((1.0 - slip) * 0.1 / 1.8)
    assert 0.0 < built.yaw_rate_variance < 0.01
    assert built.odometry.yaw > 0.0
    built.reset()
    assert (built.yaw_rate, built.yaw_rate_variance) == (0.0, math.inf)
