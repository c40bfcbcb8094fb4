"""Plain filter of measured speeds: against the textbook filter, and as judge of predictions."""

import numpy as np
import pytest

from traction_controller.estimation.speed_filter import (
    ACCELERATION_TIME,
    ACCELERATION_WALK,
    MAX_EXCESS,
    RESTART,
    SPEED_TRACK,
    advance,
    compare,
    measure,
)

VARIANCE = 0.05**2


def track():
    found = np.zeros(1, SPEED_TRACK)
    found['time'] = -np.inf
    return found[0]


def test_is_the_textbook_filter():
    rng = np.random.default_rng(1)
    found = track()
    measure(found, 0.0, 1.0, VARIANCE)
    x = np.array([1.0, 0.0])
    # Stationary variance of a' = -a/T + w: q^2*T/2.
    p = np.diag([VARIANCE, ACCELERATION_WALK**2 * ACCELERATION_TIME / 2.0])
    dt, h = 0.1, np.array([1.0, 0.0])
    kept = np.exp(-dt / ACCELERATION_TIME)
    f = np.array([[1.0, ACCELERATION_TIME * (1.0 - kept)], [0.0, kept]])
    # Integral of a random walk: q^2*(dt^3/3, dt^2/2; dt^2/2, dt).
    q = ACCELERATION_WALK**2 * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
    for k in range(1, 200):
        v = 1.0 + np.sin(0.05 * k) + 0.05 * rng.standard_normal()
        measure(found, dt * k, v, VARIANCE)
        x, p = f @ x, f @ p @ f.T + q
        gain = p @ h / (h @ p @ h + VARIANCE)
        x, p = x + gain * (v - h @ x), p - np.outer(gain, h @ p)
        assert [found['speed'], found['acceleration']] == pytest.approx(x.tolist())
        assert found['speed_variance'] == pytest.approx(p[0, 0])
        assert found['covariance'] == pytest.approx(p[0, 1])
        assert found['acceleration_variance'] == pytest.approx(p[1, 1])


def test_variance_grows_without_readings_and_time_does_not_run_back():
    found = track()
    measure(found, 0.0, 2.0, VARIANCE)
    before = float(found['speed_variance'])
    advance(found, 1.0)
    grown = float(found['speed_variance'])
    assert grown > 4 * before
    advance(found, 0.5)
    assert (found['time'], found['speed_variance']) == (1.0, grown)


def judged(error, seconds, noise=0.05, seed=2):
    """The track after readings at 10 Hz of 2 m/s, and times of restarts, s."""
    rng = np.random.default_rng(seed)
    found = track()
    restarts = []
    for k in range(round(10 * seconds)):
        v = 2.0 + noise * rng.standard_normal()
        if compare(found, 0.1 * k, v, VARIANCE, 2.0 + error(0.1 * k)):
            restarts.append(0.1 * k)
        measure(found, 0.1 * k, v, VARIANCE)
    return found, restarts


@pytest.mark.parametrize('seed', range(10))
def test_predictions_as_good_as_its_own_are_kept(seed):
    found, restarts = judged(lambda t: 0.0, 100.0, seed=seed)
    assert restarts == []
    assert found['preferred'] == 0.0


def test_bad_predictions_are_rejected_at_once_and_again_while_they_last():
    found, restarts = judged(lambda t: 1.0 if t > 10.0 else 0.0, 20.0)
    assert found['preferred'] == 1.0
    # Clipped at 4 with weight 0.1, 1.5 is exceeded with the fifth reading.
    assert restarts[0] == pytest.approx(10.5, abs=0.15)
    assert np.diff(restarts) == pytest.approx(RESTART, abs=0.11)
    assert found['excess'] >= MAX_EXCESS


def test_good_predictions_are_preferred_again():
    found, restarts = judged(lambda t: 1.0 if 10.0 < t < 11.0 else 0.0, 20.0)
    assert len(restarts) == 1
    assert found['preferred'] == 0.0
