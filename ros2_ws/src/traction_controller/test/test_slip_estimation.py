"""Slip estimation against Chrono's truth, and its filter against an independent one."""

import math

import make_bags
import numpy as np
import pytest

from traction_controller.slip_estimation import (
    EstimatorNoise,
    SlipEstimation,
    Source,
    forget,
    predict,
    take_in,
    thrust_curve,
)
from traction_model.slip import slip
from traction_model.soil import load_soil
from traction_model.vehicle import load_vehicle

RADAR_SIGMA = 0.05  # m/s, as in bags/README.md


def replay(chrono, name, silent=(math.inf, math.inf)):
    """Estimate over a Chrono run as its bag has it: 100 Hz, and radar at 10 Hz with its noise.

    Returns t, slip error and its claimed standard deviation per wheel, and whether all slips
    are valid; after 2 s, where rim or vehicle is faster than 0.3 m/s.
    """
    recording = chrono(name)
    vehicle = recording.vehicle
    radii = [wheel.radius for wheel in vehicle.wheels]
    estimation = SlipEstimation(vehicle, load_soil(recording.run.soils[0]))
    noise = np.random.default_rng(make_bags.SEEDS[name]).normal(0.0, RADAR_SIGMA, len(recording.t))
    rows = []
    for k in range(0, len(recording.t), 2):
        t, v = recording.t[k], recording.v[k]
        omega = recording.omega[k]
        estimation.wheel_states(t, omega, recording.torque[k])
        if k % 20 == 0 and not silent[0] <= t < silent[1]:
            estimation.radar(t, v + noise[k], RADAR_SIGMA**2)
        rims = [r * w for r, w in zip(radii, omega, strict=True)]
        if t > 2.0 and all(max(abs(v), abs(rim)) > 0.3 for rim in rims):
            errors = [i - slip(v, rim) for i, rim in zip(estimation.slip, rims, strict=True)]
            deviations = np.sqrt(estimation.slip_variance)
            rows.append([t, *errors, *deviations, estimation.valid.all()])
    rows = np.array(rows)
    n = len(radii)
    return rows[:, 0], rows[:, 1 : 1 + n], rows[:, 1 + n : 1 + 2 * n], rows[:, -1] > 0.5


@pytest.mark.parametrize(
    'name', ['wheel_drawbar', 'wheel_torque_sine', 'tractor_sandy_loam', 'tractor_soft_patch']
)
def test_slip_as_in_chrono(chrono, name):
    # The suite's own budget: 0.02 after the first 2 s. Radar alone would give its noise over
    # the rim's speed: 0.05 m/s/1.5 m/s = 0.033.
    _, error, _, valid = replay(chrono, name)
    assert valid.all()
    assert math.sqrt(np.mean(error**2)) <= 0.02


@pytest.mark.parametrize('name', list(make_bags.SEEDS))
def test_errors_are_as_large_as_claimed(chrono, name):
    # Of a normal error 95.4 % lie within two standard deviations.
    _, error, deviation, _ = replay(chrono, name)
    assert np.mean(np.abs(error) <= 2 * deviation) >= 0.90


def test_tractor_without_radar(chrono):
    # Silent from 6 to 9 s: slip rests on the thrust curve learnt before.
    t, error, deviation, valid = replay(chrono, 'tractor_sandy_loam', silent=(6.0, 9.0))
    gap = (t > 6.5) & (t < 9.0)
    assert valid.all()
    assert math.sqrt(np.mean(error[gap] ** 2)) <= 0.02
    assert np.mean(np.abs(error[gap]) <= 2 * deviation[gap]) >= 0.9
    assert np.median(deviation[gap]) > np.median(deviation[(t > 4.0) & (t < 6.0)])


def test_wheel_on_its_flat_thrust_curve_says_that_it_does_not_know(chrono):
    # At 20 % slip y = i*l/K is about 8: all strength is mobilised, so thrust does not tell slip.
    # The deviation grows with the gap, holds what the error does, and at last flags the slip.
    t, error, deviation, valid = replay(chrono, 'wheel_drawbar', silent=(6.0, 10.5))
    gap = (t > 6.5) & (t < 10.5)
    assert np.mean(np.abs(error[gap]) <= 2 * deviation[gap]) >= 0.9
    assert deviation[t < 10.5][-1] > 5 * deviation[t < 6.0][-1]
    assert not valid[t < 10.5][-1]
    # A second after the radar is back, it is no worse than radar alone, 0.05 m/s/1.5 m/s.
    back = t > 11.5
    assert valid[back].all()
    assert math.sqrt(np.mean(error[back] ** 2)) <= 0.033


