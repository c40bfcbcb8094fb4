"""Set-point: against the optimum that the contact form gives, its bounds and its pace."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from traction_controller.control.set_point import SetPoint
from traction_controller.estimation.slip_filter import SlipFilter
from traction_model.contact.tractive import greatest_pull_slip, optimum_slip, tractive_figures
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import load_vehicle

TRACTOR = load_vehicle('tractor_4wd')
LOAM = load_soil('sandy_loam_chrono')
K = LOAM.shear_deformation_modulus
# Strength of the nominal soil as defined in the estimator.
NOMINAL = SlipFilter(TRACTOR, LOAM).max_shear_stress
ALL = [True] * 4
# Widest bounds, so that goals differ.
SEEKER = SetPoint(TRACTOR, LOAM, low=0.01, high=0.6)


def goal(strength=1.0, modulus=1.0, weight=0.0, valid=ALL):
    SEEKER.reset()
    SEEKER.set_weight(weight)
    SEEKER.update(1.0, 0.2, (NOMINAL * strength).tolist(), valid, [K * modulus] * 4)
    return SEEKER.goal


@pytest.mark.parametrize('strength', [0.35, 1.0, 2.7])
@pytest.mark.parametrize('modulus', [0.4, 1.0, 2.5])
def test_best_efficiency_is_that_of_the_contact_form(strength, modulus):
    expected = optimum_slip(LOAM.sheared(strength, modulus), TRACTOR)
    assert goal(strength, modulus) == pytest.approx(expected, abs=0.003)


def test_most_pull_is_that_of_the_contact_form():
    # Net traction still rises with slip at the upper bound.
    assert greatest_pull_slip(LOAM, TRACTOR) > 0.6
    assert goal(weight=1.0) == pytest.approx(0.6)


@pytest.mark.parametrize('weight', [0.2, 0.5])
def test_weight_is_between(weight):
    # J by the contact form on a fine grid of slips.
    slips = np.linspace(0.01, 0.6, 1181)
    figures = tractive_figures(LOAM, TRACTOR, slips)
    efficiency, pull = figures.tractive_efficiency, figures.net_traction
    worth = (1 - weight) * efficiency / efficiency.max() + weight * pull / pull.max()
    assert goal(weight=weight) == pytest.approx(slips[np.argmax(worth)], abs=0.005)


def test_every_wheel_has_its_soil():
    # Firm left and soft right track: a goal between those of both.
    strong, weak = goal(2.0), goal(0.5)
    SEEKER.reset()
    SEEKER.update(1.0, 0.2, (NOMINAL * [2.0, 0.5, 2.0, 0.5]).tolist(), ALL)
    assert strong + 0.003 < SEEKER.goal < weak - 0.003


def test_only_what_is_known_counts():
    # The estimates of the right wheels are wrong and marked as invalid.
    stresses = (NOMINAL * [2.0, 0.1, 2.0, 0.1]).tolist()
    SEEKER.reset()
    SEEKER.set_weight(0.0)
    SEEKER.update(1.0, 0.2, stresses, [True, False, True, False])
    known = SEEKER.goal
    assert known == pytest.approx(goal(2.0), abs=1e-9)
    SEEKER.reset()
    assert SEEKER.update(1.0, 0.2, stresses, [False] * 4) is None
    assert SEEKER.goal is None


def test_unknown_modulus_is_the_nominal_one():
    SEEKER.reset()
    SEEKER.set_weight(0.0)
    SEEKER.update(1.0, 0.2, NOMINAL.tolist(), ALL, [math.nan] * 4)
    assert SEEKER.goal == goal(1.0)


def test_pace():
    seeker = SetPoint(TRACTOR, LOAM, rate=0.01, time_constant=2.0)
    stresses = NOMINAL.tolist()
    assert seeker.update(0.0, 0.25, stresses, ALL) == 0.25
    # From 0.25 to about 0.14: at first the rate bounds it, 0.01 in a second.
    assert seeker.update(1.0, 0.25, stresses, ALL) == pytest.approx(0.24)
    # Near the goal the lag dominates: the difference falls by exp(-1/2) in a second.
    for _ in range(20):
        seeker.update(1.0, 0.25, stresses, ALL)
    left = seeker.target - seeker.goal
    assert 0.0 < left < 0.01
    seeker.update(1.0, 0.25, stresses, ALL)
    assert seeker.target - seeker.goal == pytest.approx(left * math.exp(-0.5))


@given(
    st.lists(
        st.tuples(
            st.lists(st.floats(1.0, 1e6), min_size=4, max_size=4),
            st.lists(st.floats(1e-4, 1.0), min_size=4, max_size=4),
            st.floats(0, 5),
        ),
        min_size=1, max_size=10,
    ),
    st.floats(0, 1), st.floats(0.01, 0.9),
)  # fmt: skip
@settings(deadline=None, max_examples=50)
def test_always_bounded_and_slow(estimates, weight, present):
    seeker = SEEKER
    seeker.reset()
    seeker.set_weight(weight)
    last = None
    for stresses, moduli, dt in estimates:
        target = seeker.update(dt, present, stresses, ALL, moduli)
        assert target is None or seeker.low <= target <= seeker.high
        if last is not None:
            assert abs(target - last) <= seeker.rate * dt + 1e-12
        last = target


@pytest.mark.parametrize(
    ('arguments', 'reason'),
    [
        ({'weight': 1.5}, 'weight must be 0 .* to 1 .*, got 1.5'),
        ({'low': 0.3, 'high': 0.2}, 'bounds of the target must be 0.01 to 0.6, got 0.3 to 0.2'),
        ({'rate': 0.0}, 'rate must be above 0, got 0.0'),
        ({'time_constant': math.nan}, 'time_constant must be above 0, got nan'),
    ],
)
def test_refused(arguments, reason):
    with pytest.raises(ValueError, match=reason):
        SetPoint(TRACTOR, LOAM, **arguments)
