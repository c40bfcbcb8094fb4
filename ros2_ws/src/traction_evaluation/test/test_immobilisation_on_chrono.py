"""Warning of immobilisation on Chrono's runs, which have no immobilisation."""

import math

import numpy as np
import pytest

from traction_controller.estimation.immobilisation import Immobilisation, Level
from traction_controller.estimation.slip_filter import SlipFilter
from traction_evaluation.verification.chrono import CHRONO_RUNS
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import GRAVITY

# Standing for 1.5 s under torque counts as stuck: tractor_steps_slow pulls away after 2.4 s.
MOVING = sorted(set(CHRONO_RUNS) - {'tractor_steps_slow'})


@pytest.mark.parametrize('estimated', [False, True], ids=['true-speed', 'estimated-speed'])
@pytest.mark.parametrize('name', MOVING)
def test_silent_on_recorded_runs(name, estimated, chrono):
    """No warning in Chrono's runs, from standstill through soft patches to 56 m/s."""
    recording = chrono(name)
    vehicle = recording.vehicle
    warning = Immobilisation([w.radius for w in vehicle.wheels], vehicle.mass * GRAVITY)
    estimation = SlipFilter(vehicle, load_soil(CHRONO_RUNS[name].soils[0]))
    random = np.random.default_rng(sorted(CHRONO_RUNS).index(name))
    for k in range(0, len(recording.t), 2):
        t, omega, torque = recording.t[k], recording.omega[k], recording.torque[k]
        v, sinkage = recording.v[k], recording.sinkage[k]
        if estimated:
            estimation.wheel_states(t, omega, torque)
            if k % 20 == 0:
                estimation.radar(t, v + 0.05 * random.standard_normal(), 0.05**2)
            v, sinkage = estimation.v, math.nan
        assert warning.step(t, v, omega, torque, sinkage=sinkage) is Level.NONE, t