def test_source_follows_the_radar():
    estimation = fresh()
    assert estimation.source is Source.WHEEL
    estimation.wheel_states(0.0, [2.0], [500.0])
    estimation.radar(0.0, 0.9, 0.0025)
    assert estimation.source is Source.BLENDED
    for k in range(1, 61):
        estimation.wheel_states(0.01 * k, [2.0], [500.0])
    # radar_timeout is 0.5 s.
    assert estimation.source is Source.WHEEL


def fresh():
    return SlipEstimation(load_vehicle('single_wheel_rig'), load_soil('paper_sand'))


def driving(seconds=1.0):
    """At 1 m/s of rim and 0.9 m/s over ground."""
    estimation = fresh()
    for k in range(round(100 * seconds)):
        estimation.wheel_states(0.01 * k, [2.0], [800.0])
        if k % 10 == 0:
            estimation.radar(0.01 * k, 0.9, 0.0025)
    return estimation


def snapshot(estimation):
    return (
        estimation.t, estimation.v, estimation.v_variance, estimation.resistance,
        estimation.slip.tolist(), estimation.slip_variance.tolist(), estimation.valid.tolist(),
        estimation.thrust.tolist(), estimation.max_shear_stress.tolist(), estimation.source,
    )  # fmt: skip


@pytest.mark.parametrize(
    ('bad', 'reason'),
    [
        (lambda e: e.wheel_states(1.0, [math.nan], [1.0]), "wheel speed of wheel 'wheel' is nan"),
        (lambda e: e.wheel_states(1.0, [1.0], [math.inf]), "shaft torque of wheel 'wheel' is inf"),
        (lambda e: e.wheel_states(1.0, [1.0, 2.0], [1.0]),
         'expected a wheel speed for each of 1 wheels, got 2'),
        (lambda e: e.wheel_states(1.0, [1.0], []), 'a shaft torque for each of 1 wheels, got 0'),
        (lambda e: e.wheel_states(0.5, [1.0], [1.0]), 'time runs backwards: 0.500000 s after 0'),
        (lambda e: e.wheel_states(math.nan, [1.0], [1.0]), 'of measurement is not finite: nan'),
        (lambda e: e.radar(1.0, math.nan, 0.01), 'radar reading nan m/s with variance 0.01'),
        (lambda e: e.radar(1.0, 0.9, -0.1), 'with variance -0.1 m\\^2/s\\^2 is not usable'),
        (lambda e: e.radar(1.0, 0.9, math.inf), 'variance inf'),
        (lambda e: e.radar(math.nan, 0.9, 0.01), 'time of measurement is not finite: nan'),
    ],
)  # fmt: skip
def test_bad_reading_is_named_and_nothing_taken_in(bad, reason):
    estimation = driving()
    before = snapshot(estimation)
    with pytest.raises(ValueError, match=reason):
        bad(estimation)
    assert snapshot(estimation) == before
    # And it goes on as if nothing had been.
    other = driving()
    for e in (estimation, other):
        e.wheel_states(1.0, [2.0], [800.0])
    assert snapshot(estimation) == snapshot(other)


def test_radar_jump_is_rejected_then_accepted():
    estimation = driving(2.0)
    believed = {}
    # 5 standard deviations of what is expected are well below 4 m/s.
    for k in range(200, 300):
        t = 0.01 * k
        estimation.wheel_states(t, [2.0], [800.0])
        if k % 10 == 0:
            believed[round(t, 2)] = estimation.radar(t, 5.0, 0.0025)
    # The first at 2.0 s; half a second later it is believed, and so are all that follow.
    assert [t for t, taken in believed.items() if not taken] == [2.0, 2.1, 2.2, 2.3, 2.4]
    assert estimation.v == pytest.approx(5.0, abs=0.2)


def test_one_wild_reading_changes_nothing():
    estimation = driving(2.0)
    v = estimation.v
    assert not estimation.radar(1.99, 9.0, 0.0025)
    assert estimation.v == v
    assert estimation.radar(1.99, v, 0.0025)


def test_late_radar_counts_as_now():
    estimation = driving(1.0)
    assert estimation.radar(0.9, 0.9, 0.0025)
    assert estimation.t == pytest.approx(0.99)


