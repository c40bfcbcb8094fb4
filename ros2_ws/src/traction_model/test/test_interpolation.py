"""Interpolation in tables: functions that it reproduces, ends, and errors."""

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from traction_model.interpolation import GridTable

AXES = ([0.0, 1.0, 3.0], [-1.0, 2.0], [0.5, 0.6, 0.9, 2.0])


def test_a_multilinear_function_is_met_everywhere():
    # f = (1 + 2x)*(3 - y)*z is linear along every axis.
    x, y, z = np.meshgrid(*AXES, indexing='ij')
    table = GridTable(AXES, (1 + 2 * x) * (3 - y) * z)
    for a, b, c in np.random.default_rng(1).uniform([0, -1, 0.5], [3, 2, 2], (50, 3)):
        assert float(table.at(a, b, c)) == pytest.approx((1 + 2 * a) * (3 - b) * c, rel=1e-12)


def test_as_scipy_interpolates_matrices():
    random = np.random.default_rng(2)
    values = random.normal(size=(3, 2, 4, 2, 5))
    peer = RegularGridInterpolator(AXES, values)
    table = GridTable(AXES, values)
    for place in random.uniform([0, -1, 0.5], [3, 2, 2], (50, 3)):
        assert table.at(*place) == pytest.approx(peer(place)[0], rel=1e-12, abs=1e-14)


def test_beyond_the_grid_its_edge_counts():
    table = GridTable(([0.0, 1.0], [0.0, 1.0]), [[0.0, 1.0], [2.0, 3.0]])
    assert float(table.at(-5.0, 0.5)) == 0.5
    assert float(table.at(9.0, 9.0)) == 3.0


def test_errors_name_what_is_wrong():
    with pytest.raises(ValueError, match=r'axis 1 must be at least 2 increasing numbers'):
        GridTable(([0, 1], [1, 0]), np.zeros((2, 2)))
    with pytest.raises(ValueError, match=r'values must have shape \(2, 2\)'):
        GridTable(([0, 1], [0, 1]), np.zeros((2, 3)))
    with pytest.raises(ValueError, match='place must be 2 numbers, got 1'):
        GridTable(([0, 1], [0, 1]), np.zeros((2, 2))).at(0.0)
