"""The model against Chrono: what `make verify` prints, held as tests."""

import lzma
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from traction_evaluation.verification.ablation import ABLATIONS, ablate, ablation_tables
from traction_evaluation.verification.braking import (
    BRAKED_RUN,
    brake_torque,
    braking_tables,
    follow_braked,
    tow,
)
from traction_evaluation.verification.chrono import CHRONO_RUNS, read_chrono
from traction_evaluation.verification.paper_table import (
    PAPER_TABLE_3,
    follow_at_constant_area,
    paper_target,
)
from traction_evaluation.verification.run_errors import cells, run_targets
from traction_evaluation.verification.torque_steps import moving_mean, ringing
from traction_evaluation.verification.verification import (
    FOLLOWED,
    LIMITS,
    Errors,
    Motion,
    errors,
    exceeded,
    follow,
)
from traction_model.contact.contact import Form
from traction_model.simulation.drawbar import Drawbar


@pytest.mark.parametrize('fed', [False, True], ids=['predicted', 'fed'])
@pytest.mark.parametrize('name', FOLLOWED)
def test_runs_with_rims_below_11_metres_per_second(chrono, name, fed):
    recording = chrono(name)
    fast = recording.rim_speed.max() > 11
    assert fast == (name in PAPER_TABLE_3)
    assert fast == math.isinf(LIMITS[name].v_mean)
    assert exceeded(errors(recording, follow(recording, fed=fed)), LIMITS[name]) == []


@pytest.mark.parametrize('name', list(PAPER_TABLE_3))
def test_papers_table_is_reached_with_shear_by_whole_steps(chrono, name):
    recording = chrono(name)
    continuous = errors(recording, follow(recording))
    by_steps = errors(recording, follow(recording, whole_steps=True))
    assert exceeded(by_steps, PAPER_TABLE_3[name]) == []
    # Off by default, and what is left is Chrono's step.
    assert by_steps.v_mean < 0.2 * continuous.v_mean
    assert paper_target({name: by_steps}).met
    assert not paper_target({name: continuous}).met


def test_closed_forms_are_worse_than_the_arc(chrono):
    # Their resistance and contact length go by the load alone, or know no damping.
    recording = chrono('wheel_drawbar')
    arc = errors(recording, follow(recording))
    for form in (Form.PAPER, Form.BEKKER_WONG):
        assert errors(recording, follow(recording, form)).v_mean > 5 * arc.v_mean


def test_papers_form_at_constant_area_against_its_equations(chrono):
    """(22) and (29) written out for one wheel: A 0.224 m^2, b 0.4 m, r 0.5 m, m 500 kg, J 20."""
    recording = chrono('wheel_low_slip')
    motion = follow_at_constant_area(recording)
    area, width, radius, mass, inertia = 0.224, 0.4, 0.5, 500.0, 20.0
    load = mass * 9.81
    sinkage = np.maximum(recording.sinkage[:, 0], 0.0)

    def slope(t, x):
        v, omega = x
        # K*b/(A*i) = K/(l*i) = kappa, K 0.01 m; phi 30 degrees, c 0; n 1.1.
        kappa = min(1.0, 0.01 * width / (area * (1 - v / (radius * omega))))
        thrust = load * math.tan(math.radians(30)) * (1 - kappa)
        resistance = width * load * np.interp(t, recording.t, sinkage) / (2.1 * area)
        torque = np.interp(t, recording.t, recording.torque[:, 0])
        return [(thrust - resistance) / mass, (torque - radius * thrust) / inertia]

    start = [motion.v[0], motion.omega[0, 0]]
    solved = solve_ivp(
        slope, (motion.t[0], motion.t[-1]), start, t_eval=motion.t, rtol=1e-8, max_step=0.005
    )
    np.testing.assert_allclose(motion.v, solved.y[0], rtol=1e-3)
    np.testing.assert_allclose(motion.omega[:, 0], solved.y[1], rtol=1e-3)


