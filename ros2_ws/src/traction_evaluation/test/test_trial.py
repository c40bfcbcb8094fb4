"""Trials: draws, figures of a step response, stability."""

import dataclasses
import math

import numpy as np
import pytest

from traction_evaluation.closed_loop import trial, trial_figures
from traction_evaluation.closed_loop.closed_loop import DT, Drive
from traction_evaluation.closed_loop.controllers import fixed_pi
from traction_evaluation.closed_loop.trial import TARGET
from traction_evaluation.closed_loop.trial_figures import STEP, STEP_WINDOW
from traction_model.contact.tractive import tractive_figures
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import load_vehicle

TRACTOR = load_vehicle('tractor_4wd')
LOAM = load_soil('sandy_loam_chrono')
STEP_TIME = 4.0
DROP_TIME = STEP_TIME + STEP_WINDOW
END = 10.0


def drive(slip, target=None):
    """Drive of two wheels with given slip."""
    t = DT * np.arange(round(END / DT))
    k = np.ones_like(t)
    slips = np.broadcast_to(np.asarray(slip, dtype=float), (2, len(t))).T.copy()
    wanted = np.where(t < STEP_TIME, TARGET, TARGET + STEP) if target is None else target * k
    return Drive(
        t=t, v=2 * k, x=2 * t, v_estimate=2 * k, net_traction=100 * k, shaft_power=400 * k,
        target=wanted, rim_speed=slips, slip=slips, slip_estimate=slips + 0.01, command=slips,
    )  # fmt: skip


def stepped(response):
    """A drive that responds to the step by a function of the time since."""
    t = DT * np.arange(round(END / DT))
    return drive(TARGET + np.where(t < STEP_TIME, 0.0, response(t - STEP_TIME)))


HELD = drive(TARGET, TARGET)
NOISE_FREE = STEP * (1 - np.exp(-DT * np.arange(round(STEP_WINDOW / DT)) / 0.3))


def judged(run, other=HELD):
    """Figures of a drive whose response is the mean of its wheels'."""
    noisy = trial_figures.differences(run, other, STEP_TIME).mean(axis=1)
    return trial_figures.judge(
        run, other, STEP_TIME, DROP_TIME, noisy, NOISE_FREE, 0.8 * NOISE_FREE
    )


def test_draws_are_what_was_asked_for():
    draws = trial.draws(256, 3)
    assert draws == trial.draws(256, 3)
    assert draws != trial.draws(256, 4)
    assert len({draw.seed for draw in draws}) == 256
    for name, low, high in (
        ('strength', 0.5, 1.5), ('shear_deformation_modulus', 0.5, 1.5),
        ('sinkage_exponent', 0.5, 1.5), ('mass', 0.8, 1.2), ('lag', 0.1, 0.3),
        ('speed', 0.3, 6.0), ('radar_noise', 0.01, 0.1), ('radar_latency', 0.0, 0.1),
        ('torque_noise', 0.0, 0.01),
    ):  # fmt: skip
        values = np.array([getattr(draw, name) for draw in draws])
        assert low <= values.min() < low + 0.02 * (high - low)
        assert high - 0.02 * (high - low) < values.max() <= high
        # Sobol: even in every direction, to 1/256 and little more.
        assert values.mean() == pytest.approx((low + high) / 2, abs=0.01 * (high - low))
    pulses = np.array([draw.pulses_per_turn for draw in draws])
    assert np.exp(np.log(pulses).mean()) == pytest.approx(math.sqrt(200 * 4000), rel=0.02)


@pytest.mark.parametrize('count', [0, 3, 100])
def test_draws_refuse(count):
    with pytest.raises(ValueError, match='number of draws must be a power of 2, got'):
        trial.draws(count, 1)


