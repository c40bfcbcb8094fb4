"""Chrono's recordings, for all tests of the package."""

from functools import cache
from pathlib import Path

import pytest

from traction_evaluation.verification.chrono import CHRONO_RUNS, read_chrono

BAGS = Path(__file__).resolve().parents[4] / 'bags'


@pytest.fixture(scope='session')
def chrono():
    """Chrono's recording of a run: `chrono('wheel_drawbar').v`, 200 Hz, SI units."""
    return cache(lambda name: read_chrono(BAGS / name / f'{name}.csv.xz', CHRONO_RUNS[name]))
