"""PI law: the tuning rules against numbers by hand, and the closed loop they promise."""

import pytest

from traction_controller.control.laws.law import WheelState
from traction_controller.control.laws.pi import PiLaw, simc_gains
from traction_model.lpv.slip_dynamics import slip_dynamics
from traction_model.vehicle.vehicle import GRAVITY, load_vehicle

TRACTOR = load_vehicle('tractor_4wd')
REAR = TRACTOR.wheels[3]
LOAD = float(TRACTOR.static_loads()[3])


def test_rules_where_slip_is_the_quicker_lag():
    # Lags 0.1 s and 1/20 s, gain K = 0.01/20 = 5e-4 per N·m, delay 0.03 s. Half rule:
    # tau = 0.1 + 0.025 = 0.125 s, theta = 0.03 + 0.025 = 0.055 s; tau_c + theta = 0.205 s.
    # k_p = 0.125/(5e-4*0.205) = 1219.5 N·m; k_i = k_p/min(0.125, 0.82) = 9756 N·m/s.
    proportional, integral = simc_gains(-20.0, 0.01, 0.1, 0.03, 0.15)
    assert proportional == pytest.approx(1219.51, rel=1e-5)
    assert integral == pytest.approx(9756.1, rel=1e-5)


def test_rules_where_slip_is_the_slower_lag():
    # Lags 1/0.5 = 2 s and 0.1 s, K = 0.01/0.5 = 0.02. tau = 2.05 s, theta = 0.08 s,
    # tau_c + theta = 0.23 s: k_p = 2.05/(0.02*0.23) = 445.65; the integral time is
    # min(2.05, 0.92) = 0.92 s: k_i = 484.40.
    proportional, integral = simc_gains(-0.5, 0.01, 0.1, 0.03, 0.15)
    assert proportional == pytest.approx(445.652, rel=1e-5)
    assert integral == pytest.approx(484.405, rel=1e-5)


def test_rules_where_slip_integrates():
    # No stiffness left: a = 0. k_p = 1/(b*(tau_c + theta)) = 1/(0.01*0.23) = 434.78,
    # k_i = k_p/(4*0.23).
    proportional, integral = simc_gains(0.0, 0.01, 0.1, 0.03, 0.15)
    assert proportional == pytest.approx(434.783, rel=1e-5)
    assert integral == pytest.approx(434.783 / 0.92, rel=1e-5)


def test_rules_have_no_step_where_the_lags_change_places():
    below, above = (simc_gains(-10.0 * f, 0.01, 0.1, 0.03, 0.15) for f in (1 - 1e-9, 1 + 1e-9))
    assert below == pytest.approx(above, rel=1e-6)


def test_fixed_gains_are_those_of_the_rules_at_one_point():
    law = PiLaw(REAR, LOAD, slip=0.2, lag=0.1, dt=0.01, rim_speed=1.5, stiffness=2.0)
    model = slip_dynamics(REAR, LOAD / GRAVITY, 1.5, 2 * LOAD, 0.2)
    proportional, integral = simc_gains(*model, 0.1, 0.03, 0.15)
    assert law.gains == (proportional, 0.0, integral)
    for rim in (0.5, 8.0):
        law.torque(WheelState(0.1, rim, stiffness=9 * LOAD), 0.2, 0.0, 0.01)
        assert law.gains == (proportional, 0.0, integral)


def test_given_gains_count_per_load_and_radius():
    law = PiLaw(REAR, LOAD, slip=0.2, lag=0.1, dt=0.01, proportional=0.5, integral=3.0)
    size = LOAD * 0.85
    assert law.gains == pytest.approx((0.5 * size, 0.0, 3.0 * size))
    # First step: 3*size*0.1*0.01 for the error of 0.1; second: and 0.5*size for slip 0.02 less.
    first = law.torque(WheelState(slip=0.1), 0.2, 1000.0, 0.01)
    assert first == pytest.approx(1000.0 + 0.003 * size)
    second = law.torque(WheelState(slip=0.08), 0.2, first, 0.01)
    assert second == pytest.approx(first + 0.0036 * size + 0.01 * size)
