"""LQI law: one step by hand, with the gains of the schedule."""

import pytest

from traction_controller.control.laws.law import WheelState
from traction_controller.control.laws.lqi import LqiLaw
from traction_model.vehicle.vehicle import load_vehicle

TRACTOR = load_vehicle('tractor_4wd')
LOADS = [float(load) for load in TRACTOR.static_loads()]


def test_two_steps_by_hand():
    law = LqiLaw(TRACTOR.wheels[3], LOADS[3], slip=0.2, lag=0.1, dt=0.01)
    slip_gain, torque_gain, integral_gain = law.schedule.at(2.0, 5e4)
    state = WheelState(slip=0.25, rim_speed=2.0, stiffness=5e4, shaft_torque=2800.0)
    sent = law.torque(state, 0.2, 3000.0, 0.01)
    assert sent == pytest.approx(3000.0 - 0.05 * 0.01 * integral_gain)
    state.slip, state.shaft_torque = 0.27, 2900.0
    second = law.torque(state, 0.2, sent, 0.01)
    change = -0.02 * slip_gain - 100.0 * torque_gain - 0.07 * 0.01 * integral_gain
    assert second == pytest.approx(sent + change)
    assert law.gains == (slip_gain, torque_gain, integral_gain)
    law.reset()
    again = law.torque(state, 0.2, sent, 0.01)
    assert again == pytest.approx(sent - 0.07 * 0.01 * integral_gain)


def test_like_wheels_share_a_schedule():
    laws = [
        LqiLaw(wheel, load, slip=0.2, lag=0.1, dt=0.01)
        for wheel, load in zip(TRACTOR.wheels, LOADS, strict=True)
    ]
    assert laws[0].schedule is laws[1].schedule
    assert laws[2].schedule is laws[3].schedule
    assert laws[0].schedule is not laws[2].schedule
