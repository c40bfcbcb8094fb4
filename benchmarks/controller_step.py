"""Time and memory of one step of slip control for four wheels, by every law.

``.venv/bin/python -m pytest -s benchmarks/controller_step.py`` runs it; with ``--benchmark-only``
only the times. A step has 100 us on one core, and a million of them must leave nothing behind.
"""

import gc
import itertools
import sys
from pathlib import Path

import numpy as np
import pytest
from ament_index_python.packages import get_package_share_directory

from traction_controller.control.driveline import Differential, Grouping
from traction_controller.control.laws.registry import LAWS
from traction_controller.control.slip_control import SlipControl
from traction_controller.control.slip_state import SlipState
from traction_controller.synthesis.gain_table import read_gain_table
from traction_model.simulation.drawbar import Drawbar
from traction_model.simulation.plant import Plant
from traction_model.soil.soil import load_soil
from traction_model.soil.terrain import Terrain
from traction_model.vehicle.vehicle import load_vehicle

BUDGET = 100e-6
"""Longest time of a step, s."""

STEPS = 1_000_000

TRACTOR = load_vehicle('tractor_4wd')
LOADS = [float(load) for load in TRACTOR.static_loads()]
SHARE = Path(get_package_share_directory('traction_controller'))
TABLES = read_gain_table(SHARE / 'config' / 'gains' / 'tractor_4wd.yaml', TRACTOR, 0.01)


def controller(law, grouping=Grouping.WHEEL, differential=Differential.OPEN):
    return SlipControl(
        TRACTOR, 0.2, law=law, settings={'lpv': {'gain_table': TABLES}}, grouping=grouping,
        differential=differential, torque_rate=[15000.0, 15000.0, 40000.0, 40000.0],
    )  # fmt: skip


@pytest.fixture(scope='session')
def drive():
    """Inputs of a controller over 10 s at 100 Hz, with the edge of a soft patch."""
    terrain = Terrain([load_soil('sandy_loam_chrono'), load_soil('soft_patch_chrono')], [8.0])
    plant = Plant(
        TRACTOR, terrain, drawbar=Drawbar(13000, 1500, 2.0), torque_time_constant=0.1,
        max_power=75e3,
    )  # fmt: skip
    control = controller('lqi')
    request = np.array([2400.0, 2400.0, 9000.0, 9000.0])
    told = []
    for _ in range(1000):
        told.append(
            (
                0.01,
                SlipState(
                    plant.slip, plant.slip_valid, plant.rim_speed.tolist(), plant.v,
                    [4 * load for load in LOADS],
                ),
                plant.shaft_torque.tolist(),
                (request * min(1.0, plant.t / 3.0)).tolist(),
            )
        )  # fmt: skip
        plant.step([outcome.torque for outcome in control.step(*told[-1])], 0.01)
    return told


@pytest.mark.parametrize('grouping', list(Grouping))
@pytest.mark.parametrize('law', LAWS)
def test_time_of_a_step(benchmark, drive, law, grouping):
    control = controller(law, grouping, Differential.LOCKED)

    told = itertools.cycle(drive)
    benchmark.pedantic(
        control.step, setup=lambda: (next(told), {}), rounds=5000, warmup_rounds=1000
    )  # fmt: skip
    assert benchmark.stats.stats.median <= BUDGET


@pytest.mark.parametrize('law', LAWS)
def test_no_allocation_growth(drive, law):
    control = controller(law)
    for told in drive:
        control.step(*told)
    # Without the collector, cycles would count too.
    gc.collect()
    gc.disable()
    try:
        blocks = []
        for _ in range(2):
            for _ in range(STEPS // 2 // len(drive)):
                for told in drive:
                    control.step(*told)
            blocks.append(sys.getallocatedblocks())
    finally:
        gc.enable()
    print(f'\n{law}: {blocks[1] - blocks[0]} blocks more after the second half million steps')
    # Whatever the interpreter itself keeps for later.
    assert blocks[1] - blocks[0] < 20
