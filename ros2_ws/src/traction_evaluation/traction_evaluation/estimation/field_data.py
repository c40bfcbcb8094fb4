"""Estimators on field data measured by others.

Two runs, whose data may not be copied into the project:

- a four-wheel rover on paths, 10 Hz wheel speeds and satellite positions: WVU Navigation Lab,
  corenav-GP, test17run;
- a tractor New Holland T7.165 S at work, 1 Hz wheel-based and ground-based speed and engine
  torque: Lindia et al. 2025, tractor-field-operations-dataset.
"""

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import spearmanr

from traction_controller.estimation.gnss import GnssTrack
from traction_controller.estimation.odometry import PathOdometry
from traction_controller.estimation.rolling_radius import Calibration, FirmGround, RollingRadius
from traction_model.slip import MIN_SPEED
from traction_model.slip import slip as slip_of

ROVER_RADIUS = 0.1168
"""Effective radius of the rover's wheels by its positions, m."""

ROVER_NOMINAL = 0.11
"""Nominal radius of the rover's wheels, m."""


def columns(folder: Path, name: str) -> dict[str, np.ndarray]:
    """Read a table of the field data.

    Parameters
    ----------
    folder : Path
        Folder of the field data.
    name : str
        File name.

    Returns
    -------
    dict of str to ndarray
        Columns; numeric ones as numbers.

    Raises
    ------
    ValueError
        If the file does not exist.
    """
    path = folder / name
    if not path.is_file():
        raise ValueError(f'{path} is not there: give the folder of the field data')
    with path.open(encoding='utf-8') as file:
        head, *rows = csv.reader(file)
    read = {}
    for column, cells in zip(head, zip(*rows, strict=True), strict=True):
        read[column] = np.array(cells) if column == 'state' else np.array(cells, dtype=float)
    return read


@dataclass(frozen=True)
class RoverRun:
    """Estimates over the run of the rover; k samples.

    Attributes
    ----------
    t : ndarray, shape (k,)
        Time, s.
    omega : ndarray, shape (k,)
        Mean wheel speed, rad/s.
    speed : ndarray, shape (k,)
        Ground speed by satellite, m/s; NaN if not valid.
    radius, deviation : ndarray, shape (k,)
        Present calibrated radius, m, and its standard deviation, m.
    accepted : ndarray of bool, shape (k,)
        True for accepted positions.
    rebased : int
        Number of restarts of the track from rejected positions.
    odometry : PathOdometry
        Odometry from the wheels alone with the calibrated radius.
    rolled : float
        Distance rolled by wheels with the initial radius, m.
    straight : float
        Distance from start to end by satellite, m.
    """

    t: np.ndarray
    omega: np.ndarray
    speed: np.ndarray
    radius: np.ndarray
    deviation: np.ndarray
    accepted: np.ndarray
    rebased: int
    odometry: PathOdometry
    rolled: float
    straight: float


def follow_rover(
    folder: Path, start_radius: float, jumps: dict[int, np.ndarray] | None = None
) -> RoverRun:
    """Estimates over the run of the rover.

    Parameters
    ----------
    folder : Path
        Folder of the field data.
    start_radius : float
        Initial radius of the calibration, m.
    jumps : dict of int to ndarray, optional
        Shifts of positions, m: from index to east, north, up.

    Returns
    -------
    RoverRun
        SI units.
    """
    table = columns(folder, 'rover_pathfinder.csv')
    t = table['t']
    wheels = np.column_stack([table[f'omega_{name}'] for name in ('fl', 'fr', 'rl', 'rr')])
    places = np.column_stack([table[axis] for axis in ('east', 'north', 'up')])
    straight = float(np.linalg.norm(places[-1] - places[0]))
    for row, jump in (jumps or {}).items():
        places[row] += jump
    omega = wheels.mean(axis=1)
    track = GnssTrack()
    radius = RollingRadius([start_radius])
    odometry = PathOdometry()
    angle = rolled = before = 0.0
    speeds, radii, deviations, accepted = [], [], [], []
    for k, now in enumerate(t):
        if k:
            dt = now - t[k - 1]
            angle += omega[k] * dt
            v = radius.radius[0] * omega[k]
            deviation = math.sqrt(radius.scale_variance[0])
            odometry.advance(dt, v, 0.02**2, scale_deviation=deviation)
            rolled += start_radius * omega[k] * dt
        track.wheels(now, radius.radius[0] * omega[k])
        accepted.append(track.fix(now, places[k]))
        # The rover has no drawbar pull: traction is for acceleration and slope only.
        effort = abs(omega[k] - before) * start_radius / 0.1 / 9.81
        before = omega[k]
        distance = track.distance if track.valid else math.nan
        radius.advance(now, [angle], distance, effort, track.heading)
        speeds.append(track.speed if track.valid else math.nan)
        radii.append(radius.radius[0])
        deviations.append(radius.nominal[0] * math.sqrt(radius.scale_variance[0]))
    return RoverRun(
        t, omega, np.array(speeds), np.array(radii), np.array(deviations), np.array(accepted),
        track.rebased, odometry, rolled, straight,
    )  # fmt: skip


