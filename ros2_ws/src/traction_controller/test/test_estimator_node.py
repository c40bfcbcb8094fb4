"""The slip estimator as a process: lifecycle, topics, bad input, radar's silence, clock."""

import math

import pytest
from geometry_msgs.msg import TwistWithCovarianceStamped
from sensor_msgs.msg import JointState

from traction_controller.slip_estimation import SlipEstimation, Source
from traction_model.soil import load_soil
from traction_model.vehicle import load_vehicle
from traction_node import diagnostic
from traction_node.graph import NodeProcess, Probe, executable
from traction_node.stamp import seconds, to_stamp

PARAMS = {'vehicle': 'single_wheel_rig', 'soil': 'paper_sand', 'autostart': True}
NODE = 'slip_estimator'


def estimator(namespace='', **params):
    path = executable('traction_controller', 'slip_estimator')
    return NodeProcess(path, params=params, namespace=namespace)


class Drive:
    """Feeds a running estimator one message at a time and waits for what it says to it."""

    def __init__(self, probe, t=100.0):
        self.probe = probe
        self.t = t
        self.estimates = probe.subscribe('slip_estimate')
        self.wheels = probe.publisher('wheel_states')
        self.radars = probe.publisher('radar')

    def send_wheels(self, omega=2.0, torque=800.0, name='wheel'):
        message = JointState(name=[name], velocity=[omega], effort=[torque])
        to_stamp(message.header.stamp, self.t)
        self.wheels.publish(message)

    def send_radar(self, v=0.9, variance=0.0025):
        message = TwistWithCovarianceStamped()
        to_stamp(message.header.stamp, self.t)
        message.twist.twist.linear.x = v
        message.twist.covariance[0] = variance
        self.radars.publish(message)

    def step(self, radar=None, **wheels):
        """Advance by 10 ms; returns the estimate of that instant."""
        self.t += 0.01
        if radar is not None:
            self.send_radar(radar)
        count = len(self.estimates)
        self.send_wheels(**wheels)
        self.probe.wait_for(lambda: len(self.estimates) > count, 5.0, 'slip_estimate')
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
    core = SlipEstimation(load_vehicle('single_wheel_rig'), load_soil('paper_sand'))
    for k in range(30):
        estimate = drive.step(omega=2.0 + 0.01 * k)
        core.wheel_states(0.01 * k, [2.0 + 0.01 * k], [800.0])
        assert seconds(estimate.header.stamp) == pytest.approx(drive.t)
        assert list(estimate.slip) == pytest.approx(core.slip.tolist(), abs=1e-6)
        assert list(estimate.slip_variance) == pytest.approx(core.slip_variance.tolist())
        assert list(estimate.valid) == core.valid.tolist()
        assert estimate.ground_based_speed == pytest.approx(core.v, abs=1e-6)
    assert list(estimate.wheel_names) == ['wheel']
    assert list(estimate.wheel_based_speed) == pytest.approx([0.5 * 2.29])


def test_terrain_and_odometry_come_at_their_rates(drive, field):
    terrain = field.subscribe('terrain_estimate')
    odometry = field.subscribe('odometry')
    # Subscriptions are matched once both have spoken.
    drive.probe.wait_for(lambda: drive.run(1) and terrain and odometry, 5.0, 'first messages')
    terrain.clear()
    odometry.clear()
    before = drive.t
    first = len(drive.estimates)
    drive.run(100)
    field.wait_for(lambda: len(odometry) >= 50, 5.0, 'odometry')
    # 1 s of stamps, whatever the wall clock: 10 and 50 Hz.
    assert len(terrain) == pytest.approx(10, abs=1)
    assert len(odometry) == pytest.approx(50, abs=1)
    # Of the wheel at rest it is 0.174 m, 0.01 m less or more as it drives.
    assert list(terrain[-1].sinkage) == pytest.approx([0.174], abs=0.05)
    assert terrain[-1].sinkage_variance[0] > 0.0
    assert list(terrain[-1].shear_deformation_modulus) == pytest.approx([0.01], rel=0.5)
    # T = 800 N*m at constant speed: thrust T/r = 1600 N.
    assert list(terrain[-1].thrust) == pytest.approx([1600.0], rel=1e-3)
    assert odometry[-1].child_frame_id == 'base_link'
    driven = odometry[-1].pose.pose.position.x - odometry[0].pose.pose.position.x
    # The estimated speed summed up, less what lies beyond the first and last odometry: 0.02 s.
    path = sum(0.01 * estimate.ground_based_speed for estimate in drive.estimates[first:])
    assert driven == pytest.approx(path, abs=0.03)
    assert odometry[-1].pose.covariance[0] > odometry[0].pose.covariance[0] > 0.0
    assert drive.t - before == pytest.approx(1.0)