def test_drawn_soil_and_vehicle_by_hand():
    draw = dataclasses.replace(
        trial.draws(1, 1)[0], strength=0.6, shear_deformation_modulus=1.4, sinkage_exponent=0.8,
        mass=1.2,
    )  # fmt: skip
    soil = trial.drawn_soil(LOAM, draw)
    for pressure in (1e4, 1e5):
        whole = LOAM.max_shear_stress(pressure)
        assert soil.max_shear_stress(pressure) == pytest.approx(0.6 * whole)
        weak = trial.drawn_soil(LOAM, draw, trial.WEAKENED)
        assert weak.max_shear_stress(pressure) == pytest.approx(0.3 * whole)
    # sandy_loam_chrono: K 0.025 m, n 0.7.
    assert soil.shear_deformation_modulus == pytest.approx(0.035)
    assert soil.sinkage_exponent == pytest.approx(0.56)
    assert trial.drawn_vehicle(TRACTOR, draw).mass == pytest.approx(1.2 * TRACTOR.mass)


def test_steady_pull_is_that_of_the_tractive_figures():
    torque, pull = trial.steady_pull(TRACTOR, LOAM, 0.15, 1.0)
    figures = tractive_figures(LOAM, TRACTOR, [0.15])
    assert pull == pytest.approx(figures.net_traction[0])
    radii = np.array([0.65, 0.65, 0.85, 0.85])
    assert (torque / radii).sum() == pytest.approx(figures.gross_traction[0])


def test_first_order_response_settles_when_it_should():
    # 1 - exp(-t/tau) is within 10 % from tau*ln(10), 0.4605 s at 0.2 s, seen at the next sample.
    found = judged(stepped(lambda t: STEP * (1 - np.exp(-t / 0.2))))
    assert found.settling == pytest.approx(0.47)
    assert found.overshoot == 0.0
    # Without noise 0.3*ln(10), and four fifths of it never get there.
    assert found.settling_noise_free == pytest.approx(0.3 * math.log(10), abs=0.01)
    assert math.isinf(found.settling_throughout)
    assert found.overshoot_noise_free == 0.0
    assert found.stable
    # Reference and judged drive have the same net traction: 100 N at 2 m/s from 400 W.
    assert found.work / found.energy == pytest.approx(0.5)
    assert found.estimate_rmse == pytest.approx(0.01)
    assert found.peak == pytest.approx(TARGET + STEP, abs=1e-4)


def test_second_order_response_overshoots_as_it_should():
    # Damping 0.5: exp(-pi*0.5/sqrt(1 - 0.25)) = 0.163 beyond the step.
    damping, rate = 0.5, 10.0
    fast = rate * math.sqrt(1 - damping**2)

    def response(t):
        decay = np.exp(-damping * rate * t)
        return STEP * (1 - decay * (np.cos(fast * t) + damping * rate / fast * np.sin(fast * t)))

    found = judged(stepped(response))
    assert found.overshoot == pytest.approx(0.163, abs=0.002)
    assert found.stable


def test_response_is_free_of_what_both_drives_have():
    noise = 0.02 * np.random.default_rng(0).standard_normal(round(END / DT))
    other = drive(TARGET + noise, TARGET)
    step = stepped(lambda t: STEP * (1 - np.exp(-t / 0.2)))
    noisy = dataclasses.replace(step, slip=step.slip + noise[:, None])
    assert judged(noisy, other).settling == pytest.approx(0.47)


def test_response_that_never_comes():
    found = judged(stepped(lambda t: 0.8 * STEP + 0 * t))
    assert math.isinf(found.settling)


def late(value, start, end):
    """Slip at its target but for a while."""
    t = DT * np.arange(round(END / DT))
    slip = np.where(t < STEP_TIME, TARGET, TARGET + STEP)
    return np.where((t >= start) & (t < end), value, slip)


@pytest.mark.parametrize(
    ('slip', 'stable'),
    [
        (late(0.0, 0.0, 0.0), True),
        # Half a second of spinning is a peak, a second a runaway.
        (late(0.9, 7.0, 7.5), True),
        (late(0.9, 7.0, 8.1), False),
        # Not back at the end; not settled before the step; a number that is none.
        (late(0.32, 9.0, 10.0), False),
        (late(0.0, 3.0, 4.0), False),
        (late(math.nan, 5.0, 5.01), False),
    ],
)
def test_what_is_stable(slip, stable):
    assert judged(drive(slip)).stable is stable