@dataclass(frozen=True)
class RoverFigures:
    """Figures of the run of the rover, for one initial radius.

    Attributes
    ----------
    start_radius : float
        Initial radius, m.
    found : float
        Time after which the radius stayed within 1 % of `ROVER_RADIUS`, s.
    radius : float
        Radius after 40 s, m.
    deviation : float
        Its standard deviation, m.
    slip_bias : float
        Mean slip from `found` on until it stops, in free rolling, dimensionless.
    late_slip_bias : float
        The same from 40 s on (13 s of driving).
    refused : int
        Rejected positions of the measured track, after missing samples.
    samples : int
        Number of positions.
    rebased : int
        Number of restarts of the track from rejected positions.
    odometry_error : float
        Error of the distance by wheels with the calibrated radius, relative to the straight line
        from start to end by satellite.
    odometry_deviation : float
        Standard deviation of this distance from the odometry, relative.
    uncompensated_error : float
        The same error with the initial radius.
    """

    start_radius: float
    found: float
    radius: float
    deviation: float
    slip_bias: float
    late_slip_bias: float
    refused: int
    samples: int
    rebased: int
    odometry_error: float
    odometry_deviation: float
    uncompensated_error: float


def rover(folder: Path, start_radius: float = 0.94 * ROVER_RADIUS) -> RoverFigures:
    """Figures of the run of the rover.

    Parameters
    ----------
    folder : Path
        Folder of the field data.
    start_radius : float
        Initial radius of the calibration, m; default: 6 % too small.

    Returns
    -------
    RoverFigures
        SI units.
    """
    run = follow_rover(folder, start_radius)
    wrong = np.flatnonzero(np.abs(run.radius / ROVER_RADIUS - 1) > 0.01)
    found = run.t[wrong[-1] + 1] if wrong[-1] + 1 < len(run.t) else math.inf
    # By satellite it stands at 53 s; times of the last samples of wheels and speed do not match.
    driving = (run.t < 52.5) & np.isfinite(run.speed)

    def bias(since: float) -> float:
        late = driving & (run.t >= since)
        return float(np.mean(1 - run.speed[late] / (run.radius[late] * run.omega[late])))

    after = int(np.flatnonzero(run.t >= 40.0)[0])
    return RoverFigures(
        start_radius=start_radius,
        found=float(found),
        radius=float(run.radius[after]),
        deviation=float(run.deviation[after]),
        slip_bias=bias(found),
        late_slip_bias=bias(40.0),
        refused=int(np.sum(~run.accepted)),
        samples=len(run.t),
        rebased=run.rebased,
        odometry_error=run.odometry.distance / run.straight - 1,
        odometry_deviation=math.sqrt(run.odometry.variance) / run.straight,
        uncompensated_error=run.rolled / run.straight - 1,
    )


@dataclass(frozen=True)
class JumpFigures:
    """Figures of jumps inserted into the track of the rover.

    Attributes
    ----------
    jumps : int
        Inserted jumps of 0.3 m.
    refused : int
        Rejected ones of these.
    falsely_refused : int
        Other rejected positions, without those rejected in the measured track.
    speed_error : float
        Root mean square of their effect on the speed, m/s.
    """

    jumps: int
    refused: int
    falsely_refused: int
    speed_error: float


