"""Exponential and power against the mathematical library, in units of what their texts promise."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from traction_model.elementary import exponential, power

UNIT = 1.2e-16


@given(st.floats(-708, 709))
def test_exponential(x):
    assert exponential(x) == pytest.approx(math.exp(x), rel=(3 + abs(x)) * UNIT, abs=0.0)


def test_exponential_at_the_edges():
    assert exponential(0.0) == 1.0
    assert exponential(-1e6) == pytest.approx(math.exp(-708), rel=1e-12)
    assert exponential(-math.inf) == exponential(-708.0)
    assert math.isnan(exponential(math.nan))


@given(st.floats(1e-12, 10.0), st.floats(0.01, 3.0))
def test_power(base, exponent):
    rounding = (3 + 2 * exponent * (1 + abs(math.log(base)))) * UNIT
    assert power(base, exponent) == pytest.approx(base**exponent, rel=rounding, abs=0.0)


@given(st.integers(-300, 300))
def test_power_across_powers_of_two(doublings):
    # Where the mantissa wraps, on both sides of sqrt(1/2) and of 1.
    for mantissa in (0.5, math.nextafter(0.5, 1), math.sqrt(0.5), math.nextafter(1, 0)):
        base = math.ldexp(mantissa, doublings)
        rounding = (3 + 2 * (1 + abs(math.log(base)))) * UNIT
        assert power(base, 1.0) == pytest.approx(base, rel=rounding, abs=0.0)


def test_power_of_nothing_is_next_to_nothing():
    # 1e-300 counts in place of 0: for the smallest exponent that soils have, 0.01, 1e-3.
    assert power(0.0, 1.1) <= 1e-300
    assert power(0.0, 0.1) == pytest.approx(1e-30)
    assert power(1.0, 2.7) == 1.0
