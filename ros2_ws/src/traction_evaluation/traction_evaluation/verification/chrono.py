"""Runs of Project Chrono for the verification of the model: definitions and recordings.

Rigid cylinder wheels on SCM deformable terrain, Project Chrono 8.0.0, sampled every 5 ms; see
``bags/README.md``. Single-wheel runs are those of Agriculture 2024, 14(3), 499, Table 1, and
variations of them.
"""

import csv
import lzma
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from traction_model.simulation.drawbar import Drawbar
from traction_model.slip import slips
from traction_model.soil.soil import load_soil
from traction_model.soil.terrain import Terrain
from traction_model.vehicle.vehicle import Vehicle, load_vehicle

Array = NDArray[np.float64]

SAMPLE_TIME = 0.005
"""Sampling period of the recordings, s."""


@dataclass(frozen=True)
class ChronoRun:
    """Definition of a run.

    Attributes
    ----------
    vehicle : str
        Preset of the vehicle.
    soils : tuple of str
        Presets of the soils, in order along the path.
    starts : tuple of float
        Start of each soil after the first, m along the path of the rear axle.
    drawbar : Drawbar
        Draft, N.
    steered : bool
        True: the front wheels are steered.
    """

    vehicle: str
    soils: tuple[str, ...]
    starts: tuple[float, ...] = ()
    drawbar: Drawbar = Drawbar()
    steered: bool = False

    def terrain(self) -> Terrain:
        """Soils along the path, SI units."""
        return Terrain([load_soil(name) for name in self.soils], self.starts)


def _wheel(pull: float = 0.0, pull_per_speed: float = 0.0) -> ChronoRun:
    drawbar = Drawbar(pull, pull_per_speed, ramp=2.0)
    return ChronoRun('single_wheel_rig', ('paper_sand',), drawbar=drawbar)


def _tractor(pull: float, pull_per_speed: float, *, steered: bool = False) -> ChronoRun:
    drawbar = Drawbar(pull, pull_per_speed, ramp=2.0)
    return ChronoRun('tractor_4wd', ('sandy_loam_chrono',), drawbar=drawbar, steered=steered)


CHRONO_RUNS = {
    'wheel_drawbar': _wheel(900, 300),
    'wheel_torque_sine': _wheel(900, 300),
    'wheel_soft_patch': ChronoRun(
        'single_wheel_rig', ('paper_sand', 'paper_sand_soft'), (8.5,), Drawbar(700, 300, ramp=2.0)
    ),
    'wheel_low_slip': _wheel(),
    'wheel_high_slip': _wheel(),
    'tractor_sandy_loam': _tractor(6000, 1500),
    'tractor_soft_patch': ChronoRun(
        'tractor_4wd',
        ('sandy_loam_chrono', 'soft_patch_chrono'),
        (22.0,),
        Drawbar(5500, 1800, ramp=2.0),
    ),
    'tractor_steps_slow': _tractor(9000, 5000),
    'tractor_steps_medium': _tractor(6000, 3000),
    # Towed towards 3 m/s; the tow fades from 12 to 13 s.
    'tractor_braked': _tractor(-90000, 30000),
    'turn_left': _tractor(2000, 1500, steered=True),
    'turn_slalom': _tractor(2000, 1500, steered=True),
    'turn_pull': _tractor(6500, 4500, steered=True),
}
"""Runs by name."""


@dataclass(frozen=True)
class ChronoRecording:
    """Recording of a run; k samples, n wheels.

    Attributes
    ----------
    run : ChronoRun
        Definition of the run.
    vehicle : Vehicle
        The vehicle.
    columns : dict of str to ndarray
        Columns as recorded, SI units.
    t : ndarray, shape (k,)
        Time, s.
    v, x : ndarray, shape (k,)
        Speed, m/s, and position, m, of the middle of the rear axle, along the path; with steering,
        position along the initial heading.
    torque, omega, sinkage, net_force : ndarray, shape (k, n)
        Drive torque, N·m; wheel speed, rad/s; sinkage of the wheel, m, negative off the ground;
        net horizontal force of the soil on the wheel along the vehicle, N.
    wheel_v : ndarray, shape (k, n)
        Speed of the wheel centre in the plane of the wheel, m/s; v without steering.
    """

    run: ChronoRun
    vehicle: Vehicle
    columns: dict[str, Array]
    t: Array
    v: Array
    x: Array
    torque: Array
    omega: Array
    sinkage: Array
    net_force: Array
    wheel_v: Array

    @property
    def rim_speed(self) -> Array:
        """Rim speed of every wheel, r*omega, m/s, forward positive, shape (k, n)."""
        return self.omega * [wheel.radius for wheel in self.vehicle.wheels]

    @property
    def slip(self) -> Array:
        """Slip of every wheel, -1 to 1, shape (k, n)."""
        by_wheel = zip(self.wheel_v.T, self.rim_speed.T[:, :, np.newaxis], strict=True)
        return np.hstack([slips(v, rim) for v, rim in by_wheel])


def read_chrono(path: str | Path, run: ChronoRun) -> ChronoRecording:
    """Read the recording of a run.

    Parameters
    ----------
    path : str or Path
        CSV file with a header line, compressed by xz.
    run : ChronoRun
        Definition of the run.

    Returns
    -------
    ChronoRecording
        The recording, SI units.

    Raises
    ------
    ValueError
        If a column is missing, or the sampling period is not 5 ms.
    """
    with lzma.open(path, 'rt', encoding='utf-8') as file:
        names, *rows = csv.reader(file)
    columns = dict(zip(names, np.array(rows, dtype=float).T, strict=True))
    vehicle = load_vehicle(run.vehicle)

    def wheels(name: str) -> Array:
        if name in columns:  # a single wheel has no suffix
            return np.asarray(columns[name][:, np.newaxis])
        return np.column_stack([columns[f'{name}_{wheel}'] for wheel in vehicle.wheel_names])

    try:
        t, v, x = (columns[name] for name in ('t', 'v', 'x'))
        force = wheels('fx')
        wheel_v = np.repeat(v[:, np.newaxis], force.shape[1], axis=1)
        if run.steered:
            wheel_v = wheels('vx')
            steer = np.zeros_like(force)
            for wheel, side in (('fl', 'steer_l'), ('fr', 'steer_r')):
                steer[:, vehicle.wheel_names.index(wheel)] = columns[side]
            force = force * np.cos(steer) - wheels('fy') * np.sin(steer)
        recording = ChronoRecording(
            run, vehicle, columns, t, v, x, wheels('torque'), wheels('omega'),
            wheels('sinkage'), force, wheel_v,
        )  # fmt: skip
    except KeyError as error:
        raise ValueError(f'{path}: column {error.args[0]} is missing') from error
    if not np.allclose(np.diff(recording.t), SAMPLE_TIME):
        raise ValueError(f'{path}: not sampled every {SAMPLE_TIME} s')
    return recording
