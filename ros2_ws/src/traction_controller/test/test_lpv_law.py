"""LPV law: its steps by hand, and its loop against the loop it is proved for."""

import numpy as np
import pytest

from traction_controller.control.laws.law import WheelState
from traction_controller.control.laws.lpv import LpvLaw
from traction_controller.synthesis.slip_loop import (
    ERROR,
    FIRST_COMMAND,
    TORQUE,
    slip_loop,
    slip_pole,
    torque_scale,
)
from traction_model.vehicle.vehicle import load_vehicle

TRACTOR = load_vehicle('tractor_4wd')
REAR = TRACTOR.wheels[3]
LOAD = float(TRACTOR.static_loads()[3])


class Table:
    """Constant gains that record the operating points of their calls."""

    def __init__(self, gains):
        self.gains = tuple(gains)
        self.asked = None

    def at(self, rim_speed, stiffness):
        self.asked = rim_speed, stiffness
        return self.gains


def law(*gains, **settings):
    table = Table(gains)
    made = LpvLaw(REAR, LOAD, slip=0.2, lag=0.1, dt=0.01, gain_table=table, **settings)
    return made, table


def test_steps_by_hand():
    # r 0.85 m, no friction: the soil's moment is 0.85*1000 = 850 N·m; no acceleration.
    made, table = law(1000.0, 0.5, 0.2, 0.1)
    state = WheelState(
        slip=0.1,
        rim_speed=1.7,
        speed=1.53,
        stiffness=7e4,
        gross_traction=1000.0,
        shaft_torque=900.0,
    )
    # Wanted: 850 + 1000*0.1 - 0.5*50 - 0.2*(950 - 850) = 905; taken over from 950.
    assert made.torque(state, 0.2, 950.0, 1e-9) == pytest.approx(950.0, abs=1e-3)
    assert table.asked == (1.7, 7e4)
    assert made.gains == (1000.0, 0.5, 0.0, 0.2, 0.1)
    # The difference of 45 N·m is gone after many of its time constants of 0.1 s. Commands 930
    # and 950: 925 - 0.2*80 - 0.1*100 = 899.
    assert made.torque(state, 0.2, 930.0, 10.0) == pytest.approx(899.0, abs=1e-3)


def test_acceleration_takes_its_own_torque():
    made, _ = law(0.0, 0.0, acceleration_time=1e-6, takeover_time=1e-6)
    state = WheelState(rim_speed=1.7, speed=1.0)
    made.torque(state, 0.2, 0.0, 0.01)
    # From 1.0 to 1.01 m/s in 0.01 s: 1 m/s^2. J*omega*v'/v = 60*2/1.01 N·m.
    state.speed = 1.01
    found = made.torque(state, 0.2, 0.0, 0.01)
    assert found == pytest.approx(60.0 * (1.7 / 0.85) / 1.01, rel=1e-3)


def test_law_and_loop_are_the_same():
    """Wheel on soil of linear thrust, driven by the law; the loop that is proved, by its matrices.

    Slip that is small: 1 - i changes little, and the loop is linear.
    """
    rim, stiffness, slip, lag = 1.7, 4 * LOAD, 0.15, 0.2
    scale, pole = torque_scale(REAR, rim, slip), slip_pole(REAR, rim, stiffness, slip)
    gains = (5.0 * (1 + 0.27 * pole), 0.9, 0.05, 0.04)
    loop = slip_loop(pole, lag, 0.01, 2, 2, 0.05)
    feedback = np.zeros(5)
    feedback[[ERROR, TORQUE, FIRST_COMMAND, FIRST_COMMAND + 1]] = -np.array(gains)
    made, _ = law(gains[0] * scale, *gains[1:], takeover_time=1e-9)

    x = np.array([-0.01, 0.0, 0.0, 0.0, 0.0])
    # All torques less a measured moment that stands still in these coordinates.
    sent = 5000.0
    for _ in range(100):
        state = WheelState(
            slip=0.15 + x[ERROR], rim_speed=rim, speed=rim * (1 - slip), stiffness=stiffness,
            gross_traction=5000.0 / REAR.radius, shaft_torque=5000.0 + x[TORQUE] * scale,
        )  # fmt: skip
        made._sent = [5000.0 + c * scale for c in x[FIRST_COMMAND + 1 :]]
        sent = made.torque(state, 0.15, 5000.0 + x[FIRST_COMMAND] * scale, 0.01)
        u = float(feedback @ x)
        assert sent - 5000.0 == pytest.approx(u * scale, rel=1e-9, abs=1e-6)
        x = loop.A @ x + loop.B * u
    assert abs(x[ERROR]) < 1e-3
