"""Slip filter on Chrono's runs: errors, their covariance, soil, late readings."""

import math

import numpy as np
import pytest

from traction_controller.estimation.slip_filter import EstimatorNoise, SlipFilter
from traction_controller.estimation.tachometer import Tachometers
from traction_evaluation.closed_loop.trial import steady_pull
from traction_evaluation.verification import chrono_bags as make_bags
from traction_model.simulation.sensors import Tachometer
from traction_model.slip import slip
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import load_vehicle

RADAR_SIGMA = 0.05  # m/s, as in bags/README.md

METHODS = ['ekf', 'ukf', 'scheduled_gain']

# tau_max, K and n of the nominal soil unknown by 50 %.
GUESSED_SOIL = EstimatorNoise(strength=0.3, nominal=1.0, soil=0.03)

# Straight ahead, and torque without steps or brakes: what the filter models.
SMOOTH = [
    'wheel_drawbar', 'wheel_torque_sine', 'wheel_soft_patch', 'wheel_low_slip', 'wheel_high_slip',
    'tractor_sandy_loam', 'tractor_soft_patch',
]  # fmt: skip


def replay(chrono, name, silent=(math.inf, math.inf), method='ukf'):
    """Estimate over a Chrono run as its bag has it: 100 Hz, and radar at 10 Hz with its noise.

    Returns t, slip error and its claimed standard deviation per wheel, and whether all slips
    are valid; after 2 s, where rim or vehicle is faster than 0.3 m/s.
    """
    recording = chrono(name)
    vehicle = recording.vehicle
    radii = [wheel.radius for wheel in vehicle.wheels]
    estimation = SlipFilter(vehicle, load_soil(recording.run.soils[0]), method=method)
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


def snapshot(estimation):
    return (
        estimation.t, estimation.v, estimation.v_variance, estimation.external_resistance,
        estimation.slip.tolist(), estimation.slip_variance.tolist(), estimation.valid.tolist(),
        estimation.gross_traction.tolist(), estimation.max_shear_stress.tolist(),
        estimation.source,
    )  # fmt: skip


@pytest.mark.parametrize('method', METHODS)
@pytest.mark.parametrize(
    ('name', 'most'),
    [
        # A reading of the radar is off by 0.05 m/s, over the rim's speed 0.012 to 0.033.
        ('wheel_drawbar', 0.010),
        ('wheel_torque_sine', 0.010),
        ('tractor_sandy_loam', 0.010),
        ('tractor_soft_patch', 0.010),
        # At 1 m/s a reading is off by 0.04 of slip.
        ('wheel_soft_patch', 0.015),
    ],
)
def test_slip_as_in_chrono(chrono, name, most, method):
    _, error, _, valid = replay(chrono, name, method=method)
    assert valid.all()
    assert math.sqrt(np.mean(error**2)) <= most


@pytest.mark.parametrize('method', METHODS)
@pytest.mark.parametrize('name', SMOOTH)
def test_errors_are_as_large_as_claimed(chrono, name, method):
    # Of a normal error 95.4 % lie within two standard deviations.
    _, error, deviation, _ = replay(chrono, name, method=method)
    assert np.mean(np.abs(error) <= 2 * deviation) >= 0.90
    # Nor are they much smaller: tractor_sandy_loam, on the nominal soil, has the smallest, 0.34.
    assert math.sqrt(np.mean((error / deviation) ** 2)) > 0.3


@pytest.mark.parametrize(
    ('speed', 'expected', 'most'),
    # What the nominal soil says of the torque. At 1 m/s a reading is off by 0.045 of slip, and
    # 0.04 is on the steep part of the curve.
    [(2.5, 0.04, 0.02), (2.5, 0.2, 0.02), (1.0, 0.2, 0.02), (1.0, 0.04, 0.04)],
)
@pytest.mark.parametrize('seed', [0, 1])
def test_radar_wins_over_a_guessed_soil(speed, expected, most, seed):
    vehicle, soil = load_vehicle('tractor_4wd'), load_soil('sandy_loam_chrono')
    rim = speed / (1 - 0.1)
    torque, _ = steady_pull(vehicle, soil, expected, rim)
    omega = [rim / wheel.radius for wheel in vehicle.wheels]
    estimation = SlipFilter(vehicle, soil, GUESSED_SOIL)
    noise = np.random.default_rng(seed)
    for k in range(1000):
        estimation.wheel_states(0.01 * k, omega, torque)
        if k % 10 == 0:
            estimation.radar(
                0.01 * k, speed + RADAR_SIGMA * noise.standard_normal(), RADAR_SIGMA**2
            )
        if k >= 500:
            assert abs(estimation.slip.mean() - 0.1) < most


PATCH_IN_GAP = pytest.mark.xfail(
    strict=True, reason='the soft patch begins in the gap: slip RMSE grows by 0.034, not 0.03'
)


@pytest.mark.parametrize(
    ('name', 'start'),
    [
        pytest.param(
            name, start, marks=[PATCH_IN_GAP] if (name, start) == ('wheel_soft_patch', 6.0) else []
        )
        for name in (
            'wheel_drawbar', 'wheel_torque_sine', 'wheel_soft_patch', 'tractor_sandy_loam',
            'tractor_soft_patch',
        )
        for start in (4.0, 6.0, 9.5)
    ],
)  # fmt: skip
def test_radar_gap_of_five_seconds(chrono, name, start):
    # In the patch runs the gap from 6 s on holds the change of soil, too.
    t, error, deviation, _ = replay(chrono, name, silent=(start, start + 5.0))
    _, without, _, _ = replay(chrono, name)
    gap = (t >= start) & (t < start + 5.0)
    cost = math.sqrt(np.mean(error[gap] ** 2)) - math.sqrt(np.mean(without[gap] ** 2))
    assert cost <= 0.03
    assert np.mean(np.abs(error[gap]) <= 2 * deviation[gap]) >= 0.85


