"""Slip estimator as a process: lifecycle, topics, sensors, bad input, dropouts, clock."""

import math

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import TwistWithCovarianceStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, JointState

from traction_controller.estimation.odometry import UNOBSERVED
from traction_controller.estimation.slip_filter import SlipFilter, Source
from traction_interfaces.msg import SlipEstimate
from traction_model.contact.tractive import tractive_figures
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import GRAVITY, load_vehicle
from traction_node import diagnostic
from traction_node.probe import NodeProcess, Probe, executable
from traction_node.stamp import seconds, to_stamp

PARAMS = {'vehicle': 'single_wheel_rig', 'soil': 'paper_sand', 'autostart': True}
NODE = 'slip_estimator'

RIG, SAND = load_vehicle('single_wheel_rig'), load_soil('paper_sand')
# Slip of the drive: rim speed 0.5 m * 2 rad/s against 0.9 m/s.
SLIP = 0.1


def torque_for(soil, slip):
    """Torque with which the rig runs steadily at a slip: gross traction times radius."""
    [wheel] = RIG.wheels
    figures = tractive_figures(soil, wheel, slip, RIG.mass * GRAVITY)
    return wheel.radius * float(figures.gross_traction)


# Torque of the nominal soil at that slip.
TORQUE = torque_for(SAND, SLIP)


def estimator(namespace='', **params):
    path = executable('traction_controller', 'slip_estimator')
    return NodeProcess(path, params=params, namespace=namespace)


class Drive:
    """Publisher of one message at a time; waits for the estimate after it."""

    def __init__(self, probe, t=100.0, names=('wheel',)):
        self.probe = probe
        self.t = t
        self.names = names
        self.estimates = probe.subscribe('slip_estimate')
        self.wheels = probe.publisher('wheel_states')
        self.radars = probe.publisher('radar')
        self.positions = probe.publisher('gnss')
        self.imus = probe.publisher('imu')
        probe.meet(NODE, 'slip_estimate')

    def send_wheels(self, omega=2.0, torque=TORQUE, name=None):
        names = [name] if name else list(self.names)
        speeds = np.broadcast_to(np.array(omega, dtype=float), len(names))
        torques = np.broadcast_to(np.array(torque, dtype=float), len(names))
        message = JointState(name=names, velocity=speeds.tolist(), effort=torques.tolist())
        to_stamp(message.header.stamp, self.t)
        self.wheels.publish(message)

    def send_radar(self, v=0.9, variance=0.0025):
        message = TwistWithCovarianceStamped()
        to_stamp(message.header.stamp, self.t)
        message.twist.twist.linear.x = v
        message.twist.covariance[0] = variance
        self.radars.publish(message)

    def send_fix(self, east, north=0.0):
        message = Odometry()
        to_stamp(message.header.stamp, self.t)
        message.pose.pose.position.x = float(east)
        message.pose.pose.position.y = float(north)
        self.positions.publish(message)

    def send_imu(self, acceleration=0.0, yaw_rate=0.0):
        message = Imu()
        to_stamp(message.header.stamp, self.t)
        message.linear_acceleration.x = acceleration
        message.angular_velocity.z = yaw_rate
        self.imus.publish(message)

    def step(self, radar=None, fix=None, **wheels):
        """Advance by 10 ms; returns the estimate of that instant."""
        self.t += 0.01
        if fix is not None:
            self.send_fix(*fix)
        if radar is not None:
            self.send_radar(radar)
        count = len(self.estimates)
        self.send_wheels(**wheels)
        self.probe.wait_for(lambda: len(self.estimates) > count, 'slip_estimate')
        return self.estimates[-1]

    def run(self, steps, radar=0.9, **wheels):
        for k in range(steps):
            estimate = self.step(radar if k % 10 == 0 else None, **wheels)
        return estimate


