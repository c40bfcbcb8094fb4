"""Loads on the wheels of the tractor against Chrono's recording."""

import numpy as np
import pytest

from traction_model.simulation.drawbar import Drawbar
from traction_model.simulation.simulate import simulate
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import load_vehicle


def test_weight_as_in_chrono(chrono):
    # Over a run, what the soil carries is the weight: 4440 kg*9.81 m/s^2.
    run = chrono('tractor_sandy_loam')
    carried = sum(np.mean(run.columns[f'fz_{name}']) for name in ('fl', 'fr', 'rl', 'rr'))
    assert load_vehicle('tractor_4wd').static_loads().sum() == pytest.approx(carried, rel=0.005)


def test_load_transfer_as_in_chrono(chrono):
    run = chrono('tractor_sandy_loam')
    tractor = load_vehicle('tractor_4wd')
    names = tractor.wheel_names
    torque = run.torque
    simulated = simulate(
        tractor, load_soil('sandy_loam_chrono'), torque, 0.005, drawbar=Drawbar(6000, 1500, 2.0)
    )
    # The last second, as Chrono's contact forces jitter; both wheels of an axle.
    chronos = np.mean([run.columns[f'fz_{name}'][-200:] for name in names], axis=1)
    ours = simulated.load[-200:].mean(axis=0)
    assert ours[:2].sum() == pytest.approx(chronos[:2].sum(), rel=0.02)
    assert ours[2:].sum() == pytest.approx(chronos[2:].sum(), rel=0.02)
    # Rearwards: a fifth of the front's load and more.
    assert ours[:2].sum() < 0.8 * tractor.static_loads()[:2].sum()