@pytest.mark.parametrize(
    ('name', 'entered'),
    # x of the wheel at 8.5 m, of the rear wheels at 22 m: see
    # traction_evaluation.verification.chrono.
    [
        ('wheel_soft_patch', 8.5),
        pytest.param(
            'tractor_soft_patch', 22.0,
            marks=pytest.mark.xfail(
                strict=True, reason='the front wheels keep the tau_max of the loam, 29 % too large'
            ),
        ),
    ],
)  # fmt: skip
def test_shear_strength_of_a_soft_patch_within_three_seconds(chrono, name, entered):
    recording = chrono(name)
    vehicle = recording.vehicle
    nominal, patch = (load_soil(soil) for soil in recording.run.soils)
    estimation = SlipFilter(vehicle, nominal)
    # Nominal tau_max = c + (W/A)*tan(phi) gives W/A over the area that the estimate refers to.
    pressure = (estimation.max_shear_stress - nominal.cohesion) / math.tan(nominal.friction_angle)
    truth = np.array([patch.max_shear_stress(p) for p in pressure])
    # The change is a quarter of tau_max, above the limit of the error.
    assert np.all(truth < 0.8 * estimation.max_shear_stress)
    noise = np.random.default_rng(make_bags.SEEDS[name]).normal(0.0, RADAR_SIGMA, len(recording.t))
    last = recording.t[np.searchsorted(recording.x, entered)]
    judged = 0
    for k in range(0, len(recording.t), 2):
        t = recording.t[k]
        estimation.wheel_states(t, recording.omega[k], recording.torque[k])
        if k % 20 == 0:
            estimation.radar(t, recording.v[k] + noise[k], RADAR_SIGMA**2)
        if t >= last + 3.0:
            judged += 1
            assert estimation.max_shear_stress == pytest.approx(truth, rel=0.15)
            assert np.all(estimation.max_shear_stress_variance > 0)
    assert judged > 300


@pytest.mark.parametrize('method', METHODS)
def test_late_and_out_of_order_as_if_in_time(chrono, method):
    recording = chrono('tractor_soft_patch')
    soil = load_soil(recording.run.soils[0])
    # From before the patch to behind it, so that the soil changes meanwhile.
    wheels, radar = [], []
    for k in range(1300, 1800, 2):
        wheels.append((recording.t[k], 0, k))
        if k % 20 == 0:
            radar.append((recording.t[k] - 0.004, 1, k))
    in_time = sorted(wheels + radar)
    # Radar 130 ms late, and every fifth reading of the wheels after the next two.
    arrival = [(t + (0.13 if kind else 0.0), kind, k, t) for t, kind, k in in_time]
    arrival = [
        (a + (0.025 if not kind and k % 10 == 0 and k > 1300 else 0.0), kind, k, t)
        for a, kind, k, t in arrival
    ]
    pair = [SlipFilter(recording.vehicle, soil, method=method) for _ in range(2)]
    for estimation, order in zip(
        pair, ([(k, kind, t) for t, kind, k in in_time],
               [(k, kind, t) for _, kind, k, t in sorted(arrival)]), strict=True,
    ):  # fmt: skip
        for k, kind, t in order:
            if kind:
                estimation.radar(t, recording.v[k], 0.0025)
            else:
                estimation.wheel_states(t, recording.omega[k], recording.torque[k])
    first, second = pair
    assert snapshot(first) == snapshot(second)
    assert first.sinkage.tolist() == second.sinkage.tolist()
    assert first.external_resistance_variance == second.external_resistance_variance


@pytest.mark.parametrize(
    ('name', 'most'),
    # A pulse of 60 is 10 rad/s of a reading at 100 Hz, several times the wheels' 2 to 6 rad/s.
    # Where nothing changes quickly it costs little; the rig on its patch goes down to 0.65 m/s.
    [('wheel_drawbar', 0.02), ('tractor_sandy_loam', 0.02), ('wheel_soft_patch', 0.04)],
)
def test_coarse_encoder_does_not_read_as_slip(chrono, name, most):
    recording = chrono(name)
    tachometer = Tachometer(len(recording.vehicle.wheels), 60)
    estimation = SlipFilter(recording.vehicle, load_soil(recording.run.soils[0]))
    found = Tachometers(len(recording.vehicle.wheels))
    noise = np.random.default_rng(make_bags.SEEDS[name]).normal(0.0, RADAR_SIGMA, len(recording.t))
    errors, deviations, raw = [], [], []
    for k in range(0, len(recording.t), 2):
        t = recording.t[k]
        turning = recording.omega[max(k - 1, 0) : k + 1].mean(axis=0)
        reading = tachometer.read(turning, 0.01)
        found.update(t, reading)
        estimation.wheel_states(t, reading, recording.torque[k], found.pulse, found.counted)
        if k % 20 == 0:
            estimation.radar(t, recording.v[k] + noise[k], RADAR_SIGMA**2)
        if t >= 2.0:
            errors.append(estimation.slip - recording.slip[k])
            deviations.append(np.sqrt(estimation.slip_variance))
            raw.append(reading - recording.omega[k])
    errors = np.array(errors)
    assert np.std(raw) > 2.5
    assert abs(np.mean(errors)) < 0.01
    assert math.sqrt(np.mean(errors**2)) <= most
    assert np.mean(np.abs(errors) <= 2 * np.array(deviations)) >= 0.9


def test_backward_is_forward_mirrored(chrono):
    run = chrono('wheel_drawbar')
    forward, backward = (
        SlipFilter(load_vehicle('single_wheel_rig'), load_soil('paper_sand')) for _ in range(2)
    )
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
