"""Distributions: their moments by formula, their limits, what they refuse."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from traction_model.definition import DefinitionError, build
from traction_model.distribution import Distribution

INFINITE = (-math.inf, math.inf)
# Midpoints of 10,000 equal parts of the unit interval: sums over them are midpoint-rule integrals.
SHARES = (np.arange(10_000) + 0.5) / 10_000


def distribution(**content):
    return build(Distribution, content, 'x')


def test_relative_is_uniform_about_the_nominal_value():
    values = distribution(relative=0.5).values(SHARES, 1000.0, *INFINITE)
    assert values.min() >= 500.0
    assert values.max() <= 1500.0
    # Uniform over a width of 1000: mean 1000, deviation 1000/sqrt(12).
    assert values.mean() == pytest.approx(1000.0)
    assert values.std() == pytest.approx(1000.0 / math.sqrt(12.0), rel=1e-6)


def test_relative_follows_a_nominal_value_for_each_draw():
    values = distribution(relative=0.1).values(np.array([0.5, 0.5, 0.0]), [1.0, 5.0, 5.0], 0, 9)
    assert values == pytest.approx([1.0, 5.0, 4.5])


def test_log_uniform_has_the_logarithmic_mean():
    values = distribution(log_uniform=[1e4, 1e6]).values(SHARES, 0.0, *INFINITE)
    assert np.median(values) == pytest.approx(1e5, rel=1e-3)
    # Mean of a log-uniform: (b - a)/ln(b/a).
    assert values.mean() == pytest.approx((1e6 - 1e4) / math.log(100.0), rel=1e-6)


def test_normal_far_from_its_limits_is_normal():
    values = distribution(normal={'relative_deviation': 0.1}).values(SHARES, 3600.0, 0, math.inf)
    assert values == pytest.approx(norm(3600.0, 360.0).ppf(SHARES))


def test_normal_is_cut_off_where_values_are_not_valid():
    values = distribution(normal={'deviation': 1000.0}).values(SHARES, 1000.0, 0.0, math.inf)
    assert values.min() >= 0.0
    # Cut at one deviation below the mean: mean + deviation·pdf(1)/cdf(1).
    expected = 1000.0 + 1000.0 * norm.pdf(1.0) / norm.cdf(1.0)
    assert values.mean() == pytest.approx(expected, rel=1e-4)


def test_normal_keeps_to_its_own_limits():
    cut = distribution(normal={'mean': 5.0, 'deviation': 2.0, 'min': 4.0, 'max': 6.0})
    values = cut.values(SHARES, 0.0, *INFINITE)
    assert 4.0 <= values.min() < 4.001
    assert 5.999 < values.max() <= 6.0


def test_choice_takes_all_alike():
    values = distribution(choice=[1, 2, 4, 8]).values(SHARES, 0.0, *INFINITE)
    assert [np.sum(values == value) for value in (1, 2, 4, 8)] == [2500] * 4
    names = distribution(choice=['a', 'b']).values(np.array([0.0, 0.49, 0.5]), 0.0, *INFINITE)
    assert names.tolist() == ['a', 'a', 'b']


@given(
    st.sampled_from(
        [
            {'relative': 0.9},
            {'uniform': [2.0, 3.0]},
            {'log_uniform': [2.0, 900.0]},
            {'normal': {'deviation': 400.0}},
            {'normal': {'relative_deviation': 0.3, 'min': 90.0, 'max': 110.0}},
            {'choice': [1, 50, 1000]},
        ]
    ),
    st.floats(0.0, 1.0, exclude_max=True),
)
def test_every_value_lies_in_the_support(content, share):
    drawn = distribution(**content)
    low, high = drawn.support(100.0, 0.0, 1000.0)
    [value] = drawn.values(np.array([share]), 100.0, 0.0, 1000.0)
    assert 0.0 <= low * (1 - 1e-12) <= value <= high * (1 + 1e-12) <= 1000.0 * (1 + 1e-12)


def test_a_share_of_zero_is_finite_without_a_limit():
    values = distribution(normal={'deviation': 2.0}).values(np.zeros(1), 10.0, *INFINITE)
    # Nine deviations: never seen otherwise.
    assert values == [10.0 - 18.0]


@pytest.mark.parametrize(
    ('content', 'message'),
    [
        ({}, 'x: give exactly one of relative, uniform, log_uniform, normal, choice'),
        ({'relative': 0.1, 'choice': [1]}, 'got relative and choice'),
        ({'relativ': 0.1}, "relativ: unknown key; did you mean 'relative'"),
        ({'relative': -0.1}, 'relative: Input should be greater than 0'),
        ({'uniform': [2, 1]}, 'uniform: the lower end must be below the upper'),
        ({'log_uniform': [0, 1]}, 'log_uniform: both ends must be above 0'),
        ({'normal': {'mean': 1}}, 'give either deviation or relative_deviation'),
        ({'normal': {'deviaton': 1}}, "normal.deviaton: unknown key; did you mean 'deviation'"),
        ({'uniform': [0, float('nan')]}, r'uniform.1: Input should be a finite number'),
        ({'choice': []}, 'choice: List should have at least 1 item'),
    ],
)
def test_what_makes_no_sense_is_refused(content, message):
    with pytest.raises(DefinitionError, match=message):
        distribution(**content)


@pytest.mark.parametrize(
    ('content', 'nominal', 'message'),
    [
        ({'uniform': [-1, 2]}, 1.0, 'values from -1 to 2 are not within 0 to 10'),
        ({'relative': 0.5}, 8.0, 'values from 4 to 12 are not within 0 to 10'),
        ({'relative': 0.5}, 0.0, 'the nominal value is 0; give uniform'),
        ({'choice': [1, 11]}, 1.0, 'values from 1 to 11 are not within 0 to 10'),
        ({'choice': ['sand']}, 1.0, r"choice: expected numbers, got \['sand'\]"),
        ({'normal': {'mean': -1, 'deviation': 1}}, 1.0, 'mean -1 is not within 0 to 10'),
        ({'normal': {'relative_deviation': 1}}, 0.0, 'the mean is 0; give deviation'),
    ],
)
def test_values_that_are_not_valid_are_refused(content, nominal, message):
    with pytest.raises(ValueError, match=message):
        distribution(**content).support(nominal, 0.0, 10.0)
