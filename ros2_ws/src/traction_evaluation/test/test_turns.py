"""Slip of every wheel in Chrono's turns, with what ships, with and without inertial unit."""

import numpy as np
import pytest

from traction_controller.estimation.vehicle_estimator import VehicleEstimator
from traction_evaluation.loop.shipped import shipped_parameters
from traction_evaluation.loop.traction_loop import TractionLoop
from traction_evaluation.verification.chrono_bags import FAST_STEP, TERRAIN_STEP, Messages, Samples

TURNS = ['turn_left', 'turn_slalom', 'turn_pull']


def slip_errors(chrono, name, seed, inertial=True):
    """RMSE of slip of each wheel from 2 s on, and share of errors within two deviations."""
    samples = Samples(chrono(name))
    messages = Messages(samples, seed)
    estimator = TractionLoop.from_parameters(shipped_parameters()).estimator
    assert isinstance(estimator, VehicleEstimator)
    errors, deviations = [], []
    for k in range(0, len(samples.time), FAST_STEP):
        t = float(samples.time[k])
        if inertial:
            imu = messages.imu(k)
            estimator.imu(
                t, imu.linear_acceleration.x, imu.linear_acceleration_covariance[0],
                imu.angular_velocity.z, imu.angular_velocity.y,
            )  # fmt: skip
        assert estimator.wheel_states(t, samples.omega[k], samples.torque[k])
        if k % TERRAIN_STEP == 0:
            twist = messages.radar(k).twist
            estimator.radar(t, twist.twist.linear.x, twist.covariance[0])
        if t > 2.0:
            errors.append(estimator.slip - samples.slip[k])
            deviations.append(np.sqrt(estimator.slip_variance))
    errors, deviations = np.array(errors), np.array(deviations)
    within = float(np.mean(np.abs(errors) < 2.0 * deviations))
    return np.sqrt(np.mean(errors**2, axis=0)), within


@pytest.mark.parametrize('seed', [101, 102])
@pytest.mark.parametrize('name', TURNS)
def test_slip_of_every_wheel_is_right_in_a_turn(chrono, name, seed):
    errors, within = slip_errors(chrono, name, seed)
    print(name, seed, errors.round(4), round(within, 3))
    assert errors.max() <= 0.015
    assert within > 0.8


def test_without_inertial_unit_a_turn_is_taken_for_slip(chrono):
    errors, _ = slip_errors(chrono, 'turn_left', 101, inertial=False)
    # The track of 1.6 m at 0.25 rad: rear wheels are 8 % slower and faster than the vehicle.
    assert errors.max() > 0.05
