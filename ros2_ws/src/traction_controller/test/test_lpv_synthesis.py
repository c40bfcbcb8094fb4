"""The slip loop against the wheel's own equations, and a small synthesis against others."""

import math

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from traction_controller.synthesis.certificate import LoopDesign, check, closed_loop
from traction_controller.synthesis.lpv_synthesis import SynthesisError, synthesize
from traction_controller.synthesis.slip_loop import (
    ERROR,
    FIRST_COMMAND,
    MOMENT,
    TORQUE,
    slip_loop,
    slip_pole,
    torque_scale,
)
from traction_model.vehicle.vehicle import load_vehicle

REAR = load_vehicle('tractor_4wd').wheels[3]
# One lag and delay, stiffness known, nothing moves.
KNOWN = {
    'delays': (2, 2),
    'lags': (0.2, 0.2),
    'lag_cells': 1,
    'stiffness_error': 1.0,
    'error_cells': 1,
    'stiffness_rate': 0.0,
    'rim_speed_rate': 0.0,
    'largest_pole': 30.0,
    'grid': 4,
}


@pytest.mark.parametrize('v', [0.5, 4.0])
@pytest.mark.parametrize('stiffness', [0.0, 2e4, 2e5])
def test_loop_is_the_motion_of_a_wheel(v, stiffness):
    """A wheel on soil of linear thrust, its own equations in SI units, over one period."""
    slip, lag, period, moment_time = 0.15, 0.2, 0.01, 0.05
    rim = v / (1 - slip)
    scale, pole = torque_scale(REAR, rim, slip), slip_pole(REAR, rim, stiffness, slip)
    steady = 5000.0
    # Small, as slip's own curve is not part of the loop.
    small = np.array([1e-4, 2e-4 * scale, -1e-4 * scale, 3e-4 * scale, 1e-4 * scale])
    slip_off, torque_off, soil_off, measured_off, command_off = small

    def slope(_, y):
        omega, torque, measured = y
        now = 1 - v / (REAR.radius * omega)
        soil = steady + soil_off + REAR.radius * stiffness * (now - slip - slip_off)
        return [
            (torque - soil) / REAR.inertia,
            (steady + command_off - torque) / lag,
            (soil - measured) / moment_time,
        ]

    omega = v / (REAR.radius * (1 - slip - slip_off))
    start = [omega, steady + torque_off, steady + measured_off]
    end = solve_ivp(slope, (0, period), start, rtol=1e-11, atol=1e-12).y[:, -1]
    new_slip = 1 - v / (REAR.radius * end[0])
    new_soil = steady + soil_off + REAR.radius * stiffness * (new_slip - slip - slip_off)
    loop = slip_loop(pole, lag, period, 1, 1, moment_time)
    state = np.zeros(4)
    state[ERROR] = slip_off
    state[[TORQUE, MOMENT, FIRST_COMMAND]] = (
        np.array([torque_off, soil_off, command_off]) - measured_off
    ) / scale
    found = loop.A @ state
    assert found[ERROR] == pytest.approx(new_slip - slip, abs=2e-8)
    expected = np.array([end[1], new_soil]) - end[2]
    assert found[[TORQUE, MOMENT]] * scale == pytest.approx(expected, abs=2e-4 * scale * 0.01)


def test_commands_move_up_and_count_less_the_measured_moment():
    # With the moment measured at once nothing is left between the two: the command sent now is
    # the input itself a sample later, if the moment stands still.
    loop = slip_loop(0.0, 0.2, 0.01, 3, 3, 0.05)
    state = np.array([0.0, 0.0, 0.0, 1.0, 2.0, 3.0])
    after = loop.A @ state + 5.0 * loop.B
    assert after[FIRST_COMMAND:] == pytest.approx([5.0, 1.0, 2.0])
    # The third has arrived: q rises by (1 - exp(-h/lag))*3, slip by what q has beyond m.
    assert after[TORQUE] == pytest.approx(3.0 * (1 - math.exp(-0.05)))
    assert after[ERROR] == pytest.approx(3.0 * (0.01 - 0.2 * (1 - math.exp(-0.05))))


@pytest.fixture(scope='module')
def known():
    """LQR where nothing is unknown."""
    return synthesize(LoopDesign.model_validate({**KNOWN, 'kind': 'lqr', 'effort': 1.0}))


def test_lqr_costs_what_the_riccati_equation_says(known):
    """Measured moment all but true, so that its missing gain costs next to nothing."""
    design = known.design
    for k, pole in enumerate(design.poles):
        _, E, C = closed_loop(
            design, np.array(known.gains), np.array(float(k)), np.array(0.2), 2, np.array(1.0)
        )
        loop = slip_loop(pole, 0.2, design.period, 2, 2, design.moment_time)
        size = np.ones(design.n_states)
        size[TORQUE:] = design.torque_factor(np.array(pole))
        A = loop.A * size / size[:, None]
        B = (loop.B / size * size[TORQUE])[:, None]
        weights = np.zeros((design.n_states,) * 2)
        weights[ERROR, ERROR] = C[0, ERROR] ** 2
        effort = design.effort**2 * design.period * design.response_time
        _, riccati, _ = control.dlqr(A, B, weights + 1e-12 * np.eye(len(A)), [[effort]])
        best = max(float(column @ riccati @ column) for column in E.T)
        # Above it because of the unmeasured moment and the margins.
        assert best < known.performance[k] < 1.6 * best


@pytest.fixture(scope='module')
def bounded():
    return synthesize(LoopDesign.model_validate({**KNOWN, 'kind': 'hinf'}))


def test_gamma_bounds_the_norm_found_by_frequencies(bounded):
    design = bounded.design
    for k in range(design.grid):
        A, E, C = closed_loop(
            design, np.array(bounded.gains), np.array(float(k)), np.array(0.2), 2, np.array(1.0)
        )
        z = np.exp(1j * np.geomspace(1e-5, math.pi, 2000))
        response = C @ np.linalg.solve(z[:, None, None] * np.eye(len(A)) - A, E)
        norm = float(np.linalg.norm(response, 2, axis=(1, 2)).max())
        assert norm < bounded.performance[k]
        # The bound is for all disturbances while p stands still on the grid: near the norm.
        assert bounded.performance[k] < 2.0 * norm


def test_it_holds_in_between(bounded):
    assert check(bounded, 10).least >= 0


def test_what_cannot_be_is_said():
    hard = {**KNOWN, 'lags': (0.01, 3.0), 'stiffness_error': 50.0, 'delays': (2, 3)}
    with pytest.raises(SynthesisError, match=r'stiffness error|cells|solver'):
        synthesize(LoopDesign.model_validate(hard))


@pytest.mark.parametrize(
    ('entry', 'value'),
    [('lags', (0.3, 0.1)), ('delays', (0, 1)), ('period', 0.0), ('kind', 'h2')],
)
def test_designs_out_of_range_are_refused(entry, value):
    with pytest.raises(ValueError, match=entry):
        LoopDesign.model_validate({entry: value})