def test_errors_by_hand(chrono):
    # The recording against itself, with 0.1 m/s added to speed and 0.3 rad/s at one sample.
    recording = chrono('wheel_drawbar')
    last = slice(60, None)
    omega = recording.omega[last].copy()
    omega[100] += 0.3
    made = Motion(
        recording.t[last], recording.v[last] + 0.1, omega, recording.slip[last],
        recording.sinkage[last],
    )  # fmt: skip
    found = errors(recording, made)
    assert found.v_max == pytest.approx(0.1)
    assert found.v_mean == pytest.approx(0.1)
    assert found.omega_max == pytest.approx(0.3)
    assert found.omega_mean == pytest.approx(0.3 / len(omega))
    assert found.slip_max == 0.0


def test_run_starts_from_chronos_state(chrono):
    recording = chrono('tractor_soft_patch')
    motion = follow(recording)
    k = round(0.3 / 0.005)
    assert motion.t[0] == pytest.approx(0.3)
    assert motion.v[0] == recording.v[k]
    assert motion.x[0] == recording.x[k]
    np.testing.assert_array_equal(motion.omega[0], recording.omega[k])


def test_errors_above_their_limits_are_named():
    limits = Errors(math.inf, 0.5, 1.0, 1.0, 0.1, 0.1)
    # 9 is not above infinity, 0.5 not above 0.5; 1.5 and 0.2 are above 1 and 0.1.
    found = Errors(9.0, 0.5, 1.5, 1.0, 0.2, 0.1)
    assert exceeded(found, limits) == ['omega_max', 'slip_max']
    assert cells(found, limits) == ['9.000', '0.500', '**1.500**', '1.000', '**0.2000**', '0.1000']


def test_targets_are_of_the_worst_run():
    good, bad = Errors(1, 0.01, 1, 0.05, 1, 0.001), Errors(1, 0.02, 1, 0.11, 1, 0.5)
    # Slip of tractor_steps_slow is held to nothing.
    speed, wheel_speed, slip = run_targets({'wheel_drawbar': good, 'tractor_steps_slow': bad})
    assert (speed.found, speed.met) == ('0.0200 m/s', True)
    assert (wheel_speed.found, wheel_speed.met) == ('0.1100 rad/s', False)
    assert 'tractor_steps_slow' in wheel_speed.text
    assert (slip.found, slip.met) == ('0.0010', True)


def test_ablations_change_what_they_say(chrono):
    names = ['wheel_drawbar', 'tractor_sandy_loam']
    steps = []
    found = ablate({name: chrono(name) for name in names}, lambda: steps.append(None))
    assert len(steps) == 2 * len(ABLATIONS)
    as_it_is = found['nothing changed']
    for name in names:
        assert as_it_is[name] == errors(chrono(name), follow(chrono(name)))
    # A single wheel runs in no rut.
    for text in ('fresh soil for all wheels', 'ruts forget shear'):
        assert found[text]['wheel_drawbar'] == as_it_is['wheel_drawbar']
        assert found[text]['tractor_sandy_loam'].slip_mean > 3 * as_it_is[names[1]].slip_mean
    for text in ('no springing back', 'no damping'):
        for name in names:
            assert found[text][name].v_mean > 10 * as_it_is[name].v_mean
    tables = ablation_tables(found)
    assert list(tables) == ['ablation_v', 'ablation_omega', 'ablation_slip']
    assert f'| nothing changed | {as_it_is[names[0]].v_mean:.3f} | ' in tables['ablation_v']


def test_brakes_and_tow_by_hand():
    # Half of 500 and 1500 N*m after half of the first second; half of it at half of 0.3 rad/s.
    np.testing.assert_allclose(
        brake_torque(0.5, np.array([4.0, 0.15, -4.0, 0.0])), [-250, -125, 750, 0]
    )
    # 9000 and 3000 N*m at 10.5 s.
    np.testing.assert_allclose(brake_torque(10.5, np.ones(4)), [-3000, -3000, -9000, -9000])
    before = Drawbar(-90000, 30000, 2.0)
    assert tow(11.0, before) == before
    assert tow(12.25, before) == Drawbar(-67500, 22500, 2.0)
    assert tow(13.5, before) == Drawbar(0, 0, 2.0)


