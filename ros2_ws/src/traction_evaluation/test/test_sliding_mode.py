"""Sliding mode: equivalent torque, boundary layer and takeover by hand."""

import math

import pytest

from traction_controller.control.laws.law import WheelState
from traction_evaluation.baselines.sliding_mode import SlidingModeLaw
from traction_model.vehicle.vehicle import load_vehicle

TRACTOR = load_vehicle('tractor_4wd')
REAR = TRACTOR.wheels[3]
LOAD = 10000.0


@pytest.fixture
def law():
    wheel = REAR.model_copy(update={'viscous_friction': 34.0})
    return SlidingModeLaw(
        wheel, LOAD, slip=0.2, lag=0.1, dt=0.01, reach=0.1, boundary_layer=0.05
    )  # fmt: skip


# Thrust of 4000 N at r = 0.85 m, and 34 N·m·s/rad at 1.7 m/s, 2 rad/s: 3400 + 68 N·m.
EQUIVALENT = 3468.0


@pytest.mark.parametrize(
    ('slip', 'torque'),
    [
        (0.2, EQUIVALENT),
        # eta = 0.1*10000*0.85 = 850 N·m; 0.02 of 0.05 is 40 % of it.
        (0.22, EQUIVALENT - 340.0),
        (0.19, EQUIVALENT + 170.0),
        # Beyond the layer, all of it.
        (0.25, EQUIVALENT - 850.0),
        (0.9, EQUIVALENT - 850.0),
        (-0.5, EQUIVALENT + 850.0),
    ],
)
def test_torque_once_taken_over(law, slip, torque):
    state = WheelState(slip, rim_speed=1.7, gross_traction=4000.0)
    for _ in range(1000):
        found = law.torque(state, 0.2, 0.0, 0.01)
    assert found == pytest.approx(torque)
    assert law.gains == (0.0 if abs(slip - 0.2) >= 0.05 else 17000.0, 0.0, 0.0)


def test_another_torque_is_given_up_with_its_time_constant(law):
    state = WheelState(0.2, rim_speed=1.7, gross_traction=4000.0)
    first = law.torque(state, 0.2, 5468.0, 0.0)
    assert first == pytest.approx(5468.0)
    for _ in range(20):
        found = law.torque(state, 0.2, 5468.0, 0.01)
    assert found == pytest.approx(EQUIVALENT + 2000.0 * math.exp(-1.0))
