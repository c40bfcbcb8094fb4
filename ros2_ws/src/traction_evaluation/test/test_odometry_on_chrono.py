"""Slip-compensated odometry against the wheels alone, on Chrono's runs."""

import math

import numpy as np

from traction_controller.estimation.odometry import PathOdometry
from traction_controller.estimation.slip_filter import SlipFilter
from traction_evaluation.verification.chrono import CHRONO_RUNS
from traction_model.soil.soil import load_soil


def test_compensated_beats_wheels_on_recorded_runs(chrono, capsys):
    """Estimator with a noisy radar against wheels that are believed, over all tractor runs."""
    names = (
        'wheel_drawbar', 'wheel_torque_sine', 'wheel_soft_patch', 'tractor_sandy_loam',
        'tractor_soft_patch',
    )  # fmt: skip
    for number, name in enumerate(names):
        recording = chrono(name)
        estimation = SlipFilter(recording.vehicle, load_soil(CHRONO_RUNS[name].soils[0]))
        random = np.random.default_rng(number)
        odometry = PathOdometry()
        wheels = 0.0
        # 100 Hz wheels, 10 Hz radar with 0.05 m/s of noise.
        for k in range(0, len(recording.t), 2):
            estimation.wheel_states(recording.t[k], recording.omega[k], recording.torque[k])
            if k % 20 == 0:
                noisy = recording.v[k] + 0.05 * random.standard_normal()
                estimation.radar(recording.t[k], noisy, 0.05**2)
            if k:
                # The one slip that the vehicle's wheels have on the mean.
                slip = float(np.mean(estimation.slip))
                odometry.advance(0.01, estimation.v, estimation.v_variance, slip)
                wheels += 0.01 * float(np.mean(recording.rim_speed[k]))
        true = recording.x[-1] - recording.x[0]
        compensated, uncompensated = odometry.distance - true, wheels - true
        deviation = math.sqrt(odometry.variance)
        with capsys.disabled():
            print(
                f'\n{name}: {true:.2f} m, error {compensated:+.3f} m (2 sigma '
                f'{2 * deviation:.3f}), wheels alone {uncompensated:+.3f} m',
                end='',
            )
        assert abs(compensated) < 0.2 * abs(uncompensated)
        assert abs(compensated) < 2.5 * deviation
        # Consistent, but not too large.
        assert deviation < 0.05 * true