def test_braking_to_lock(chrono):
    recording = chrono(BRAKED_RUN)
    # The law of the brakes gives the torque that Chrono recorded, but for the samples about a
    # chattering wheel.
    k = round(5.0 / 0.005)
    np.testing.assert_allclose(
        brake_torque(5.0, recording.omega[k]), recording.torque[k], rtol=1e-3
    )
    motion = follow_braked(recording)
    found = errors(recording, motion)
    assert exceeded(found, LIMITS[BRAKED_RUN]) == []
    # Locked but for the brakes' creep: 0.9 and more of slip, as Chrono's within 0.01.
    locked = (motion.t > 10.5) & (motion.t < 11.0)
    slip = motion.slip[locked].mean(axis=0)
    assert np.all(slip < -0.9)
    chronos = recording.slip[-len(motion.t) :][locked].mean(axis=0)
    np.testing.assert_allclose(slip, chronos, atol=0.01)
    tables = braking_tables(recording, motion, found)
    assert tables['plateaus'].count('\n') == 6
    assert '**' not in tables['braking']


def test_ringing_of_a_sine():
    # 0.1 rad/s of 6 Hz on a drift. Of the sine its mean over 41 samples leaves
    # sin(41*x)/(41*sin(x)), x = pi*6*0.005: the swing is what is taken away.
    t = 0.005 * np.arange(2001)
    x = math.pi * 6 * 0.005
    left = math.sin(41 * x) / (41 * math.sin(x))
    rms, frequency = ringing(2 + 0.3 * t + 0.1 * np.sin(12 * math.pi * t))
    assert rms == pytest.approx(0.1 * (1 - left) / math.sqrt(2), rel=0.02)
    assert frequency == pytest.approx(6.0, abs=0.1)
    # A line is its own moving mean, away from the ends.
    np.testing.assert_allclose(moving_mean(t)[20:-20], t[20:-20])


def test_turns_have_the_slip_of_each_wheel(chrono):
    """On a circle wheels go as fast as their place makes them: v_y and yaw rate by hand."""
    recording = chrono('turn_left')
    columns, k = recording.columns, round(16.0 / 0.005)
    v, turning = recording.v[k], columns['yaw_rate'][k]
    # Rear wheels, 0.8 m left and right of the middle.
    assert recording.wheel_v[k, 2] == pytest.approx(v - 0.8 * turning, rel=1e-3)
    assert recording.wheel_v[k, 3] == pytest.approx(v + 0.8 * turning, rel=1e-3)
    # Front wheels, 2.4 m ahead, along their own planes.
    for j, side, name in ((0, 0.8, 'steer_l'), (1, -0.8, 'steer_r')):
        steer = columns[name][k]
        along = (v - side * turning) * math.cos(steer)
        along += (columns['v_y'][k] + 2.4 * turning) * math.sin(steer)
        assert recording.wheel_v[k, j] == pytest.approx(along, rel=2e-3)
    assert recording.slip[k, 3] == pytest.approx(
        1 - recording.wheel_v[k, 3] / (0.85 * recording.omega[k, 3])
    )


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('t,v\n0,0\n0.005,0\n', 'column x is missing'),
        ('t,v,x,torque,omega,sinkage,fx\n0,0,0,0,0,0,0\n1,0,0,0,0,0,0\n', 'not sampled every'),
    ],
)
def test_recording_that_is_wrong(tmp_path, text, reason):
    path = tmp_path / 'run.csv.xz'
    path.write_bytes(lzma.compress(text.encode()))
    with pytest.raises(ValueError, match=rf'run\.csv\.xz: {reason}'):
        read_chrono(path, CHRONO_RUNS['wheel_drawbar'])
