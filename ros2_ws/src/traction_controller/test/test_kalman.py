"""Kalman filters against an independent library, filterpy."""

import math

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter

from traction_controller.estimation.kalman import (
    Method,
    linearise,
    method_named,
    optimal_gain,
    propagate,
    reset_entry,
    sigma_points,
    update,
)

M = 5
STEPS = 400


def measure(method, x, p, function, entries, steps, measured, variance):
    """Update with one scalar measurement of some entries, as in the slip filter."""
    k = len(entries)
    entries, steps = np.array(entries), np.array(steps)
    root, points, slope = np.zeros((k, k)), np.empty((1 + 2 * k, k)), np.empty(k)
    count = sigma_points(int(method), x, p, entries, steps, root, points)
    values = np.array([function(point) for point in points[:count]])
    expected, rest = linearise(int(method), values, steps, root, slope)
    h, gain = np.zeros(len(x)), np.empty(len(x))
    h[entries] = slope
    optimal_gain(p, h, variance + rest, gain)
    update(x, p, h, gain, measured - expected, variance + rest)


def linear_case(seed):
    """Stable linear system of five states with measurements of two or three of them."""
    random = np.random.default_rng(seed)
    transition = random.standard_normal((M, M))
    transition *= 0.98 / np.abs(np.linalg.eigvals(transition)).max()
    root = 0.1 * random.standard_normal((M, M))
    noise = root @ root.T
    rows = [([0, 2], np.array([1.0, -0.5])), ([1, 3, 4], np.array([0.3, 2.0, 1.0]))]
    return random, transition, noise, rows


def assert_same(x, p, other_x, other_p):
    deviation = np.sqrt(np.diag(other_p))
    assert np.max(np.abs(x - other_x) / deviation) < 1e-9
    assert np.max(np.abs(p - other_p) / np.outer(deviation, deviation)) < 1e-9


@pytest.mark.parametrize('method', [Method.EKF, Method.UKF])
@pytest.mark.parametrize('seed', [1, 2, 3])
def test_linear_case_as_the_kalman_filter_of_filterpy(method, seed):
    random, transition, noise, rows = linear_case(seed)
    other = KalmanFilter(dim_x=M, dim_z=1)
    other.x = random.standard_normal((M, 1))
    other.P = np.diag(random.uniform(0.5, 2.0, M))
    other.F, other.Q = transition, noise
    x, p = other.x[:, 0].copy(), other.P.copy()
    for k in range(STEPS):
        propagate(x, p, transition, noise)
        other.predict()
        entries, row = rows[k % 2]
        measured, variance = random.standard_normal(), random.uniform(0.1, 2.0)
        h = np.zeros((1, M))
        h[0, entries] = row
        other.update(np.array([[measured]]), R=np.array([[variance]]), H=h)
        measure(method, x, p, lambda z, r=row: float(r @ z), entries, [0.1] * len(entries),
               measured, variance)  # fmt: skip
        assert_same(x, p, other.x[:, 0], other.P)


@pytest.mark.parametrize('seed', [1, 2])
def test_linear_case_as_the_unscented_filter_of_filterpy(seed):
    random, transition, noise, rows = linear_case(seed)
    _, row = rows[1]
    entries = rows[1][0]
    points = MerweScaledSigmaPoints(M, alpha=1.0, beta=0.0, kappa=0.0)
    other = UnscentedKalmanFilter(
        M, 1, 1.0, hx=lambda x: np.array([row @ x[entries]]), fx=lambda x, dt: transition @ x,
        points=points,
    )  # fmt: skip
    other.x, other.P, other.Q = random.standard_normal(M), np.eye(M), noise
    x, p = other.x.copy(), other.P.copy()
    for _ in range(STEPS):
        propagate(x, p, transition, noise)
        other.predict()
        # filterpy measures with the points it predicted; drawn anew, they carry the noise, too.
        other.sigmas_f = points.sigma_points(other.x, other.P)
        measured = random.standard_normal()
        other.update(np.array([measured]), R=np.array([[0.5]]))
        measure(Method.UKF, x, p, lambda z: float(row @ z), entries, [0.1] * 3, measured, 0.5)
        assert_same(x, p, other.x, other.P)


def test_curved_measurement_of_all_entries_as_the_unscented_filter_of_filterpy():
    random = np.random.default_rng(4)
    points = MerweScaledSigmaPoints(3, alpha=1.0, beta=0.0, kappa=0.0)

    def curved(x):
        return math.exp(0.3 * x[0]) * math.sin(x[1]) + x[2] ** 2

    other = UnscentedKalmanFilter(
        3, 1, 1.0, hx=lambda x: np.array([curved(x)]), fx=lambda x, dt: x, points=points
    )
    other.x, other.P = random.standard_normal(3), np.diag([0.5, 1.0, 0.2])
    other.Q = 0.05 * np.eye(3)
    x, p = other.x.copy(), other.P.copy()
    for _ in range(200):
        propagate(x, p, np.eye(3), other.Q)
        other.predict()
        other.sigmas_f = points.sigma_points(other.x, other.P)
        measured = random.standard_normal()
        other.update(np.array([measured]), R=np.array([[0.3]]))
        measure(Method.UKF, x, p, curved, [0, 1, 2], [0.1] * 3, measured, 0.3)
        assert_same(x, p, other.x, other.P)


def test_joseph_form_holds_for_any_gain():
    # (I - K*h')*P*(I - K*h')' + R*K*K', written out.
    random = np.random.default_rng(5)
    root = random.standard_normal((M, M))
    p, h, gain = root @ root.T, random.standard_normal(M), random.standard_normal(M)
    left = np.eye(M) - np.outer(gain, h)
    expected = left @ p @ left.T + 0.7 * np.outer(gain, gain)
    x = np.zeros(M)
    update(x, p, h, gain, 2.0, 0.7)
    assert p == pytest.approx(expected, abs=1e-12)
    assert (p == p.T).all()
    assert x == pytest.approx(2.0 * gain)


def test_entry_known_exactly_has_no_part_in_a_measurement():
    # Of 2*a + 5*b with a exact, variance 1 for b and 3 of the measurement: gain 5/(25 + 3).
    for method in (Method.EKF, Method.UKF):
        x, p = np.array([1.0, 0.0]), np.diag([0.0, 1.0])
        measure(method, x, p, lambda z: 2 * z[0] + 5 * z[1], [0, 1], [0.1, 0.1], 30.0, 3.0)
        assert x == pytest.approx([1.0, 28.0 * 5 / 28])
        assert np.diag(p) == pytest.approx([0.0, 1 - 25 / 28])


def test_reset_entry_keeps_the_rest():
    p = np.arange(9.0).reshape(3, 3)
    reset_entry(p, 1, 7.0)
    assert p.tolist() == [[0, 0, 2], [0, 7, 0], [6, 0, 8]]


def test_unknown_method_names_the_nearest():
    with pytest.raises(ValueError, match=r"unknown method 'ufk'; did you mean 'ukf'\?"):
        method_named('ufk')
