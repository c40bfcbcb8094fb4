"""The sampled slip loop against the matrix exponential, and a small synthesis against others."""

import math

import control
import numpy as np
import pytest

from traction_controller.certificate import LoopDesign, check, closed_loop
from traction_controller.lpv_synthesis import SynthesisError, design_for, synthesize
from traction_controller.slip_loop import slip_loop, slip_pole, torque_scale
from traction_model.definition import DefinitionError
from traction_model.lpv import sampled, slip_dynamics
from traction_model.vehicle import GRAVITY, load_vehicle

REAR = load_vehicle('tractor_4wd').wheels[3]
LOAD = 13979.25  # N, see traction_model/test/test_vehicle.py
# Nothing unknown: one lag but for a hair, one delay, stiffness all but exact, nothing moves.
KNOWN = {
    'delays': (2, 2),
    'lags': (0.1, 0.1 * (1 + 1e-6)),
    'stiffness_error': 1.0001,
    'pole_error': 1.0,
    'stiffness_rate': 0.0,
    'rim_speed_rate': 0.0,
}


@pytest.mark.parametrize('rim_speed', [0.3, 1.5, 7.5])
@pytest.mark.parametrize('relative_stiffness', [0.25, 4.0, 50.0])
@pytest.mark.parametrize('lag', [0.1, 0.3])
def test_loop_is_the_sampled_slip_dynamics(rim_speed, relative_stiffness, lag):
    # In SI units by the matrix exponential, then torque over its scale.
    stiffness, mass = relative_stiffness * LOAD, LOAD / GRAVITY
    a, b = slip_dynamics(REAR, mass, rim_speed, stiffness, 0.15)
    kept, entered = sampled(
        np.array([[a, b], [0.0, -1 / lag]]), np.array([[0.0], [1 / lag]]), 0.01
    )
    scale = torque_scale(REAR, mass, stiffness, 0.15)
    pole = slip_pole(REAR, mass, rim_speed, stiffness, 0.15)
    loop = slip_loop(pole, lag, 0.01, 2, 3)
    unit = np.diag([1.0, scale])
    assert loop.A[1:3, 1:3] == pytest.approx(np.linalg.inv(unit) @ kept @ unit, abs=1e-9)
    # The command sent two samples ago arrives, the one before it and after it do not.
    assert loop.A[1:3, 4] == pytest.approx(entered[:, 0] / [1 / scale, 1.0], abs=1e-9)
    assert np.all(loop.A[1:3, [3, 5]] == 0)


def test_loop_where_pole_and_lag_are_the_same():
    # The closed form divides by their difference; next to it, it must go on as before.
    here, near = slip_loop(10.0, 0.1, 0.01, 1, 1), slip_loop(10.0 * (1 + 1e-7), 0.1, 0.01, 1, 1)
    assert pytest.approx(near.A, abs=1e-7) == here.A
    # p*h*exp(-p*h) = 0.1*exp(-0.1).
    assert here.A[1, 2] == pytest.approx(0.1 * math.exp(-0.1))


def test_error_is_what_slip_changes_less_what_the_target_changes():
    # A slip that moves by the place and a target that moves by as much leave no error.
    loop = slip_loop(1e6, 0.2, 0.01, 2, 2)
    assert pytest.approx([0.0, 1.0, 0.0, 0.0, 0.0]) == loop.E @ [1.0, 1.0]


@pytest.fixture(scope='module')
def known():
    """LQR at one operating point, with its Riccati cost found independently."""
    design = design_for(20.0, 20.002, {**KNOWN, 'kind': 'lqr', 'effort': 0.5})
    return synthesize(design)


def dlqr_cost(design, pole):
    """Cost of the best gains: trace(E'*P*E), P from the Riccati equation."""
    A, B, E = slip_loop(pole, design.lags[0], design.period, 2, 2)
    q = np.zeros_like(A)
    q[0, 0] = (design.period / design.error_time) ** 2
    _, riccati, _ = control.dlqr(A, B[:, None], q + 1e-12 * np.eye(5), [[design.effort**2]])
    return np.trace(E.T @ riccati @ E)


def test_lqr_cost_is_near_the_riccati_equations(known):
    # Gains are designed for jolts besides and keep a margin, so they cost more; not much more.
    best = dlqr_cost(known.design, 20.0)
    assert best <= known.performance[0] <= 1.25 * best


def test_cost_bounds_the_energy_of_a_simulation(known):
    # After a unit jump of the target, and one of place: energies of z, added up over 30 s.
    design = known.design
    gains = np.array(known.gains)[1]
    A, E, C = closed_loop(design, gains, np.array(20.0), np.array(0.1), 2, np.array(1.0))
    energy = 0.0
    for column in E.T:
        x = column.copy()
        for _ in range(3000):
            energy += np.sum((C @ x) ** 2)
            x = A @ x
    assert 0.5 * known.performance[1] < energy <= known.performance[1]


def test_gamma_bounds_the_norm_of_the_closed_loop():
    # python-control finds the peak of the frequency response by its own means.
    design = design_for(20.0, 20.002, {**KNOWN, 'kind': 'hinf', 'effort': 0.5})
    found = synthesize(design)
    A, E, C = closed_loop(
        design, np.array(found.gains)[1], np.array(20.0), np.array(0.1), 2, np.array(1.0)
    )
    response = control.ss(A, E, C, np.zeros((2, 2)), 0.01)
    frequencies = np.geomspace(1e-3, np.pi, 2000) / 0.01
    peak = max(np.linalg.norm(response(np.exp(1j * w * 0.01)), 2) for w in frequencies)
    assert 0.8 * found.performance[1] < peak <= found.performance[1]


def test_a_small_synthesis_holds_in_between():
    design = design_for(10.0, 20.0, {'delays': (2, 2), 'lags': (0.1, 0.2), 'stiffness_error': 1.3})
    found = synthesize(design)
    margins = check(found, 10)
    assert margins.least >= 0
    assert margins.points > 10_000


def test_grid_goes_from_the_lowest_pole_to_where_nothing_changes_any_more():
    design = design_for(3.0, 20_000.0, {})
    assert design.poles[0] == pytest.approx(3.0)
    assert np.exp(-design.poles[-1] * design.period) < 1e-3
    assert design.largest_pole == 20_000.0
    assert np.diff(np.log(design.poles)) == pytest.approx(math.log(2.0))
    assert design.gain_poles[0] == pytest.approx(1.5)


@pytest.mark.parametrize(
    ('settings', 'message'),
    [
        ({'lags': (0.3, 0.1)}, 'lags must be above 0 and increase'),
        ({'delays': (0, 2)}, 'delays must be at least 1'),
        ({'stiffness_error': 1.0}, 'stiffness_error'),
        ({'effort': float('nan')}, 'effort'),
        ({'efort': 1.0}, "unknown key; did you mean 'effort'"),
    ],
)
def test_settings_are_checked(settings, message):
    with pytest.raises(DefinitionError, match=message):
        design_for(3.0, 100.0, settings)


def test_what_cannot_be_done_is_said():
    # A loop gain that may be a hundred times too high or too low, behind 20 ms of delay.
    design = design_for(5.0, 50.0, {'delays': (2, 2), 'stiffness_error': 100.0, 'pole_error': 1.0})
    with pytest.raises(SynthesisError, match=r'no gains|solver|inequalities'):
        synthesize(design)


def test_design_without_a_grid_is_refused():
    with pytest.raises(ValueError, match='poles'):
        LoopDesign(poles=(), largest_pole=1.0)
