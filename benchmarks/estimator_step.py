"""Time and memory of one step of the slip estimator for four wheels.

``python -m pytest benchmarks/estimator_step.py --benchmark-only`` prints the times; without the
option memory is measured, too: a million steps, some minutes a method.
"""

import itertools
import sys
from pathlib import Path

import numpy as np
import pytest

from traction_controller.estimation.slip_filter import SlipFilter
from traction_evaluation.verification.chrono import CHRONO_RUNS, read_chrono
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import load_vehicle

LONGEST_STEP = 300e-6
"""What a step of wheel_states and radar may take at the median, s."""

STEPS = 1_000_000
"""Steps that may not take more and more memory."""

MAX_GROWTH = 2_000_000
"""Growth of the process over `STEPS`, bytes: below two a step."""

METHODS = ['ekf', 'ukf', 'scheduled_gain']


def steps(method):
    """Endless steps of the tractor of bags/tractor_sandy_loam, to and fro in its last 5 s."""
    name = 'tractor_sandy_loam'
    path = Path(__file__).parents[1] / 'bags' / name / f'{name}.csv.xz'
    recording = read_chrono(path, CHRONO_RUNS[name])
    last = slice(-1000, None, 2)
    omega, torque, v = recording.omega[last], recording.torque[last], recording.v[last]
    order = np.r_[0 : len(v), len(v) - 1 : -1 : -1]
    estimation = SlipFilter(
        load_vehicle('tractor_4wd'), load_soil('sandy_loam_chrono'), method=method
    )
    for k in itertools.count():
        i = order[k % len(order)]
        estimation.wheel_states(0.01 * k, omega[i], torque[i])
        estimation.radar(0.01 * k, v[i], 0.0025)
        yield estimation


def resident():
    """Memory of this process that is in use, bytes."""
    pages = int(Path('/proc/self/statm').read_text().split()[1])
    return pages * 4096


@pytest.mark.parametrize('method', METHODS)
def test_step(benchmark, method):
    step = steps(method)
    for _ in range(500):
        next(step)
    benchmark.pedantic(next, (step,), rounds=5000)
    assert benchmark.stats.stats.median < LONGEST_STEP


@pytest.mark.parametrize('method', METHODS)
def test_memory(method):
    step = steps(method)
    for _ in range(1000):
        estimation = next(step)
    blocks, before = sys.getallocatedblocks(), resident()
    for _ in range(STEPS):
        next(step)
    print(f'{method}: {sys.getallocatedblocks() - blocks} blocks, {resident() - before} bytes')
    assert sys.getallocatedblocks() - blocks < 1000
    assert resident() - before < MAX_GROWTH
    assert np.isfinite(estimation.slip).all()
