"""Chrono's recordings, for all tests of the package."""

from functools import cache
from pathlib import Path

import make_bags
import pytest

BAGS = Path(__file__).resolve().parents[4] / 'bags'


@pytest.fixture(scope='session')
def chrono():
    """Columns of a Chrono run by name: `chrono('wheel_drawbar')['v']`, 200 Hz, SI units."""
    return cache(lambda name: make_bags.read_csv(BAGS / name / f'{name}.csv.xz'))