@pytest.fixture(scope='module')
def node():
    """An active estimator in a namespace, as other tests start their own."""
    with estimator('field', **PARAMS) as process:
        yield process


@pytest.fixture(scope='module')
def field(node):
    with Probe('field') as probe:
        probe.diagnostics(f'field/{NODE}')
        probe.wait_for_diagnostic(f'field/{NODE}', 'waiting for wheel_states')
        yield probe


@pytest.fixture
def drive(field):
    """From a new activation on, nothing is remembered of an earlier drive."""
    assert field.change_state(NODE, 'deactivate')
    assert field.change_state(NODE, 'activate')
    return Drive(field)


def test_estimate_is_the_cores(drive):
    core = SlipFilter(load_vehicle('single_wheel_rig'), load_soil('paper_sand'))
    for k in range(30):
        estimate = drive.step(omega=2.0 + 0.01 * k)
        core.wheel_states(0.01 * k, [2.0 + 0.01 * k], [TORQUE])
        assert seconds(estimate.header.stamp) == pytest.approx(drive.t)
        assert list(estimate.slip) == pytest.approx(core.slip.tolist(), abs=1e-6)
        assert list(estimate.slip_variance) == pytest.approx(core.slip_variance.tolist())
        assert list(estimate.valid) == core.valid.tolist()
        assert estimate.ground_based_speed == pytest.approx(core.v, abs=1e-6)
        # With every estimate, not only with that of the terrain.
        assert list(estimate.gross_traction) == pytest.approx(core.gross_traction.tolist())
        assert list(estimate.slip_stiffness) == pytest.approx(core.slip_stiffness.tolist())
        assert list(estimate.rolling_radius) == [0.5]
    assert list(estimate.wheel_names) == ['wheel']
    assert list(estimate.wheel_based_speed) == pytest.approx([0.5 * 2.29])


def test_inertial_unit_turns_the_pose(drive, field):
    odometry = field.subscribe('odometry')
    drive.run(10)

    def turns():
        drive.send_imu(yaw_rate=0.25)
        drive.step()
        return odometry and odometry[-1].twist.twist.angular.z == pytest.approx(0.25)

    field.wait_for(turns, 'yaw rate of the inertial unit')


def test_terrain_and_odometry_come_at_their_rates(drive, field):
    terrain = field.subscribe('terrain_estimate')
    odometry = field.subscribe('odometry')
    # Subscriptions are matched once both have spoken.
    drive.probe.wait_for(lambda: drive.run(1) and terrain and odometry, 'first messages')
    terrain.clear()
    odometry.clear()
    before = drive.t
    first = len(drive.estimates)
    drive.run(100)
    field.wait_for(lambda: len(odometry) >= 50, 'odometry')
    # 1 s of stamps, whatever the wall clock: 10 and 50 Hz.
    assert len(terrain) == pytest.approx(10, abs=1)
    assert len(odometry) == pytest.approx(50, abs=1)
    # Of the wheel at rest it is 0.174 m, 0.01 m less or more as it drives.
    assert list(terrain[-1].sinkage) == pytest.approx([0.174], abs=0.05)
    assert terrain[-1].sinkage_variance[0] > 0.0
    assert list(terrain[-1].shear_deformation_modulus) == pytest.approx([0.01], rel=0.5)
    # At constant speed thrust is T/r.
    assert list(terrain[-1].gross_traction) == pytest.approx([TORQUE / 0.5], rel=1e-3)
    assert odometry[-1].child_frame_id == 'base_link'
    driven = odometry[-1].pose.pose.position.x - odometry[0].pose.pose.position.x
    # Integral of the estimated speed, less 0.02 s before the first and after the last odometry.
    path = sum(0.01 * estimate.ground_based_speed for estimate in drive.estimates[first:])
    assert driven == pytest.approx(path, abs=0.03)
    assert odometry[-1].pose.covariance[0] > odometry[0].pose.covariance[0] > 0.0
    assert drive.t - before == pytest.approx(1.0)