def rover_jumps(folder: Path, seed: int = 1, count: int = 100, lasting: int = 1) -> JumpFigures:
    """Insert jumps of 0.3 m into the track of the rover while it drives.

    Parameters
    ----------
    folder : Path
        Folder of the field data.
    seed : int
        Seed of their times and directions.
    count : int
        Number of jumps.
    lasting : int
        Number of positions that each jump shifts.

    Returns
    -------
    JumpFigures
        Figures over all shifted positions.
    """
    random = np.random.default_rng(seed)
    clean = follow_rover(folder, ROVER_NOMINAL)
    # Between the first and the last second of driving.
    rows = np.flatnonzero((clean.t > 6.0) & (clean.t < 52.5 - 0.1 * lasting))
    jumps = {}
    # Lasting jumps do not overlap.
    for row in random.choice(rows[::lasting], count, replace=False):
        angle = random.uniform(0, math.tau)
        for k in range(row, row + lasting):
            jumps[k] = 0.3 * np.array([math.cos(angle), math.sin(angle), 0.0])
    spoilt = follow_rover(folder, ROVER_NOMINAL, jumps)
    shifted = np.zeros(len(clean.t), dtype=bool)
    shifted[list(jumps)] = True
    valid = np.isfinite(spoilt.speed) & np.isfinite(clean.speed)
    return JumpFigures(
        jumps=count,
        refused=int(np.sum(~spoilt.accepted & shifted)),
        falsely_refused=int(np.sum(~spoilt.accepted & ~shifted & clean.accepted)),
        speed_error=float(np.sqrt(np.mean((spoilt.speed - clean.speed)[valid] ** 2))),
    )


# Engine torque over reference torque replaces traction. Satellite and wheel speed have a period of
# one second, so their times match within half a second only.
TRACTOR_GROUND = FirmGround(largest_effort=0.35, stretch=3.0, distance=0.1, timing=0.5)


@dataclass(frozen=True)
class TractorFigures:
    """Figures of the day of the tractor, for one initial radius.

    Attributes
    ----------
    start_scale : float
        Initial radius, over that in the wheel-based speed of the tractor, dimensionless.
    scale : float
        Calibrated scale, dimensionless.
    deviation : float
        Its standard deviation, dimensionless.
    calibrated : float
        Time at which its standard deviation was below 1 %, s.
    measured, refused : int
        Numbers of used and rejected measurements.
    pulling : float
        Share of samples of state W above the smallest speed in which the calibration paused
        because of traction.
    slip : dict of str to float
        Median slip by state M, T and W, dimensionless, after calibration.
    slip_by_torque : tuple of float
        Median slip, dimensionless, in fifths of the samples by rising engine torque.
    rank_correlation : float
        Spearman's rank correlation of slip and engine torque.
    """

    start_scale: float
    scale: float
    deviation: float
    calibrated: float
    measured: int
    refused: int
    pulling: float
    slip: dict[str, float]
    slip_by_torque: tuple[float, ...]
    rank_correlation: float


def tractor(folder: Path, start_scale: float = 0.94) -> TractorFigures:
    """Figures of the day of the tractor.

    Parameters
    ----------
    folder : Path
        Folder of the field data.
    start_scale : float
        Initial radius, over that in the wheel-based speed of the tractor; default: 6 % too small.

    Returns
    -------
    TractorFigures
        SI units; slips from the time at which the standard deviation of the radius is below 1 %.
    """
    table = columns(folder, 'tractor_t7165s.csv')
    t, state = table['t'], table['state']
    wheel, ground, torque = table['wheel_speed'], table['ground_speed'], table['engine_torque']
    # With a radius of 1 m, angular speed equals wheel-based speed.
    calibration = RollingRadius([start_scale], TRACTOR_GROUND)
    scales, frozen = [], []
    calibrated = math.inf
    angle = distance = 0.0
    for k, now in enumerate(t):
        dt = now - t[k - 1] if k else 0.0
        angle += wheel[k] * dt
        distance += ground[k] * dt
        calibration.advance(now, [angle], distance, torque[k] / 100.0)
        scales.append(calibration.radius[0])
        frozen.append(calibration.state is Calibration.PULLING)
        if calibration.calibrated[0]:
            calibrated = min(calibrated, now)
    rim = np.array(scales) * wheel
    moving = (rim >= MIN_SPEED) & (t >= calibrated)
    slip = np.array([slip_of(v, r) for v, r in zip(ground, rim, strict=True)])
    fifths = np.array_split(np.flatnonzero(moving)[np.argsort(torque[moving], kind='stable')], 5)
    at_work = (state == 'W') & (ground >= TRACTOR_GROUND.min_speed)
    return TractorFigures(
        start_scale=start_scale,
        scale=float(calibration.radius[0]),
        deviation=float(start_scale * math.sqrt(calibration.scale_variance[0])),
        calibrated=float(calibrated),
        measured=int(calibration.measured[0]),
        refused=int(calibration.refused[0]),
        pulling=float(np.mean(np.array(frozen)[at_work])),
        slip={s: float(np.median(slip[moving & (state == s)])) for s in 'MTW'},
        slip_by_torque=tuple(float(np.median(slip[rows])) for rows in fifths),
        rank_correlation=float(spearmanr(slip[moving], torque[moving]).statistic),
    )
