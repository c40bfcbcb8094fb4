"""The LPV model of slip against the equations of motion, and what it can control."""

import control
import numpy as np
import pytest

from traction_model.contact import Form, contact
from traction_model.lpv import sampled, slip_dynamics
from traction_model.soil import load_soil
from traction_model.wheel import Wheel

# Agriculture 2024, 14(3), 499, Table 1; sinkage held at 0.15 m.
WHEEL = Wheel(radius=0.5, width=0.4, inertia=20)
MASS = 500.0
SINKAGE = 0.15
SAND = load_soil('paper_sand').packed(WHEEL)


def forces(slip, rim_speed):
    """Thrust, resistance and moment of the form with M = r*F, at a slip when driving."""
    v = (1 - slip) * rim_speed
    return contact(
        int(Form.BEKKER_WONG), v, rim_speed / WHEEL.radius, SINKAGE, 0.0, SAND,
        WHEEL.radius, WHEEL.width,
    )[1:]  # fmt: skip


def slip_rate(slip, rim_speed, torque, drawbar):
    """i' by the chain rule on i = 1 - v/(r*omega), from m*v' = F - R - D, J*omega' = T - M."""
    thrust, resistance, moment = forces(slip, rim_speed)
    v = (1 - slip) * rim_speed
    v_rate = (thrust - resistance - drawbar) / MASS
    rim_rate = WHEEL.radius * (torque - moment) / WHEEL.inertia
    return -v_rate / rim_speed + v * rim_rate / rim_speed**2


def stiffness(slip, rim_speed, h=1e-5):
    """C = dF/di by central differences."""
    return (forces(slip + h, rim_speed)[0] - forces(slip - h, rim_speed)[0]) / (2 * h)


@pytest.mark.parametrize('rim_speed', [0.3, 1.0, 10.0])
@pytest.mark.parametrize('slip', [0.02, 0.1, 0.2, 0.5])
def test_slip_dynamics_against_numerical_linearisation(slip, rim_speed):
    # In steady motion: torque balances the moment, drawbar the net thrust.
    thrust, resistance, moment = forces(slip, rim_speed)
    drawbar = thrust - resistance
    assert slip_rate(slip, rim_speed, moment, drawbar) == pytest.approx(0.0, abs=1e-12)
    h = 1e-5
    a = (
        slip_rate(slip + h, rim_speed, moment, drawbar)
        - slip_rate(slip - h, rim_speed, moment, drawbar)
    ) / (2 * h)
    b = slip_rate(slip, rim_speed, moment + 0.5, drawbar)
    b -= slip_rate(slip, rim_speed, moment - 0.5, drawbar)
    found = slip_dynamics(WHEEL, MASS, rim_speed, stiffness(slip, rim_speed), slip)
    assert found == pytest.approx((a, b), rel=1e-5)


def test_slip_dynamics_by_hand():
    # rim 2 m/s, C = 10 kN, slip 0.2: a = -1e4*(1/500 + 0.8*0.25/20)/2 = -1e4*0.012/2 = -60/s;
    # b = 0.8*0.5/(20*2) = 0.01 per N*m*s.
    assert slip_dynamics(WHEEL, MASS, 2.0, 1e4, 0.2) == pytest.approx((-60.0, 0.01))


def test_torque_gain_changes_tenfold_with_speed():
    slow = slip_dynamics(WHEEL, MASS, 0.5, 1e4, 0.2)[1]
    fast = slip_dynamics(WHEEL, MASS, 5.0, 1e4, 0.2)[1]
    assert slow / fast == pytest.approx(10.0)


@pytest.mark.parametrize('rim_speed', [0.3, 1.0, 3.0, 12.0])
@pytest.mark.parametrize('slip', [0.02, 0.1, 0.2, 0.5])
def test_with_slip_as_a_state_speed_can_be_controlled(slip, rim_speed):
    # x = [i, v]: torque drives slip, and thrust C*i drives speed.
    c = stiffness(slip, rim_speed)
    a, b = slip_dynamics(WHEEL, MASS, rim_speed, c, slip)
    controllability = control.ctrb(np.array([[a, 0.0], [c / MASS, 0.0]]), np.array([[b], [0.0]]))
    # Columns scaled to one: rank by angle, whatever the units.
    assert np.linalg.matrix_rank(controllability / np.abs(controllability).max(axis=0)) == 2


def test_in_the_papers_form_torque_does_not_reach_speed():
    # (31): x = [v, omega], u = T; tau and z enter v' as uncontrolled inputs.
    friction = 3.0
    state = np.array([[0.0, 0.0], [0.0, -friction / WHEEL.inertia]])
    controllability = control.ctrb(state, np.array([[0.0], [1 / WHEEL.inertia]]))
    assert np.linalg.matrix_rank(controllability) == 1
    assert np.all(controllability[0] == 0.0)


def test_sampled_against_the_scalar_solution():
    # i' = a*i + b*T with T held: exp(a*dt) and b*(exp(a*dt) - 1)/a.
    a_d, b_d = sampled(np.array([[-60.0]]), np.array([[0.01]]), 0.01)
    assert a_d[0, 0] == pytest.approx(np.exp(-0.6))
    assert b_d[0, 0] == pytest.approx(0.01 * (np.exp(-0.6) - 1) / -60)


def test_sampled_against_python_control():
    a = np.array([[-5.0, 2.0], [0.0, -10.0]])
    b = np.array([[0.0], [10.0]])
    expected = control.ss(a, b, np.eye(2), 0).sample(0.01)
    a_d, b_d = sampled(a, b, 0.01)
    assert a_d == pytest.approx(expected.A)
    assert b_d == pytest.approx(expected.B)


@pytest.mark.parametrize(
    ('fault', 'reason'),
    [
        ({'mass': 0.0}, 'mass is out of range: 0.0'),
        ({'rim_speed': 0.0}, 'rim_speed is out of range: 0.0'),
        ({'rim_speed': float('nan')}, 'rim_speed is out of range: nan'),
        ({'slip_stiffness': -1.0}, 'slip_stiffness is out of range: -1.0'),
        ({'slip': 1.0}, 'slip is out of range: 1.0'),
        # When braking, slip is defined otherwise: this model does not hold.
        ({'slip': -0.1}, 'slip is out of range: -0.1'),
    ],
)
def test_out_of_range_is_named(fault, reason):
    point = {'mass': MASS, 'rim_speed': 1.0, 'slip_stiffness': 1e4, 'slip': 0.2, **fault}
    with pytest.raises(ValueError, match=reason):
        slip_dynamics(WHEEL, **point)
