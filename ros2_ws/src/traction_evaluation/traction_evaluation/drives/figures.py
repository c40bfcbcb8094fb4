"""Figures of a drive: slip against target, energy per metre, rates, latency."""

from dataclasses import dataclass

import numpy as np

from traction_evaluation.drives.recording import Array, Recording


@dataclass(frozen=True)
class DriveFigures:
    """Figures of one drive, over a part of its path.

    Attributes
    ----------
    slip_rmse : float
        Root mean square of slip minus target over all wheels, dimensionless.
    slip_p95 : float
        95th percentile of |slip - target| over all wheels, dimensionless.
    slip_peak : tuple of float
        Largest slip of each wheel, dimensionless.
    distance : float
        Distance covered, m.
    mean_speed : float
        Mean speed, m/s.
    energy_per_metre : float
        Work of all shafts per distance, J/m.
    peak_wheel_speed : float
        Fastest wheel, rad/s.
    """

    slip_rmse: float
    slip_p95: float
    slip_peak: tuple[float, ...]
    distance: float
    mean_speed: float
    energy_per_metre: float
    peak_wheel_speed: float


def work(recording: Recording) -> tuple[Array, Array]:
    """Work of all shafts.

    Parameters
    ----------
    recording : Recording
        A drive.

    Returns
    -------
    t, joules : ndarray, shape (k,)
        Time, s, and work since the start, J.
    """
    torque, speed = recording['shaft_torque'], recording['wheel_speed']
    power = (torque.values * speed.values).sum(axis=1)
    steps = np.diff(torque.t) * (power[1:] + power[:-1]) / 2
    return torque.t, np.concatenate([[0.0], np.cumsum(steps)])


def judge(recording: Recording, slip_target: float, start: float, settle: float) -> DriveFigures:
    """Figures of a drive from a position along the path on.

    Parameters
    ----------
    recording : Recording
        A drive, with ground truth.
    slip_target : float
        Slip target, dimensionless.
    start : float
        Start of the evaluated part, m along the path.
    settle : float
        Time after the start of this part from which slip is evaluated, s.

    Returns
    -------
    DriveFigures
        Figures, SI units.

    Raises
    ------
    ValueError
        If the part is not longer than `settle`.
    """
    distance = recording['distance']
    there = np.flatnonzero(distance.values >= start)
    if not there.size or recording.end - distance.t[there[0]] <= settle:
        raise ValueError(
            f'{recording.path}: the vehicle got to {distance.values[-1]:.1f} m, too little to '
            f'be judged from {start:g} m on'
        )
    entered, ended = float(distance.t[there[0]]), recording.end
    slip = recording['slip']
    judged = slip.values[(slip.t >= entered + settle) & (slip.t <= ended)]
    error = np.abs(judged - slip_target)
    covered = float(np.diff(distance.at(np.array([entered, ended])))[0])
    t, joules = work(recording)
    spent = np.interp([entered, ended], t, joules)
    speeds = recording['wheel_speed']
    return DriveFigures(
        slip_rmse=float(np.sqrt(np.mean(error**2))),
        slip_p95=float(np.percentile(error, 95)),
        slip_peak=tuple(judged.max(axis=0).tolist()),
        distance=covered,
        mean_speed=covered / (ended - entered),
        energy_per_metre=float(np.diff(spent)[0]) / covered if covered > 0 else float('inf'),
        peak_wheel_speed=float(speeds.values[(speeds.t >= entered) & (speeds.t <= ended)].max()),
    )


def latency(recording: Recording) -> Array:
    """Time from each reading of the wheels to its torque.

    The torque has the stamp of the reading. Both times are those of the recorder.

    Parameters
    ----------
    recording : Recording
        A drive.

    Returns
    -------
    ndarray, shape (k,)
        Latencies, s, one per reading with a torque.
    """
    readings, answers = recording['wheel_speed'], recording['torque']
    # Stamps are equal to the nanosecond, so this is a join, not an interpolation. The gate may
    # repeat a torque with the same stamp; the first one counts.
    asked = dict(zip(readings.t.tolist(), readings.logged.tolist(), strict=True))
    answered: dict[float, float] = {}
    for t, logged in zip(answers.t.tolist(), answers.logged.tolist(), strict=True):
        answered.setdefault(t, logged)
    return np.array([logged - asked[t] for t, logged in answered.items() if t in asked])