def test_slip_from_radar_and_without(drive, field):
    estimate = drive.run(200)
    assert estimate.slip[0] == pytest.approx(SLIP, abs=0.01)
    assert estimate.source == Source.BLENDED
    estimate = drive.run(60, radar=None)
    # No radar for longer than radar_timeout, 0.5 s.
    assert estimate.source == Source.WHEEL
    # Torque alone gives the same slip.
    assert estimate.slip[0] == pytest.approx(SLIP, abs=0.01)
    status = field.wait_for_diagnostic(f'field/{NODE}', 'radar silent: slip rests on shaft torque')
    assert status.level == bytes([diagnostic.WARN])


def test_joints_are_found_by_name(drive):
    drive.t += 0.01
    message = JointState(
        name=['steering', 'wheel'], velocity=[math.nan, 2.0], effort=[math.nan, TORQUE]
    )
    to_stamp(message.header.stamp, drive.t)
    count = len(drive.estimates)
    drive.wheels.publish(message)
    drive.probe.wait_for(lambda: len(drive.estimates) > count, 'slip_estimate')
    assert list(drive.estimates[-1].wheel_based_speed) == [1.0]


@pytest.mark.parametrize(
    ('send', 'reason'),
    [
        (lambda d: d.send_wheels(omega=math.nan), "wheel_states velocity of joint 'wheel' is nan"),
        (lambda d: d.send_wheels(torque=math.inf), "wheel_states effort of joint 'wheel' is inf"),
        (lambda d: d.send_wheels(name='fl'), "wheel_states velocity: joint 'wheel' is missing"),
        (lambda d: d.wheels.publish(JointState(name=['wheel'])),
         'wheel_states velocity: 0 values for 1 joints'),
        (lambda d: d.send_radar(v=math.nan), 'radar reading nan m/s'),
        (lambda d: d.send_radar(variance=-1.0), 'variance -1.0 m^2/s^2 is not usable'),
        (lambda d: d.send_fix(math.inf), 'position is not finite'),
    ],
)  # fmt: skip
def test_bad_message_is_named_and_passed_over(drive, field, send, reason):
    before = drive.run(100)
    count = len(drive.estimates)
    seen = len(field.diagnostics(f'field/{NODE}'))

    def said(text):
        news = field.diagnostics(f'field/{NODE}')[seen:]
        return [status for status in news if text in status.message]

    drive.t += 0.01
    send(drive)
    status = field.wait_for(lambda: said(reason), f'"{reason}" in the diagnostics')[-1]
    assert status.level == bytes([diagnostic.ERROR])
    assert len(drive.estimates) == count
    # It continues as before and reports it.
    seen = len(field.diagnostics(f'field/{NODE}'))
    estimate = drive.run(20)
    assert estimate.slip[0] == pytest.approx(before.slip[0], abs=0.01)
    assert all(math.isfinite(entry) for entry in estimate.slip)

    def recovered():
        # A position on the way that it drives, for where the bad one was one.
        drive.step(0.9, fix=(0.9 * drive.t,))
        return said('estimating')

    field.wait_for(recovered, 'recovery')


def test_clock_that_jumps_back_starts_anew(drive, node, field):
    known = drive.run(200).ground_based_speed_variance
    drive.t = 50.0
    count = len(drive.estimates)

    def believed():
        drive.t += 0.01
        drive.send_wheels()
        return len(drive.estimates) > count

    # After readings of a tenth of a second.
    field.wait_for(believed, 'estimate on the new time')
    estimate = drive.estimates[count]
    node.wait_for_output('time jumped back by 51.')
    assert seconds(estimate.header.stamp) >= 50.11 - 1e-6
    # As at the first message: speed from torque alone, no radar yet.
    assert estimate.ground_based_speed_variance > 4 * known
    assert estimate.source == Source.WHEEL
    assert drive.run(100).slip[0] == pytest.approx(SLIP, abs=0.01)