def test_radar_of_another_clock_is_refused_and_a_radar_alone_is_not_used():
    estimation = driving(1.0)
    with pytest.raises(ValueError, match=r'\+0\.610 s off the wheels in time'):
        estimation.radar(1.6, 0.9, 0.0025)
    # 20 ms ahead is a clock's usual offset: taken in, and the wheels go on undisturbed.
    assert estimation.radar(1.01, 0.9, 0.0025)
    estimation.wheel_states(1.0, [2.0], [800.0])
    alone = fresh()
    assert not alone.radar(0.0, 3.0, 0.0025)
    assert alone.t is None


def test_radar_that_states_no_variance_gets_the_nominal_one():
    stated, silent = driving(1.0), driving(1.0)
    stated.radar(1.0, 0.95, stated.radar_variance)
    silent.radar(1.0, 0.95, 0.0)
    assert snapshot(stated) == snapshot(silent)


@pytest.mark.parametrize('rate', [20.0, 50.0, 100.0])
def test_torque_that_only_spins_the_wheel_up_is_no_thrust(rate):
    # T = J*omega' with omega' = 3 rad/s^2, J = 20 kg*m^2: 60 N*m, nothing left for the soil.
    estimation = fresh()
    for k in range(40):
        estimation.wheel_states(k / rate, [3.0 * k / rate], [60.0])
    # Left over of the first reading, which knows no acceleration: 60/0.5 N, fading out with
    # the filter's 60 ms.
    assert estimation.thrust[0] == pytest.approx(120.0 * math.exp(-39 / rate / 0.06), abs=1e-6)


def tractor_at(speed):
    """A tractor rolling at a speed for 2 s, its radar at 20 Hz."""
    estimation = SlipEstimation(load_vehicle('tractor_4wd'), load_soil('sandy_loam_chrono'))
    rolling = [speed / wheel.radius for wheel in estimation.vehicle.wheels]
    for k in range(200):
        estimation.wheel_states(0.01 * k, rolling, [0.0] * 4)
        if k % 5 == 0:
            estimation.radar(0.01 * k, speed, 0.0025)
    return estimation, rolling


def test_locked_wheels_are_not_taken_for_standstill():
    estimation, _ = tractor_at(3.8)
    for k in range(200, 300):
        # Sliding on at 3.8 m/s, on brakes.
        estimation.wheel_states(0.01 * k, [0.0] * 4, [-4000.0] * 4)
        if k % 5 == 0:
            estimation.radar(0.01 * k, 3.8, 0.0025)
    assert estimation.v == pytest.approx(3.8, abs=0.3)
    assert estimation.slip.tolist() == [-1.0] * 4
    assert all(estimation.valid)


def test_one_dead_tachometer_does_not_stop_the_others():
    estimation, rolling = tractor_at(3.0)
    for k in range(200, 300):
        estimation.wheel_states(0.01 * k, [0.0, *rolling[1:]], [0.0] * 4)
        if k % 5 == 0:
            estimation.radar(0.01 * k, 3.0, 0.0025)
    assert estimation.v == pytest.approx(3.0, abs=0.1)
    assert np.abs(estimation.slip[1:]).max() < 0.05


def test_after_a_gap_nothing_is_known():
    estimation = driving(2.0)
    estimation.wheel_states(3600.0, [2.0], [800.0])
    other = fresh()
    other.wheel_states(3600.0, [2.0], [800.0])
    assert snapshot(estimation) == snapshot(other)


def test_estimation_that_starts_on_slipping_wheels_believes_the_radar():
    # 46 m/s of rim at 30 % slip, as wheel_low_slip after a second: 14 m/s off rolling.
    estimation = fresh()
    estimation.wheel_states(0.0, [92.0], [1570.0])
    assert estimation.radar(0.0, 32.2, 0.0025)
    assert estimation.v == pytest.approx(32.2, abs=0.1)


def test_standstill_is_known_and_not_valid():
    estimation = fresh()
    for k in range(100):
        estimation.wheel_states(0.01 * k, [0.0], [0.0])
    assert estimation.v == pytest.approx(0.0, abs=1e-9)
    assert estimation.valid.tolist() == [False]
    assert estimation.slip.tolist() == [0.0]
    # (0.02 m/s)^2 per reading and the walk in between: far below 0.5 m/s.
    assert math.sqrt(estimation.v_variance) < 0.05
    assert estimation.v_valid


def test_reset_forgets_everything():
    estimation = driving(2.0)
    estimation.reset()
    assert snapshot(estimation) == snapshot(fresh())


