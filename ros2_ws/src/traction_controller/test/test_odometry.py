"""Odometry: distance and pose by hand, covariance against scattering runs, gain over wheels."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from traction_controller.estimation.odometry import UNOBSERVED, PathOdometry, axle_yaw_rate


def test_distance_by_hand():
    odometry = PathOdometry()
    # 2 m/s for 3 s, then 1 m/s backward for 1 s: 5 m.
    for speed, seconds in ((2.0, 3.0), (-1.0, 1.0)):
        for _ in range(round(100 * seconds)):
            odometry.advance(0.01, speed, 0.01)
    assert odometry.distance == pytest.approx(5.0)
    assert odometry.x == pytest.approx(5.0)
    # 2*0.5 s*0.01 m^2/s^2*4 s.
    assert odometry.variance == pytest.approx(0.04)


def test_lasting_errors_by_hand():
    odometry = PathOdometry(slip_share=0.1)
    # 10 m at 20 % slip, known to a tenth of it, and a scale known to 1 %: 10*hypot(0.02, 0.01).
    for _ in range(100):
        odometry.advance(0.1, 1.0, 0.0, slip=0.2, scale_deviation=0.01)
    assert math.sqrt(odometry.variance) == pytest.approx(10 * math.hypot(0.02, 0.01))
    # Back again the lasting error goes as well.
    for _ in range(100):
        odometry.advance(0.1, -1.0, 0.0, slip=0.2, scale_deviation=0.01)
    assert odometry.variance == pytest.approx(0.0, abs=1e-12)


def test_variance_grows_with_slip():
    def variance(slip):
        odometry = PathOdometry()
        odometry.advance(10.0, 2.0, 0.01, slip=slip)
        return odometry.variance

    grown = [variance(slip) for slip in (0.0, 0.1, 0.2, 0.4)]
    assert np.all(np.diff(grown) > 0)
    assert variance(-0.2) == variance(0.2)


def test_variance_does_not_depend_on_the_rate():
    fast, slow = PathOdometry(), PathOdometry()
    for _ in range(1000):
        fast.advance(0.001, 1.0, 0.02, 0.1, 0.01)
    for _ in range(10):
        slow.advance(0.1, 1.0, 0.02, 0.1, 0.01)
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


def test_a_circle_closes():
    odometry = PathOdometry()
    # 2*pi*5 m at 1 m/s, turning left by 0.2 rad/s.
    for k in range(1000):
        odometry.advance(math.tau * 5.0 / 1000, 1.0, 0.0, yaw_rate=0.2, yaw_rate_variance=0.0)
        if k == 249:
            # A quarter: 5 m ahead, 5 m to the left, heading left.
            assert (odometry.x, odometry.y) == pytest.approx((5.0, 5.0), abs=1e-3)
            assert odometry.yaw == pytest.approx(math.pi / 2)
    assert (odometry.x, odometry.y) == pytest.approx((0.0, 0.0), abs=1e-3)
    assert odometry.yaw == pytest.approx(0.0, abs=1e-9)
    assert odometry.distance == pytest.approx(math.tau * 5.0)


def test_pose_covariance_is_that_of_scattering_runs():
    """A left-hand bend with errors of all three kinds, 3000 times over."""
    random = np.random.default_rng(2)
    n, dt, steps, v, rate = 3000, 0.05, 1200, 2.0, 0.02
    scale = 0.02 * random.standard_normal(n)
    speed, yaw_rate = np.zeros(n), np.zeros(n)
    x, y, yaw = np.zeros(n), np.zeros(n), np.zeros(n)
    keep, keep_yaw = math.exp(-dt / 0.5), math.exp(-dt / 2.0)
    odometry = PathOdometry()
    for _ in range(steps):
        speed = keep * speed + 0.2 * math.sqrt(1 - keep**2) * random.standard_normal(n)
        yaw_rate *= keep_yaw
        yaw_rate += 0.01 * math.sqrt(1 - keep_yaw**2) * random.standard_normal(n)
        step = (v * (1 + scale) + speed) * dt
        middle = yaw + 0.5 * (rate + yaw_rate) * dt
        x, y = x + step * np.cos(middle), y + step * np.sin(middle)
        yaw = yaw + (rate + yaw_rate) * dt
        odometry.advance(dt, v, 0.2**2, 0.0, 0.02, rate, 0.01**2)
    scattered = np.cov(np.vstack([x, y, yaw]))
    # Samples are good to 3*sqrt(2/3000) = 8 %; errors that last a while are taken for a walk
    # from the start on, which overrates y by 3*2 s/60 s.
    np.testing.assert_allclose(np.diag(odometry.covariance), np.diag(scattered), rtol=0.18)
    correlation = odometry.covariance / np.sqrt(
        np.outer(np.diag(odometry.covariance), np.diag(odometry.covariance))
    )
    expected = scattered / np.sqrt(np.outer(np.diag(scattered), np.diag(scattered)))
    np.testing.assert_allclose(correlation, expected, atol=0.1)


@given(
    st.lists(
        st.tuples(
            st.floats(0.0, 0.5), st.floats(-5.0, 5.0), st.floats(0.0, 1.0), st.floats(-0.9, 0.9),
            st.floats(-1.0, 1.0), st.floats(0.0, 0.1),
        ),
        min_size=1, max_size=50,
    )
)  # fmt: skip
def test_covariance_is_always_one(steps):
    odometry = PathOdometry()
    for dt, v, variance, slip, yaw_rate, yaw_variance in steps:
        odometry.advance(dt, v, variance, slip, 0.01, yaw_rate, yaw_variance)
    covariance = odometry.covariance
    np.testing.assert_allclose(covariance, covariance.T)
    # Rounding counts from the largest on.
    assert np.linalg.eigvalsh(covariance).min() >= -1e-12 * max(1.0, np.trace(covariance))
    assert abs(odometry.yaw) <= math.pi


def test_yaw_that_is_not_observed_is_told_so():
    odometry = PathOdometry()
    odometry.advance(1.0, 0.0, 0.01)
    assert odometry.yaw_observed
    odometry.advance(1.0, 2.0, 0.01)
    assert not odometry.yaw_observed
    covariance = odometry.covariance
    assert covariance[1, 1] == covariance[2, 2] == UNOBSERVED
    assert covariance[0, 0] == odometry.variance
    # It stays so, as the heading is unknown from here on.
    odometry.advance(1.0, 2.0, 0.01, yaw_rate=0.1, yaw_rate_variance=1e-4)
    assert odometry.covariance[2, 2] == UNOBSERVED


def test_yaw_rate_of_an_axle_by_hand():
    # On a left-hand bend of 10 m at 2 m/s, 1.6 m between the wheels: 0.2 rad/s, wheels at 1.84
    # and 2.16 m/s over ground. At 10 % slip rims are faster by 1/0.9.
    rate, variance = axle_yaw_rate(1.84 / 0.9, 2.16 / 0.9, 0.1, 1.6, 0.02)
    assert rate == pytest.approx(0.2)
    # Slip uneven by 0.3*0.1 + 0.005 of 2.4 m/s: 0.084 m/s, with both rims' 0.02 m/s: over 1.6 m.
    assert variance == pytest.approx((0.084**2 + 2 * 0.02**2) / 1.6**2)
    # Braking by 10 %: rim is 0.9 of the ground speed.
    braking, _ = axle_yaw_rate(1.84 * 0.9, 2.16 * 0.9, -0.1, 1.6)
    assert braking == pytest.approx(0.2)
    assert axle_yaw_rate(2.0, 2.0, 0.5, 1.6)[0] == 0.0
    assert axle_yaw_rate(2.0, 2.0, 0.5, 1.6)[1] > axle_yaw_rate(2.0, 2.0, 0.1, 1.6)[1]


@pytest.mark.parametrize(
    ('arguments', 'named'),
    [
        ((-0.1, 1.0, 0.01), 'at least 0'),
        ((0.1, math.nan, 0.01), 'finite numbers'),
        ((0.1, 1.0, -0.01), 'at least 0'),
        ((0.1, 1.0, 0.01, math.inf), 'finite numbers'),
        ((0.1, 1.0, 0.01, 0.0, 0.0, 0.0, math.nan), 'at least 0'),
    ],
)
def test_what_is_not_usable_is_named_and_not_taken_in(arguments, named):
    odometry = PathOdometry()
    with pytest.raises(ValueError, match=named):
        odometry.advance(*arguments)
    assert odometry.distance == odometry.variance == 0.0


def test_parameters_out_of_range_are_named():
    with pytest.raises(ValueError, match='slip_share'):
        PathOdometry(slip_share=-1.0)
    with pytest.raises(ValueError, match='track_width'):
        axle_yaw_rate(1.0, 1.0, 0.0, 0.0)
    with pytest.raises(ValueError, match='not usable'):
        axle_yaw_rate(1.0, math.nan, 0.0, 1.6)
    with pytest.raises(ValueError, match='not usable'):
        axle_yaw_rate(1.0, 1.0, 1.5, 1.6)
