"""Plain filter of measured speeds: against the textbook filter, and as judge of predictions."""

import numpy as np
import pytest

from traction_controller.estimation.speed_filter import (
    ACCELERATION,
    ACCELERATION_TIME,
    ACCELERATION_WALK,
    MAX_EXCESS,
    OFFSET,
    OFFSET_UNKNOWN,
    OFFSET_WALK,
    RESTART,
    SPEED,
    SPEED_TRACK,
    accelerate,
    advance,
    compare,
    measure,
    rest,
)
from traction_model.vehicle.vehicle import GRAVITY

VARIANCE = 0.05**2


def track():
    found = np.zeros(1, SPEED_TRACK)
    found['time'] = -np.inf
    return found[0]


def test_is_the_textbook_filter():
    rng = np.random.default_rng(1)
    found = track()
    measure(found, 0.0, 1.0, VARIANCE)
    x = np.array([1.0, 0.0, 0.0])
    # Stationary variance of a' = -a/T + w: q^2*T/2.
    p = np.diag([VARIANCE, ACCELERATION_WALK**2 * ACCELERATION_TIME / 2.0, OFFSET_UNKNOWN**2])
    dt, speed, force = 0.1, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 1.0])
    kept = np.exp(-dt / ACCELERATION_TIME)
    f = np.array([[1.0, ACCELERATION_TIME * (1.0 - kept), 0.0], [0.0, kept, 0.0], [0.0, 0.0, 1.0]])
    # Integral of a random walk: q^2*(dt^3/3, dt^2/2; dt^2/2, dt).
    q = np.zeros((3, 3))
    q[:2, :2] = ACCELERATION_WALK**2 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    # A bias of the pitch rate of 0.01 rad/s counts as a random walk over 1 s.
    q[2, 2] = (OFFSET_WALK**2 + (GRAVITY * 0.01) ** 2) * dt
    for k in range(1, 200):
        t = dt * k
        pitch_rate = 0.02 * np.sin(t)
        x, p = f @ x, f @ p @ f.T + q
        x[2] -= GRAVITY * pitch_rate * dt
        for h, reading, variance in (
            (force, np.cos(t) + 0.2 * rng.standard_normal(), 0.04),
            (speed, 1.0 + np.sin(t) + 0.05 * rng.standard_normal(), VARIANCE),
        ):
            gain = p @ h / (h @ p @ h + variance)
            x, p = x + gain * (reading - h @ x), p - np.outer(gain, h @ p)
            if h is force:
                accelerate(found, t, reading, variance, pitch_rate, 0.01**2)
            else:
                measure(found, t, reading, variance)
        assert found['x'] == pytest.approx(x)
        assert found['p'] == pytest.approx(p)


def test_variance_grows_without_readings_and_time_does_not_run_back():
    found = track()
    measure(found, 0.0, 2.0, VARIANCE)
    before = float(found['p'][SPEED, SPEED])
    advance(found, 1.0, 0.0, 0.0)
    grown = float(found['p'][SPEED, SPEED])
    assert grown > 4 * before
    advance(found, 0.5, 0.0, 0.0)
    assert (found['time'], found['p'][SPEED, SPEED]) == (1.0, grown)


def test_offset_is_found_at_rest_and_follows_the_grade():
    found = track()
    # 0.15 m/s^2 of bias and a slope of 5 % up.
    offset = 0.15 + GRAVITY * 0.05
    for k in range(300):
        measure(found, 0.01 * k, 0.0, 0.02**2)
        accelerate(found, 0.01 * k, offset, 0.04, 0.0, 0.0)
        rest(found, 0.01 * k)
    assert found['x'][OFFSET] == pytest.approx(offset, abs=0.01)
    # Nose down by 0.1 rad within a second.
    for k in range(300, 400):
        accelerate(found, 0.01 * k, offset - GRAVITY * 0.001 * (k - 299), 0.04, 0.1, 0.0)
    assert found['x'][OFFSET] == pytest.approx(offset - GRAVITY * 0.1, abs=0.05)
    assert found['x'][ACCELERATION] == pytest.approx(0.0, abs=0.05)


def test_accelerometer_alone_does_not_start_it():
    found = track()
    accelerate(found, 0.0, 1.0, 0.04, 0.0, 0.0)
    rest(found, 0.0)
    assert found['time'] == -np.inf


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