def test_backward_is_forward_mirrored(chrono):
    run = chrono('wheel_drawbar')
    forward, backward = fresh(), fresh()
    for k in range(0, 1200, 2):
        t, omega, torque = run.t[k], run.omega[k], run.torque[k]
        forward.wheel_states(t, omega, torque)
        backward.wheel_states(t, -omega, -torque)
        if k % 20 == 0:
            forward.radar(t, run.v[k], 0.0025)
            backward.radar(t, -run.v[k], 0.0025)
    assert backward.v == pytest.approx(-forward.v)
    assert backward.slip == pytest.approx(forward.slip)
    assert backward.max_shear_stress == pytest.approx(forward.max_shear_stress)


def test_predict_and_take_in_against_a_kalman_filter():
    # Textbook form: x = F*x + B*u, P = F*P*F' + Q*dt; K = P*h/(h'P*h + R), P = (1 - K*h')*P.
    random = np.random.default_rng(1)
    n = 4
    mass, dt = 4440.0, 0.013
    q = np.array([4e-4, 2.4e6, 1.6e-3])
    root = random.standard_normal((2 + n, 2 + n))
    x = random.standard_normal(2 + n) * [3, 5000, 1, 1, 1, 1]
    p = root @ root.T
    ours_x, ours_p = x.copy(), p.copy()
    transition = np.eye(2 + n)
    transition[0, 1] = -dt / mass
    noise = np.diag([q[0], q[1], *[q[2]] * n]) * dt
    for _ in range(100):
        impulse = random.standard_normal() * 100
        predict(ours_x, ours_p, impulse, mass, *q, dt)
        x = transition @ x
        x[0] += impulse / mass
        p = transition @ p @ transition.T + noise
        h = random.standard_normal(2 + n) * [1, 1e-3, 1, 1, 1, 1]
        variance = random.uniform(0.1, 2.0)
        innovation = random.standard_normal()
        gain = p @ h / (h @ p @ h + variance)
        # Its own gain from its own covariance.
        take_in(ours_x, ours_p, h, ours_p @ h / (h @ ours_p @ h + variance), innovation, variance)
        x = x + gain * innovation
        p = p - np.outer(gain, h) @ p
        scale = np.sqrt(np.outer(np.diag(p), np.diag(p)))
        assert np.max(np.abs(ours_p - p) / scale) < 1e-9
        assert np.max(np.abs(ours_x - x) / np.sqrt(np.diag(p))) < 1e-9


def test_forget_keeps_the_rest():
    p = np.arange(9.0).reshape(3, 3)
    forget(p, 1, 7.0)
    assert p.tolist() == [[0, 0, 2], [0, 7, 0], [6, 0, 8]]


@pytest.mark.parametrize('i', [-0.9, -0.2, -1e-3, 1e-3, 0.05, 0.3, 0.95])
def test_slope_of_the_thrust_curve(i):
    h = 1e-6
    rise = thrust_curve(i + h, 0.2, 12.0)[0] - thrust_curve(i - h, 0.2, 12.0)[0]
    assert thrust_curve(i, 0.2, 12.0)[1] == pytest.approx(rise / (2 * h), rel=1e-6)


def test_thrust_curve_by_hand():
    # A = 0.2 m^2, l/K = 12, slip 0.25: y = 3, kappa = (1 - exp(-3))/3 = 0.316738;
    # g = 0.2*0.683262 = 0.136652 m^2; at zero slip the slope is A*(l/K)/2 = 1.2 m^2.
    assert thrust_curve(0.25, 0.2, 12.0)[0] == pytest.approx(0.136652, abs=1e-6)
    assert thrust_curve(-0.25, 0.2, 12.0)[0] == pytest.approx(-0.136652, abs=1e-6)
    assert thrust_curve(0.0, 0.2, 12.0) == (0.0, pytest.approx(1.2))


def test_slope_is_smooth_where_the_series_begins():
    below, above = thrust_curve(0.999e-4 / 12, 0.2, 12.0), thrust_curve(1.001e-4 / 12, 0.2, 12.0)
    assert below[1] == pytest.approx(above[1], rel=1e-6)


@pytest.mark.parametrize('fault', ['acceleration', 'speed', 'strength', 'thrust', 'slip'])
def test_noise_refuses(fault):
    with pytest.raises(ValueError, match=f'noise {fault} must be above 0, got -1.0'):
        EstimatorNoise(**{fault: -1.0})


@pytest.mark.parametrize('fault', ['least_speed', 'radar_timeout'])
def test_estimation_refuses(fault):
    with pytest.raises(ValueError, match=f'{fault} must be above 0, got 0.0'):
        SlipEstimation(load_vehicle('single_wheel_rig'), load_soil('paper_sand'), **{fault: 0.0})