def value(status, key):
    [found] = [entry.value for entry in status.values if entry.key == key]
    return found


def test_radius_is_found_from_a_wrong_vehicle_file(tmp_path):
    # 6 % more in the file than the 0.5 m that really roll.
    vehicle = RIG.model_dump(mode='json')
    vehicle['axles'][0]['wheel']['radius'] = 1.06 * 0.5
    file = tmp_path / 'rig.yaml'
    file.write_text(yaml.safe_dump(vehicle))
    params = PARAMS | {'vehicle': str(file), 'soil': 'heavy_clay_25', 'calibrate_radius': True}
    with estimator('rolls', **params), Probe('rolls') as probe:
        probe.diagnostics(f'rolls/{NODE}')
        probe.wait_for_diagnostic(f'rolls/{NODE}', 'waiting for wheel_states')
        drive = Drive(probe)
        # Hardly pulling on firm ground at 3 m/s, it rolls.
        wheels = {'omega': 6.0, 'torque': torque_for(load_soil('heavy_clay_25'), 0.003)}
        first = drive.step(**wheels)
        assert list(first.rolling_radius) == pytest.approx([0.53])
        assert math.sqrt(first.rolling_radius_variance[0]) == pytest.approx(0.05 * 0.53)
        # A stretch of 2 m needs 7 intervals of 0.1 s. Its variance (0.04/2.1)^2 + 0.004^2 =
        # 3.8e-4 is below 1e-4 after 4 of them, 2.8 s; the track begins some fixes later.
        for k in range(600):
            estimate = drive.step(fix=(0.03 * k,) if k % 10 == 0 else None, **wheels)
        assert list(estimate.rolling_radius) == pytest.approx([0.5], rel=0.01)
        deviation = math.sqrt(estimate.rolling_radius_variance[0])
        assert deviation <= 0.01 * 0.53
        assert abs(estimate.rolling_radius[0] - 0.5) < 3 * deviation
        # Rim speed and slip follow.
        assert list(estimate.wheel_based_speed) == pytest.approx([3.0], rel=0.01)
        assert estimate.slip[0] == pytest.approx(0.003, abs=0.01)
        status = probe.wait_for(
            lambda: [
                s for s in probe.diagnostics(f'rolls/{NODE}')
                if s.message == 'estimating' and value(s, 'radius_state') == 'calibrating'
            ], 'calibration in the diagnostics',
        )[-1]  # fmt: skip
        assert value(status, 'gnss_refused') == '0'


def test_jump_of_gnss_is_refused_and_counted(drive, field):
    for k in range(200):
        before = drive.step(fix=(0.009 * k,) if k % 10 == 0 else None)
    assert before.source == Source.BLENDED
    assert before.ground_based_speed == pytest.approx(0.9, abs=0.02)
    refused = int(value(field.diagnostics(f'field/{NODE}')[-1], 'gnss_refused'))
    # 3 m aside is 150 times a position's deviation.
    after = drive.step(fix=(0.009 * 200, 3.0))
    status = field.wait_for_diagnostic(f'field/{NODE}', 'gnss has jumped: refused')
    assert status.level == bytes([diagnostic.WARN])
    # 3 m within 0.1 s would be 30 m/s.
    assert after.ground_based_speed == pytest.approx(before.ground_based_speed, abs=1e-3)
    seen = len(field.diagnostics(f'field/{NODE}'))
    for k in range(201, 260):
        drive.step(fix=(0.009 * k,) if k % 10 == 0 else None)
    status = field.wait_for(
        lambda: [
            s for s in field.diagnostics(f'field/{NODE}')[seen:] if s.message == 'estimating'
        ], 'recovery',
    )[-1]  # fmt: skip
    assert int(value(status, 'gnss_refused')) == refused + 1


