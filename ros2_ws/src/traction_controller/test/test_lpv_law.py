"""LPV law: its steps by hand, and its states of delay on a model that has the delay."""

import control
import numpy as np
import pytest

from traction_controller.control_law import Reading
from traction_controller.lpv_law import LpvLaw
from traction_model.lpv import sampled, slip_dynamics
from traction_model.vehicle import GRAVITY, load_vehicle

TRACTOR = load_vehicle('tractor_4wd')
REAR = TRACTOR.wheels[3]
LOAD = float(TRACTOR.static_loads()[3])


class Table:
    """Gains that are the same everywhere, and what they were asked for."""

    def __init__(self, gains):
        self.gains = tuple(gains)
        self.asked = None

    def at(self, rim_speed, stiffness):
        self.asked = rim_speed, stiffness
        return self.gains


def law(*gains):
    table = Table(gains)
    return LpvLaw(REAR, LOAD, slip=0.2, lag=0.1, dt=0.01, gain_table=table), table


def test_steps_by_hand():
    made, table = law(1000.0, 0.5, 2000.0, 0.2, 0.1)
    told = Reading(slip=0.1, rim_speed=1.5, stiffness=7e4, shaft_torque=400.0)
    # First: the integral of the error of 0.1 only, 2000*0.1*0.01 = 2 N*m.
    assert made.torque(told, 0.2, 500.0, 0.01) == pytest.approx(502.0)
    assert table.asked == (1.5, 7e4)
    # Second: slip +0.02, shaft +40, command of a step ago +10 (510 was sent after 500):
    # 510 - 20 - 20 - 2 + 1.6 = 469.6.
    told.slip, told.shaft_torque = 0.12, 440.0
    assert made.torque(told, 0.2, 510.0, 0.01) == pytest.approx(469.6)
    # Third: nothing else changed; commands -40 a step ago, +10 two steps ago:
    # 470 + 0.2*40 - 0.1*10 + 1.6 = 478.6.
    assert made.torque(told, 0.2, 470.0, 0.01) == pytest.approx(478.6)
    # Fourth: -40 is two steps ago now, +10 forgotten: 470 + 0.1*40 + 1.6 = 475.6.
    assert made.torque(told, 0.2, 470.0, 0.01) == pytest.approx(475.6)
    made.reset()
    assert made.torque(told, 0.2, 470.0, 0.01) == pytest.approx(471.6)
    assert made.gains == (1000.0, 0.5, 2000.0, 0.2, 0.1)


def test_velocity_form_is_the_state_feedback_it_stands_for():
    # Slip, shaft torque, integral of the error, and the commands of two steps ago as states of a
    # loop delayed by two steps; u = -K*x from an independent solver, in positional form.
    lag, dt = 0.1, 0.01
    a, b = slip_dynamics(REAR, LOAD / GRAVITY, 2.0, 4 * LOAD, 0.2)
    inner, input_ = sampled(np.array([[a, b], [0, -1 / lag]]), np.array([[0.0], [1 / lag]]), dt)
    A = np.zeros((5, 5))
    A[:2, :2], A[:2, 4] = inner, input_[:, 0]  # the oldest command acts
    A[2, 2], A[2, 0] = 1.0, -dt
    A[4, 3] = 1.0
    B = np.array([[0.0], [0], [0], [1], [0]])
    size = 0.3 * LOAD * REAR.radius
    gain = control.dlqr(A, B, np.diag([100.0, 0, 400.0, 0, 0]), [[1 / size**2]])[0][0]
    made, _ = law(gain[0], gain[1], -gain[2], gain[3], gain[4])

    x, sent, trajectory = np.zeros(5), 0.0, []
    y = np.zeros(5)
    for k in range(600):
        target = 0.05 if k else 0.0
        told = Reading(slip=x[0], rim_speed=2.0, stiffness=4 * LOAD, shaft_torque=x[1])
        # The velocity form integrates the error of now, so the state counts it as of now.
        sent = made.torque(told, target, sent, dt)
        positional = -gain @ (y + np.array([0, 0, dt * (target - y[0]), 0, 0]))
        x = A @ x + B[:, 0] * sent
        y = A @ y + B[:, 0] * positional + [0, 0, dt * target, 0, 0]
        trajectory.append((sent, positional, x[0]))
    trajectory = np.array(trajectory)
    np.testing.assert_allclose(trajectory[:, 0], trajectory[:, 1], rtol=1e-9, atol=1e-6 * size)
    assert trajectory[-1, 2] == pytest.approx(0.05, abs=1e-3)
