"""Bags in bags/: complete, small, and equal to new ones from their CSV."""

import csv
import lzma

import numpy as np
import pytest
from recorded_bags import BAGS, NAMES

from traction_evaluation.verification import chrono_bags as make_bags
from traction_evaluation.verification.chrono import CHRONO_RUNS
from traction_model.vehicle.vehicle import load_vehicle
from tractor_io.bags.reader import BagReader


def stacked(messages, value):
    return np.array([value(m.message) for m in messages])


def test_there_is_one_bag_per_run():
    assert sorted(CHRONO_RUNS) == NAMES
    assert sorted(make_bags.SEEDS.values()) == list(range(1, len(NAMES) + 1))


def test_bags_are_small():
    assert sum(path.stat().st_size for path in BAGS.rglob('*') if path.is_file()) < 25e6


def test_same_csv_gives_same_bytes(tmp_path):
    name = 'wheel_low_slip'
    source = BAGS / name / f'{name}.csv.xz'
    made = [tmp_path / 'first' / name, tmp_path / 'second' / name]
    for folder in made:
        make_bags.make_bag(name, source, folder)
    for file in (f'{name}.mcap', 'metadata.yaml'):
        assert (made[0] / file).read_bytes() == (made[1] / file).read_bytes()
    # Against the bag in the repository by content: its bytes depend on the version of zstd.
    with BagReader(made[0]) as new, BagReader(BAGS / name) as old:
        assert list(new.messages(raw=True)) == list(old.messages(raw=True))


@pytest.mark.parametrize('name', NAMES)
def test_bag_holds_its_run(name):
    with lzma.open(BAGS / name / f'{name}.csv.xz', 'rt') as file:
        samples = sum(1 for _ in file) - 1
    with BagReader(BAGS / name) as bag:
        vehicle = load_vehicle(bag.custom_data['vehicle'])
        messages = {topic: list(bag.messages([topic])) for topic in bag.topics}
        duration = bag.duration
    # 200 Hz samples; 100, 50 and 10 Hz messages, the first at the first sample.
    assert duration == pytest.approx((samples - 1) * 0.005)
    inertial = {'/imu': (samples - 1) // 2 + 1} if name.startswith('turn_') else {}
    assert {topic: len(found) for topic, found in messages.items()} == inertial | {
        '/wheel_states': (samples - 1) // 2 + 1,
        '/wheel_torque': (samples - 1) // 2 + 1,
        '/ground_truth/slip_estimate': (samples - 1) // 2 + 1,
        '/ground_truth/odometry': (samples - 1) // 4 + 1,
        '/ground_truth/terrain_estimate': (samples - 1) // 20 + 1,
        '/radar': (samples - 1) // 20 + 1,
    }
    for found in messages.values():
        for m in found:
            stamp = m.message.header.stamp
            assert stamp.sec * 10**9 + stamp.nanosec == m.time
    truth = messages['/ground_truth/slip_estimate']
    wheel_states = messages['/wheel_states']
    assert wheel_states[0].message.name == list(vehicle.wheel_names)

    # Slip against its definition, written out here, where it is valid. In turns the wheels have
    # speeds of their own.
    rim = stacked(wheel_states, lambda m: m.velocity) * [w.radius for w in vehicle.wheels]
    v = stacked(truth, lambda m: m.ground_based_speed)[:, np.newaxis]
    if CHRONO_RUNS[name].steered:
        with lzma.open(BAGS / name / f'{name}.csv.xz', 'rt') as file:
            rows = list(csv.DictReader(file))[::2]
        v = np.array(
            [[float(row[f'vx_{wheel}']) for wheel in vehicle.wheel_names] for row in rows]
        )
    valid = stacked(truth, lambda m: m.valid)
    slip = stacked(truth, lambda m: m.slip)
    np.testing.assert_array_equal(valid, np.maximum(abs(v), abs(rim)) >= 0.3)
    driving = valid & (rim >= v) & (v > 0)
    braking = valid & (rim < v) & (rim > 0)
    assert (driving | braking).mean() > 0.7
    assert (braking if name == 'tractor_braked' else driving).mean() > 0.5
    np.testing.assert_allclose(slip[driving], (1 - v / np.where(rim == 0, 1, rim))[driving])
    np.testing.assert_allclose(slip[braking], (rim / np.where(v == 0, 1, v) - 1)[braking])
    assert np.all(abs(slip) <= 1)

    # Radar noise: the sample standard deviation of n normal values is off by about
    # sigma / sqrt(2 n), n = 101 or more: 7 %; four times that is 28 %.
    error = (
        stacked(messages['/radar'], lambda m: m.twist.twist.linear.x)
        - stacked(truth, lambda m: m.ground_based_speed)[::10]
    )
    assert error.std() == pytest.approx(0.05, rel=0.28)
    assert abs(error.mean()) < 4 * 0.05 / np.sqrt(len(error))


@pytest.mark.parametrize('name', NAMES)
def test_forces_balance(name):
    """m*dv/dt = gross traction - external resistance, message by message over the run."""
    with BagReader(BAGS / name) as bag:
        vehicle = load_vehicle(bag.custom_data['vehicle'])
        terrain = [m.message for m in bag.messages(['/ground_truth/terrain_estimate'])]
        truth = [m.message for m in bag.messages(['/ground_truth/slip_estimate'])]
    force = np.array([m.gross_traction.sum() - m.external_resistance for m in terrain[1:]])
    impulse = np.cumsum(force) * 0.1
    speed = np.array([m.ground_based_speed for m in truth[::10]])
    gained = (speed[1:] - speed[0]) * vehicle.mass
    error = abs(impulse - gained).max() / vehicle.mass
    assert error < 0.05


def test_attitude_and_motion_in_a_turn():
    """Yaw, pitch and roll of the odometry against the CSV, by the formulas of Euler angles."""
    name = 'turn_left'
    with lzma.open(BAGS / name / f'{name}.csv.xz', 'rt') as file:
        row = list(csv.DictReader(file))[3200]
    with BagReader(BAGS / name) as bag:
        message = list(bag.messages(['/ground_truth/odometry']))[800].message
    q = message.pose.pose.orientation
    assert np.arctan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2)) == pytest.approx(
        float(row['yaw'])
    )
    # Nose up is a negative turn about the axis to the left; left side up is a positive one about
    # the axis ahead.
    assert np.arcsin(2 * (q.w * q.y - q.z * q.x)) == pytest.approx(-float(row['pitch']))
    assert np.arctan2(2 * (q.w * q.x + q.y * q.z), 1 - 2 * (q.x**2 + q.y**2)) == pytest.approx(
        float(row['roll'])
    )
    position, twist = message.pose.pose.position, message.twist.twist
    for found, column in (
        (position.x, 'x'), (position.y, 'y'), (twist.linear.x, 'v'), (twist.linear.y, 'v_y'),
        (twist.angular.z, 'yaw_rate'),
    ):  # fmt: skip
        assert found == float(row[column])