def test_warning_comes_before_standstill(drive, field):
    drive.run(300)
    levels = []
    # From 0.9 m/s down by 0.25 m/s^2 under the same torque: 3.6 s. Slip stays as it is.
    for k in range(600):
        v = max(0.0, 0.9 - 0.0025 * k)
        estimate = drive.step(v if k % 5 == 0 else None, omega=v / 0.9 * 2.0)
        levels.append((v, estimate))
    warned = next(e for _, e in levels if e.immobilisation == SlipEstimate.IMMOBILISATION_WARNING)
    moving = next(v for v, e in levels if e is warned)
    # 1.5 s before it is down to 0.3 m/s it has 0.675 m/s; 0.1 s to be sure, and the trend's lag.
    assert 0.45 < moving < 0.7
    assert warned.immobilisation_reason == 'ground speed falls though torque goes on'
    assert 0.0 < warned.time_to_immobilisation < 1.5
    assert all(e.immobilisation == SlipEstimate.IMMOBILISATION_NONE for v, e in levels if v > 0.75)
    stuck = levels[-1][1]
    assert stuck.immobilisation == SlipEstimate.IMMOBILISATION_IMMOBILISED
    assert stuck.time_to_immobilisation == 0.0
    said = [status.message for status in field.diagnostics(f'field/{NODE}')]
    near = said.index('immobilisation is near: ground speed falls though torque goes on')
    last = field.wait_for_diagnostic(f'field/{NODE}', 'immobilised: stands though torque goes on')
    assert last.level == bytes([diagnostic.ERROR])
    assert near < said.index(last.message)


def test_odometry_covariance_grows_with_slip():
    with estimator('path', **PARAMS) as _, Probe('path') as probe:
        probe.diagnostics(f'path/{NODE}')
        probe.wait_for_diagnostic(f'path/{NODE}', 'waiting for wheel_states')
        odometry = probe.subscribe('odometry')
        drive = Drive(probe)

        def pose_covariance():
            count = len(odometry)
            drive.probe.wait_for(lambda: drive.step(0.9) and len(odometry) > count, 'odometry')
            return np.reshape(odometry[-1].pose.covariance, (6, 6))

        pose_covariance()
        # With measured speed: 2 sigma^2 T for errors of the speed that last T = 0.5 s, and a
        # tenth of the slip for all the way, which adds up as it is.
        drive.run(300)
        covariance = pose_covariance()
        # Yaw cannot be observed with one wheel.
        assert covariance[1, 1] == covariance[5, 5] == UNOBSERVED
        estimates = drive.estimates[1 : 1 + round((seconds(
            odometry[-1].header.stamp) - 100.01) / 0.01)]  # fmt: skip
        walk = sum(0.01 * e.ground_based_speed_variance for e in estimates)
        lasting = sum(
            0.01 * e.ground_based_speed * 0.1 * abs(e.slip[0]) for e in estimates if e.valid[0]
        )
        assert covariance[0, 0] == pytest.approx(walk + lasting**2, rel=1e-6)
        # About 3 m at a slip of 0.1: 0.03 m of it, a good part of all.
        assert lasting > 0.02
        assert odometry[-1].pose.pose.position.x == pytest.approx(
            sum(0.01 * e.ground_based_speed for e in estimates)
        )


