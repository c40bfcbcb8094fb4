"""Batches: many runs with different vehicles, soils and torques, on all cores or a GPU.

Every run equals one of `traction_model.simulation.simulate.simulate`, with the same kernels.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_model.contact.contact import Form
from traction_model.kernel import OPTIONS
from traction_model.simulation.drawbar import Drawbar
from traction_model.simulation.runs import Runs, run_one
from traction_model.simulation.vehicle_dynamics import (
    DISTANCE,
    FIRST_WHEEL,
    SPEED,
    Model,
    initial_state,
    pack,
)
from traction_model.simulation.wheel_forces import (
    FORCE_COLUMNS,
    LOAD,
    MOMENT,
    RESISTANCE,
    SINKAGE,
    THRUST,
)
from traction_model.slip import slips
from traction_model.soil.rut import fresh_ruts
from traction_model.soil.soil import Soil
from traction_model.soil.terrain import Terrain
from traction_model.vehicle.vehicle import Vehicle
from traction_model.vehicle.wheel import RADIUS, STATIC_LOAD, TRACK

Array = NDArray[np.float64]


@numba.njit(parallel=True, **OPTIONS)
def _run_all(dt, every, runs, states, logged):
    for b in numba.prange(runs.y.shape[0]):
        run_one(np.int64(b), dt, every, runs, states, logged)


@dataclass(frozen=True)
class Batch:
    """Simulated motions; b runs, m stored samples, n wheels.

    Attributes
    ----------
    t : ndarray, shape (m,)
        Time, s.
    v : ndarray, shape (b, m)
        Speed, m/s, forward positive.
    x : ndarray, shape (b, m)
        Distance along the path, m.
    omega : ndarray, shape (b, m, n)
        Wheel speeds, rad/s, forward positive.
    slip : ndarray, shape (b, m, n)
        Slip, -1 to 1; see `traction_model.slip.slip`.
    sinkage : ndarray, shape (b, m, n)
        m, downward positive.
    load : ndarray, shape (b, m, n)
        Load on the wheel after load transfer, N.
    thrust : ndarray, shape (b, m, n)
        F, N, forward positive.
    motion_resistance : ndarray, shape (b, m, n)
        R, N, positive against forward motion.
    soil_moment : ndarray, shape (b, m, n)
        M, N·m, moment of the soil against the rotation of the wheel.
    """

    t: Array
    v: Array
    x: Array
    omega: Array
    slip: Array
    sinkage: Array
    load: Array
    thrust: Array
    motion_resistance: Array
    soil_moment: Array


def simulate_batch(
    vehicles: Vehicle | Sequence[Vehicle],
    terrains: Terrain | Soil | Sequence[Terrain | Soil],
    torque: ArrayLike,
    dt: float,
    *,
    form: Form = Form.CONTACT,
    sinkage: Literal['dynamic', 'equilibrium'] = 'dynamic',
    drawbars: Drawbar | Sequence[Drawbar] = Drawbar(),
    multipass: bool = True,
    v0: ArrayLike = 0.0,
    every: int = 1,
    device: Literal['cpu', 'gpu'] = 'cpu',
) -> Batch:
    """Simulate many runs, each as with `simulate`.

    An argument given once applies to every run.

    Parameters
    ----------
    vehicles : Vehicle or sequence of Vehicle
        Vehicles, all with the same number of wheels.
    terrains : Terrain, Soil, or sequence of them
        Terrains.
    torque : array_like, shape (k, n) or (b, k, n)
        Torque on every wheel at every sample, N·m; linear in between.
    dt : float
        Time between samples and longest step of integration, s, above 0 and at most 0.02.
    form : Form
        Form of the contact model, the same in all runs.
    sinkage : {'dynamic', 'equilibrium'}
        Sinkage as a state, or from vertical equilibrium.
    drawbars : Drawbar or sequence of Drawbar
        Drafts, N.
    multipass : bool
        True: wheels run in the ruts of those before them. False: undisturbed soil.
    v0 : float or array_like, shape (b,)
        Speed at the start, m/s; wheels roll without slip.
    every : int
        Number of samples per stored one, at least 1.
    device : {'cpu', 'gpu'}
        All cores, or a CUDA GPU, which needs the package numba-cuda.

    Returns
    -------
    Batch
        Motions, SI units, one row per run.

    Raises
    ------
    ValueError
        If an argument has the wrong shape or is out of range; the text names it and the run.
    traction_model.simulation.gpu.NoGpuError
        If there is no GPU; the text has the reason.
    """
    runs = _packed(vehicles, terrains, torque, dt, form, sinkage, drawbars, multipass, v0)
    if isinstance(every, bool) or not isinstance(every, int) or every < 1:
        raise ValueError(f'every must be an integer of at least 1, got {every!r}')
    samples = runs.torque.shape[1]
    kept = (samples - 1) // every + 1
    count, size = runs.y.shape
    n = runs.wheels.shape[1]
    states = np.empty((count, kept, size))
    forces = np.empty((count, kept, n, FORCE_COLUMNS))
    if device == 'cpu':
        _run_all(dt, every, runs, states, forces)
    elif device == 'gpu':
        # Imported on demand: numba-cuda is optional.
        from traction_model.simulation.gpu import run_all

        run_all(dt, every, runs, states, forces)
    else:
        raise ValueError(f"device must be 'cpu' or 'gpu', got {device!r}")
    omega = states[:, :, FIRST_WHEEL : FIRST_WHEEL + n]
    rims = omega * runs.wheels[:, None, :, RADIUS]
    speed = states[:, :, SPEED]
    return Batch(
        t=dt * every * np.arange(float(kept)),
        v=speed,
        x=states[:, :, DISTANCE],
        omega=omega,
        slip=slips(speed.reshape(-1), rims.reshape(-1, n)).reshape(rims.shape),
        sinkage=forces[:, :, :, SINKAGE],
        load=forces[:, :, :, LOAD],
        thrust=forces[:, :, :, THRUST],
        motion_resistance=forces[:, :, :, RESISTANCE],
        soil_moment=forces[:, :, :, MOMENT],
    )


def _packed(
    vehicles: Vehicle | Sequence[Vehicle],
    terrains: Terrain | Soil | Sequence[Terrain | Soil],
    torque: ArrayLike,
    dt: float,
    form: Form,
    sinkage: str,
    drawbars: Drawbar | Sequence[Drawbar],
    multipass: bool,
    v0: ArrayLike,
) -> Runs:
    """Checked and packed runs."""
    if sinkage not in ('dynamic', 'equilibrium'):
        raise ValueError(f"sinkage must be 'dynamic' or 'equilibrium', got {sinkage!r}")
    if not 0 < dt <= 0.02:
        raise ValueError(f'dt must be above 0 and at most 0.02 s, got {dt}')
    torques = np.ascontiguousarray(torque, dtype=float)
    if torques.ndim == 2:
        torques = torques[None]
    if torques.ndim != 3:
        raise ValueError(
            f'torque must have shape (samples, wheels) or (runs, samples, wheels), got '
            f'{torques.shape}'
        )
    speeds = np.atleast_1d(np.asarray(v0, dtype=float))
    given: dict[str, Any] = {
        'vehicles': [vehicles] if isinstance(vehicles, Vehicle) else list(vehicles),
        'terrains': [terrains] if isinstance(terrains, Terrain | Soil) else list(terrains),
        'drawbars': [drawbars] if isinstance(drawbars, Drawbar) else list(drawbars),
        'v0': speeds,
        'torque': torques,
    }
    count = max(len(things) for things in given.values())
    for name, things in given.items():
        if not len(things):
            raise ValueError(f'{name} is empty')
        if len(things) not in (1, count):
            raise ValueError(f'{name} has {len(things)} entries, but there are {count} runs')
    n = len(given['vehicles'][0].wheels)
    for b, vehicle in enumerate(given['vehicles']):
        if len(vehicle.wheels) != n:
            raise ValueError(
                f'vehicles of a batch have equally many wheels: run 0 has {n}, run {b} has '
                f'{len(vehicle.wheels)}'
            )
    if torques.shape[2] != n or torques.shape[1] < 2:
        raise ValueError(
            f'torque must have shape (samples, {n}) or (runs, samples, {n}), got '
            f'{np.shape(torque)}'
        )
    if not np.all(np.isfinite(torques)):
        b, row, column = np.argwhere(~np.isfinite(torques))[0]
        raise ValueError(f'torque of run {b}, wheel {column} is not finite at sample {row}')
    if speeds.ndim != 1 or not np.all(np.isfinite(speeds)):
        raise ValueError(f'v0 must be finite, one number or one a run, got {v0!r}')

    models, states, ruts = [], [], []
    for b in range(count):
        vehicle, terrain, drawbar = (
            _of_run(given[name], b) for name in ('vehicles', 'terrains', 'drawbars')
        )
        models.append(pack(vehicle, terrain, form, sinkage, drawbar, multipass))
        state = initial_state(vehicle, terrain, form)
        state[SPEED] = _of_run(speeds, b)
        state[FIRST_WHEEL : FIRST_WHEEL + n] = [state[SPEED] / w.radius for w in vehicle.wheels]
        states.append(state)
        ruts.append(float(np.ptp(vehicle.wheel_positions)))
    wheels = np.array([model.wheels for model in models])
    forces = np.zeros((count, n, FORCE_COLUMNS))
    forces[:, :, LOAD] = wheels[:, :, STATIC_LOAD]
    forces[:, :, SINKAGE] = np.array(states)[:, FIRST_WHEEL + n : FIRST_WHEEL + 2 * n]
    # Only the contact form uses ruts.
    tracks = int(wheels[:, :, TRACK].max()) + 1 if form == Form.CONTACT else 0
    fresh = fresh_ruts(tracks, max(ruts))
    soils = max(len(model.starts) for model in models)
    return Runs(
        form=int(form),
        mode=models[0].mode,
        wheels=wheels,
        load_distribution=np.array([model.load_distribution for model in models]),
        soils=np.array([_lengthened(model.soils, soils, 1) for model in models]),
        starts=np.array([_lengthened(model.starts, soils, 0, math.inf) for model in models]),
        grades=np.array([_lengthened(model.grades, soils, 0) for model in models]),
        numbers=np.array([model[Model._fields.index('mass') :] for model in models], dtype=float),
        depth=np.tile(fresh.depth, (count, 1, 1)),
        shear=np.tile(fresh.shear, (count, 1, 1)),
        rut_width=np.tile(fresh.width, (count, 1, 1)),
        newest=np.tile(fresh.newest, (count, 1)),
        y=np.array(states),
        forces=forces,
        work=np.empty((count, 3, FIRST_WHEEL + 3 * n)),
        torque=torques,
        given=np.zeros((2, 3, n)),
    )


def _of_run(things: Any, b: int) -> Any:
    return things[b if len(things) > 1 else 0]


def _lengthened(values: Array, size: int, axis: int, fill: float | None = None) -> Array:
    """Array extended along an axis by its last entry or a number."""
    missing = size - values.shape[axis]
    last = np.take(values, [-1], axis=axis)
    if fill is not None:
        last = np.full_like(last, fill)
    return np.concatenate([values, np.repeat(last, missing, axis=axis)], axis=axis)
