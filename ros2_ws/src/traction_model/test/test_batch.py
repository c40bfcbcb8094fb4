"""Many runs at once are the runs one by one, on the processor and on a (simulated) GPU."""

import json
import math
import os
import subprocess
import sys

import numpy as np
import pytest

from traction_model import Drawbar, Form, Terrain, load_soil, load_vehicle, simulate
from traction_model.simulation.batch import simulate_batch
from traction_model.simulation.gpu import NoGpuError, missing

RIG = load_vehicle('single_wheel_rig')
TRACTOR = load_vehicle('tractor_4wd')
LOAM = load_soil('sandy_loam_chrono')
SOFT = load_soil('soft_patch_chrono')
DT = 0.005

FIELDS = (
    'v', 'x', 'omega', 'slip', 'sinkage', 'load', 'thrust', 'motion_resistance', 'soil_moment',
)  # fmt: skip


def torques(n, samples=81):
    """A different torque on every wheel, none constant."""
    t = DT * np.arange(samples)
    return np.column_stack([1000 + 300 * j + 200 * np.sin(5 * t + j) for j in range(n)])


@pytest.mark.parametrize('sinkage', ['dynamic', 'equilibrium'])
@pytest.mark.parametrize('form', [Form.PAPER, Form.BEKKER_WONG, Form.CONTACT])
def test_each_run_is_that_of_simulate(form, sinkage):
    # Terrains of different lengths, on each of which the vehicle meets what it should.
    vehicles = [TRACTOR, TRACTOR.model_copy(update={'chassis_mass': 3000.0}), TRACTOR]
    terrains = [LOAM, Terrain([LOAM, SOFT], [0.5], [0.0, 0.1]), Terrain(SOFT)]
    drawbars = [Drawbar(3000), Drawbar(5000, 1000, 0.2), Drawbar()]
    torque = np.array([torques(4), 1.1 * torques(4), 0.7 * torques(4)])
    speeds = [0.5, 1.0, 2.0]
    batch = simulate_batch(
        vehicles, terrains, torque, DT, form=form, sinkage=sinkage, drawbars=drawbars, v0=speeds
    )
    for b in range(3):
        run = simulate(
            vehicles[b], terrains[b], torque[b], DT, form=form, sinkage=sinkage,
            drawbar=drawbars[b], v0=speeds[b],
        )  # fmt: skip
        assert batch.t == pytest.approx(run.t)
        for field in FIELDS:
            np.testing.assert_allclose(
                getattr(batch, field)[b], getattr(run, field), rtol=1e-9, atol=1e-12, err_msg=field
            )


def test_what_is_given_once_counts_for_all_and_every_nth_sample_is_kept():
    soils = [LOAM, SOFT]
    batch = simulate_batch(RIG, soils, torques(1), DT, v0=1.0, every=8)
    assert batch.v.shape == (2, 11)
    assert batch.thrust.shape == (2, 11, 1)
    for b, soil in enumerate(soils):
        run = simulate(RIG, soil, torques(1), DT, v0=1.0)
        assert batch.t == pytest.approx(run.t[::8])
        assert batch.sinkage[b] == pytest.approx(run.sinkage[::8], rel=1e-9)
        assert batch.soil_moment[b] == pytest.approx(run.soil_moment[::8], rel=1e-9)


ON_GPU = """
import json
import numpy as np
from traction_model import Drawbar, Form, load_soil, load_vehicle
from traction_model.simulation.batch import simulate_batch
torque = np.tile([1500.0, 1500.0, 5000.0, 5000.0], (9, 1))
drawbars = [Drawbar(1000.0 * k) for k in range(3)]
print(json.dumps([
    simulate_batch(load_vehicle('tractor_4wd'), load_soil('sandy_loam_chrono'), torque, 0.005,
                   form=form, sinkage=sinkage, drawbars=drawbars, v0=1.0, device=DEVICE
                   ).omega.tolist()
    for form, sinkage in ((Form.BEKKER_WONG, 'dynamic'), (Form.CONTACT, 'dynamic'),
                          (Form.BEKKER_WONG, 'equilibrium'))
]))
"""


def told(device, **environment):
    done = subprocess.run(
        [sys.executable, '-c', ON_GPU.replace('DEVICE', repr(device))],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_gpu_kernel_gives_the_same_in_the_cuda_simulator():
    # The simulator runs the functions as Python, one thread per run.
    simulated = told('gpu', NUMBA_ENABLE_CUDASIM='1', NUMBA_DISABLE_JIT='1')
    np.testing.assert_allclose(simulated, told('cpu'), rtol=1e-9)


@pytest.mark.skipif(bool(missing()), reason=missing())
@pytest.mark.parametrize('form', [Form.BEKKER_WONG, Form.CONTACT])
def test_the_gpu_gives_the_same(form):
    soils = [LOAM, SOFT] * 50
    runs = [
        simulate_batch(TRACTOR, soils, torques(4), DT, form=form, v0=1.0, device=device)
        for device in ('cpu', 'gpu')
    ]
    for field in FIELDS:
        np.testing.assert_allclose(
            getattr(runs[1], field), getattr(runs[0], field), rtol=1e-6, atol=1e-6, err_msg=field
        )


@pytest.mark.skipif(not missing(), reason='there is a GPU')
def test_a_missing_gpu_is_said():
    with pytest.raises(NoGpuError, match='no CUDA GPU'):
        simulate_batch(RIG, LOAM, torques(1), DT, device='gpu')


SPOILT = torques(4)
SPOILT[7, 2] = math.nan


@pytest.mark.parametrize(
    ('arguments', 'reason'),
    [
        ({'drawbars': [Drawbar()] * 3}, 'terrains has 2 entries, but there are 3 runs'),
        ({'v0': [1.0, 2.0, 3.0]}, 'terrains has 2 entries, but there are 3 runs'),
        ({'v0': math.nan}, 'v0 must be finite'),
        ({'vehicles': [TRACTOR, RIG]}, 'run 0 has 4, run 1 has 1'),
        ({'vehicles': []}, 'vehicles is empty'),
        ({'torque': torques(3)}, r'torque must have shape \(samples, 4\)'),
        ({'torque': torques(4)[0]}, r'torque must have shape \(samples, wheels\)'),
        ({'torque': torques(4)[:1]}, r'torque must have shape \(samples, 4\)'),
        ({'torque': SPOILT}, 'torque of run 0, wheel 2 is not finite at sample 7'),
        ({'dt': 0.05}, 'dt must be above 0 and at most 0.02 s'),
        ({'sinkage': 'given'}, "sinkage must be 'dynamic' or 'equilibrium'"),
        ({'every': 0}, 'every must be an integer of at least 1'),
        ({'every': 2.0}, 'every must be an integer of at least 1'),
        ({'device': 'tpu'}, "device must be 'cpu' or 'gpu', got 'tpu'"),
        ({'form': Form.EMPIRICAL}, 'form empirical needs soils with a traction_curve'),
    ],
)
def test_what_a_batch_refuses(arguments, reason):
    values = {
        'vehicles': TRACTOR, 'terrains': [LOAM, SOFT], 'torque': torques(4), 'dt': DT, **arguments
    }  # fmt: skip
    with pytest.raises(ValueError, match=reason):
        simulate_batch(**values)
