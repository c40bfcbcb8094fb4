"""Odometry along the path: distance, and a variance that is honest."""

import numpy as np
import pytest

from traction_controller.odometry import PathOdometry


def test_distance_by_hand():
    odometry = PathOdometry()
    # 2 m/s for 3 s, then 1 m/s backward for 1 s: 5 m.
    for speed, seconds in ((2.0, 3.0), (-1.0, 1.0)):
        for _ in range(round(100 * seconds)):
            odometry.advance(0.01, speed, 0.01)
    assert odometry.x == pytest.approx(5.0)
    # 2*0.5 s*0.01 m^2/s^2*4 s.
    assert odometry.variance == pytest.approx(0.04)


def test_variance_does_not_depend_on_the_rate():
    fast, slow = PathOdometry(), PathOdometry()
    for _ in range(1000):
        fast.advance(0.001, 1.0, 0.02)
    for _ in range(10):
        slow.advance(0.1, 1.0, 0.02)
    assert fast.variance == pytest.approx(slow.variance)
    assert fast.x == pytest.approx(slow.x)


def test_variance_is_that_of_correlated_errors():
    # Speed errors of standard deviation 0.1 m/s that last 0.5 s (first-order Gauss-Markov):
    # the distances of 4000 runs of 20 s scatter as the variance says. For long times it is
    # 2*0.5*0.1^2*20 = 0.2 m^2, less the start's 2*0.5^2*0.1^2 = 0.005.
    random = np.random.default_rng(1)
    keep = np.exp(-0.01 / 0.5)
    error = 0.1 * random.standard_normal(4000)
    distance = np.zeros(4000)
    odometry = PathOdometry()
    for _ in range(2000):
        distance += 0.01 * error
        error = keep * error + 0.1 * np.sqrt(1 - keep**2) * random.standard_normal(4000)
        odometry.advance(0.01, 0.0, 0.1**2)
    # The variance of 4000 samples is good to 3*sqrt(2/4000) = 7 %.
    assert odometry.variance == pytest.approx(np.var(distance), rel=0.1)