def test_pose_turns_with_the_rear_wheels():
    wheels = ('fl', 'fr', 'rl', 'rr')
    # Readings made up for this are the same to the last bit.
    params = {'autostart': True, 'track_width': 1.8, 'stuck_time': 0.0}
    with estimator('turns', **params), Probe('turns') as probe:
        probe.diagnostics(f'turns/{NODE}')
        probe.wait_for_diagnostic(f'turns/{NODE}', 'waiting for wheel_states')
        odometry = probe.subscribe('odometry')
        drive = Drive(probe, names=wheels)
        # Rear rims at 1.95 and 2.05 m/s: 0.1/1.8 rad/s to the left, less the slip.
        omega = [2.0 / 0.65, 2.0 / 0.65, 1.95 / 0.85, 2.05 / 0.85]
        drive.probe.wait_for(lambda: drive.run(1, 1.95, omega=omega) and odometry, 'pose')
        drive.run(300, 1.95, omega=omega, torque=500.0)
        probe.wait_for(lambda: seconds(odometry[-1].header.stamp) > drive.t - 0.015, 'last pose')
        last = odometry[-1]
        count = round((seconds(last.header.stamp) - 100.01) / 0.01)
        yaw = sum(
            0.01 * (1.0 - np.mean([s for s, v in zip(e.slip, e.valid, strict=True) if v]))
            * 0.1 / 1.8 for e in drive.estimates[1 : 1 + count]
        )  # fmt: skip
        assert 0.1 < yaw < 0.17
        orientation = last.pose.pose.orientation
        assert 2 * math.atan2(orientation.z, orientation.w) == pytest.approx(yaw, rel=0.02)
        assert last.pose.pose.position.y == pytest.approx(
            last.pose.pose.position.x * yaw / 2, rel=0.03
        )
        covariance = np.reshape(last.pose.covariance, (6, 6))
        planar = covariance[np.ix_([0, 1, 5], [0, 1, 5])]
        assert np.all(np.linalg.eigvalsh(planar) > -1e-12)
        assert 0.0 < planar[2, 2] < 0.1
        # To the left of the way, an error of yaw counts by half of it and more.
        assert planar[1, 2] > 0.0
        assert last.twist.twist.angular.z == pytest.approx(0.1 / 1.8, rel=0.1)


def test_lifecycle_by_service():
    with Probe() as probe, estimator(**PARAMS | {'autostart': False}) as node:
        assert probe.state(NODE) == 'unconfigured'
        assert probe.change_state(NODE, 'configure')
        drive = Drive(probe)
        drive.send_wheels()
        probe.run_for(0.2)  # twenty periods of wheel_states
        assert drive.estimates == []
        assert probe.change_state(NODE, 'activate')
        drive.run(5)
        assert probe.change_state(NODE, 'deactivate')
        count = len(drive.estimates)
        drive.send_wheels()
        probe.run_for(0.2)
        assert len(drive.estimates) == count
        assert probe.change_state(NODE, 'cleanup')
        assert probe.state(NODE) == 'unconfigured'
        assert node.interrupt() == 0
        assert 'Traceback' not in node.output


@pytest.mark.parametrize(
    ('params', 'reason'),
    [
        ({'vehicle': 'tracter_4wd'}, "unknown vehicle 'tracter_4wd'; did you mean 'tractor_4wd'?"),
        ({'soil': 'dry_snad'}, "unknown soil 'dry_snad'; did you mean 'dry_sand'?"),
        ({'noise_slip': 0.0}, 'parameter "noise_slip" = 0.0 is out of range: 0.0001 .. 10'),
        (
            {'radar_timeout': 'long'},
            'parameter "radar_timeout" = \'long\' should be a number in s',
        ),
        (
            {'track_width': 1.8, 'vehicle': 'single_wheel_rig'},
            'track_width 1.8 m needs a rear axle of two wheels, but single_wheel_rig has only one '
            'there: give 0',
        ),
        ({'method': 'ufk'}, "unknown method 'ufk'; did you mean 'ukf'?"),
        ({'noise_slp': 0.1}, 'there is no parameter "noise_slp"; did you mean "noise_slip"?'),
    ],
)
def test_bad_parameter_ends_the_start_with_one_line(params, reason):
    with estimator(**params) as node:
        assert node.wait() == 2
        assert node.output == f'{NODE}: {reason}\n'


def test_parameters_are_fixed_while_it_runs(field, node):
    reason = field.set_parameter(NODE, 'min_speed', 0.5)
    assert reason == 'parameter "min_speed" cannot change while the node runs'