def test_slip_from_radar_and_without(drive, field):
    estimate = drive.run(200)
    # Between what the torque takes on the nominal soil, 0.04, and what the radar says: 0.1.
    assert 0.03 < estimate.slip[0] < 0.11
    assert estimate.source == Source.BLENDED
    estimate = drive.run(60, radar=None)
    # Silent for longer than radar_timeout, 0.5 s.
    assert estimate.source == Source.WHEEL
    status = field.wait_for_diagnostic(f'field/{NODE}', 'radar silent: slip rests on shaft torque')
    assert status.level == bytes([diagnostic.WARN])


def test_joints_are_found_by_name(drive):
    drive.t += 0.01
    message = JointState(
        name=['steering', 'wheel'], velocity=[math.nan, 2.0], effort=[math.nan, 800.0]
    )
    to_stamp(message.header.stamp, drive.t)
    count = len(drive.estimates)
    drive.wheels.publish(message)
    drive.probe.wait_for(lambda: len(drive.estimates) > count, 5.0, 'slip_estimate')
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
    ],
)  # fmt: skip
def test_bad_message_is_named_and_passed_over(drive, field, send, reason):
    before = drive.run(20)
    count = len(drive.estimates)
    seen = len(field.diagnostics(f'field/{NODE}'))

    def said(text):
        news = field.diagnostics(f'field/{NODE}')[seen:]
        return [status for status in news if text in status.message]

    drive.t += 0.01
    send(drive)
    status = field.wait_for(lambda: said(reason), 5.0, f'"{reason}" in the diagnostics')[-1]
    assert status.level == bytes([diagnostic.ERROR])
    assert len(drive.estimates) == count
    # Goes on as before, and says so.
    seen = len(field.diagnostics(f'field/{NODE}'))
    estimate = drive.run(20)
    assert estimate.slip[0] == pytest.approx(before.slip[0], abs=0.05)
    assert all(math.isfinite(entry) for entry in estimate.slip)
    field.wait_for(lambda: drive.run(1) and said('estimating'), 5.0, 'recovery')


def test_clock_that_jumps_back_starts_anew(drive, node):
    known = drive.run(200).ground_based_speed_variance
    drive.t = 50.0
    estimate = drive.step()
    node.wait_for_output('time jumped back by 51.99')
    assert seconds(estimate.header.stamp) == pytest.approx(50.01)
    # As at the first message: speed not known better than torque tells it, no radar yet.
    assert estimate.ground_based_speed_variance > 4 * known
    assert estimate.source == Source.WHEEL
    assert 0.03 < drive.run(100).slip[0] < 0.11


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
        ({'method': 'ufk'}, "unknown method 'ufk'; did you mean 'ukf'?"),
        ({'noise_slp': 0.1}, 'there is no parameter "noise_slp"; did you mean "noise_slip"?'),
    ],
)
def test_bad_parameter_ends_the_start_with_one_line(params, reason):
    with estimator(**params) as node:
        assert node.wait() == 2
        assert node.output == f'{NODE}: {reason}\n'


def test_parameters_are_fixed_while_it_runs(field, node):
    reason = field.set_parameter(NODE, 'least_speed', 0.5)
    assert reason == 'parameter "least_speed" cannot change while the node runs'