def test_oscillation_is_not_stable():
    t = DT * np.arange(round(END / DT))
    # Amplitude 0.15: 0.106 in the mean of squares.
    slip = late(0.0, 0.0, 0.0) + np.where(t > 7.0, 0.15 * np.sin(2 * math.pi * 2 * t), 0.0)
    assert not judged(drive(slip)).stable


@pytest.fixture(scope='module')
def driven():
    # Ordinary soil, small noise, and a law that holds slip there.
    draw = trial.TrialDraw(
        strength=1.0, shear_deformation_modulus=1.0, sinkage_exponent=1.0, mass=1.0, lag=0.2,
        speed=2.0, pulses_per_turn=4000.0, radar_noise=0.01, radar_latency=0.0,
        torque_noise=0.0, seed=1,
    )  # fmt: skip
    controller = fixed_pi(1.2, 3.2)
    return trial.run_trial(
        draw, TRACTOR, LOAM, lambda draw: controller.loop(draw.pulses_per_turn), perfect=True
    )


def test_trial_goes_as_told(driven):
    figures, run = driven.figures, driven.stepped
    assert figures.stable
    # Rear wheels in ruts pull more than on fresh soil, so it is faster, but not by much.
    assert 2.0 < figures.speed < 3.0
    t = run.t
    assert np.all(run.target == np.where(t < driven.step_time - DT / 2, TARGET, TARGET + STEP))
    assert np.all(driven.unstepped.target == TARGET)
    # The same until the step.
    before = driven.unstepped.t < driven.step_time - DT / 2
    assert np.array_equal(run.slip[: len(before)][before], driven.unstepped.slip[before])
    assert figures.settling < STEP_WINDOW
    responses = trial_figures.differences(run, driven.unstepped, driven.step_time)
    assert responses[-1] == pytest.approx([STEP] * 4, abs=0.1 * STEP)
    # No noise to speak of, and the truth is seen: the same without.
    assert driven.noise_free_response == pytest.approx(driven.noisy_response, abs=1e-9)


def test_wheel_in_a_rut_of_the_step_counts_no_more():
    # At 2 m/s rear wheels, of radius 0.85 m and 2.4 m behind, touch it after 0.775 s.
    each = np.array([1.0, 1.0, 0.0, 0.0])
    held = dataclasses.replace(HELD, slip=np.zeros((len(HELD.t), 4)))
    run = dataclasses.replace(held, slip=held.slip + each)
    found = trial_figures.step_response(run, held, STEP_TIME, TRACTOR)
    np.testing.assert_allclose(found[:77], 0.5)
    np.testing.assert_allclose(found[78:], 1.0)


def test_tau_max_halves_under_front_and_then_rear_wheels(driven):
    run, start = driven.stepped, driven.drop_time
    # At 2 m/s and more the wheelbase of 2.4 m is behind after 1.2 s.
    assert trial.FIRST_STEP <= driven.step_time < trial.LONGEST_START
    assert start == pytest.approx(driven.step_time + STEP_WINDOW)
    first = round(start / DT)
    place = run.x[first]
    rear = int(np.searchsorted(run.x, place + 2.4))
    rising = run.slip - (TARGET + STEP) > 0.1
    front_rises, rear_rises = (np.argmax(rising[first:, j]) + first for j in (0, 2))
    # When the contact, which reaches 0.3 m ahead of the wheel, comes there.
    assert first <= front_rises < first + 30
    assert rear - 40 <= rear_rises < rear + 30
    assert run.t[-1] - run.t[rear] == pytest.approx(trial.DROP_WINDOW, abs=0.05)
    # Half the strength: about half the torque at the same slip.
    assert 0.3 < run.command[-1, 2] / run.command[first - 1, 2] < 0.75


def test_columns_keep_the_order():
    figures = [
        dataclasses.replace(
            judged(drive(TARGET)),
            rmse=rmse,
            stable=rmse < 0.2,
        )
        for rmse in (0.1, 0.3)
    ]
    columns = trial_figures.columns(figures)
    assert columns['rmse'].tolist() == [0.1, 0.3]
    assert columns['stable'].tolist() == [1.0, 0.0]
