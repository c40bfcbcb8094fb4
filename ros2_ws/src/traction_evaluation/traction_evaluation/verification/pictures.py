"""Pictures of the report on verification."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from traction_evaluation.verification.braking import PLATEAUS
from traction_evaluation.verification.chrono import ChronoRecording
from traction_evaluation.verification.run_errors import FollowedRuns
from traction_evaluation.verification.torque_steps import FROM, STEPPED_RUNS, STEPPED_WHEELS
from traction_evaluation.verification.verification import Array, Motion
from traction_evaluation.verification.wheel_rig import RigErrors
from traction_model.simulation.simulate import Trajectory

GREY, BLUE, ORANGE = '#444444', '#0072B2', '#D55E00'


def _pair(axis: Axes, t: Array, chronos: Array, ours: Array, label: str = 'model') -> None:
    """Draw Chrono's and the model's course."""
    axis.plot(t, chronos, color=GREY, lw=2.4, alpha=0.6, label='Chrono')
    axis.plot(t, ours, color=ORANGE, lw=1, label=label)
    axis.grid(alpha=0.25)


def draw_runs(
    recordings: Mapping[str, ChronoRecording],
    runs: FollowedRuns,
    names: Sequence[str],
    path: Path,
) -> None:
    """Draw speed, slip and sinkage of runs, a row each; of the last wheel.

    Parameters
    ----------
    recordings : mapping of str to ChronoRecording
        Runs by name, SI units.
    runs : FollowedRuns
        The same, followed.
    names : sequence of str
        Those to draw.
    path : Path
        PNG to write.
    """
    figure = Figure(figsize=(13, 2.5 * len(names)), layout='constrained')
    axes = figure.subplots(len(names), 3, squeeze=False)
    for name, (speed, slip, sinkage) in zip(names, axes, strict=True):
        recording = recordings[name]
        predicted, fed = (runs.motions[name, each] for each in (False, True))
        first = slice(len(recording.t) - len(fed.t), None)
        slips = recording.slip[first, -1]
        _pair(speed, fed.t, recording.v[first], predicted.v, 'sinkage predicted')
        _pair(slip, fed.t, slips, predicted.slip[:, -1])
        _pair(sinkage, fed.t, recording.sinkage[first, -1], predicted.sinkage[:, -1])
        speed.plot(fed.t, fed.v, color=BLUE, ls='--', lw=1, label='sinkage fed')
        slip.plot(fed.t, fed.slip[:, -1], color=BLUE, ls='--', lw=1)
        speed.set_ylabel(f'{name}\nspeed, m/s')
        slip.set_ylabel('slip')
        slip.set_ylim(-0.05, 1.05 if slips.max() > 0.6 else 0.5)
        sinkage.set_ylabel('sinkage, m')
    for axis in axes[-1]:
        axis.set_xlabel('time, s')
    axes[0, 0].legend(fontsize=8)
    figure.savefig(path, dpi=90)


def draw_steps(recordings: Mapping[str, ChronoRecording], runs: FollowedRuns, path: Path) -> None:
    """Draw the wheel speeds of the stepped wheels.

    Parameters
    ----------
    recordings : mapping of str to ChronoRecording
        Runs by name, SI units.
    runs : FollowedRuns
        The same, followed.
    path : Path
        PNG to write.
    """
    figure = Figure(figsize=(13, 5.5), layout='constrained')
    axes = figure.subplots(len(STEPPED_RUNS), len(STEPPED_WHEELS), sharex=True)
    for name, row in zip(STEPPED_RUNS, axes, strict=True):
        recording, motion = recordings[name], runs.motions[name, False]
        first = slice(len(recording.t) - len(motion.t), None)
        shown = motion.t >= FROM - 1.0
        for wheel, axis in zip(STEPPED_WHEELS, row, strict=True):
            j = recording.vehicle.wheel_names.index(wheel)
            chronos, ours = recording.omega[first, j], motion.omega[:, j]
            _pair(axis, motion.t[shown], chronos[shown], ours[shown])
            axis.set_title(f'{name}, {wheel}')
            axis.set_ylabel('wheel speed, rad/s')
    for axis in axes[-1]:
        axis.set_xlabel('time, s')
    axes[0, 0].legend(fontsize=8)
    figure.savefig(path, dpi=90)


def draw_braking(recording: ChronoRecording, motion: Motion | Trajectory, path: Path) -> None:
    """Draw speed, wheel speeds and slip of the braked run, front and rear on the left.

    Parameters
    ----------
    recording : ChronoRecording
        The run, SI units.
    motion : Motion or Trajectory
        The same, followed.
    path : Path
        PNG to write.
    """
    figure = Figure(figsize=(13, 5.5), layout='constrained')
    axes = figure.subplots(2, 2, sharex=True)
    first = slice(len(recording.t) - len(motion.t), None)
    for row, wheel, axle in ((0, 'fl', 'front'), (1, 'rl', 'rear')):
        j = recording.vehicle.wheel_names.index(wheel)
        for axis, chronos, ours, label in (
            (axes[row, 0], recording.rim_speed[first, j],
             motion.omega[:, j] * recording.vehicle.wheels[j].radius, 'rim speed, m/s'),
            (axes[row, 1], recording.slip[first, j], motion.slip[:, j], 'slip'),
        ):  # fmt: skip
            _pair(axis, motion.t, chronos, ours)
            axis.set_ylabel(f'{axle}: {label}')
            for begin, end in PLATEAUS:
                axis.axvspan(begin, end, color=BLUE, alpha=0.08)
    for axis in axes[-1]:
        axis.set_xlabel('time, s')
    axes[0, 0].legend(fontsize=8)
    figure.savefig(path, dpi=90)


def draw_rig(told: RigErrors, untold: RigErrors, path: Path) -> None:
    """Draw the errors of the rig's points against slip.

    Parameters
    ----------
    told, untold : RigErrors
        With Chrono's pressure modulus and with Bekker's, dimensionless.
    path : Path
        PNG to write.
    """
    figure = Figure(figsize=(13, 3.4), layout='constrained')
    for axis, field, label in zip(
        figure.subplots(1, 3),
        ('force', 'moment', 'sinkage'),
        ('Fx over load, %', 'My over r·load, %', 'sinkage, %'),
        strict=True,
    ):
        for found, mark, colour, text in (
            (untold, 'x', GREY, 'k_c/b'),
            (told, '.', ORANGE, 'told the patch'),
        ):
            error = 100 * np.asarray(getattr(found, field))
            axis.plot(found.slip, error, mark, color=colour, ms=4, label=text)
        axis.set_xlabel('slip')
        axis.set_ylabel(f'error of {label}')
        axis.grid(alpha=0.25)
    figure.axes[0].legend(fontsize=8)
    figure.savefig(path, dpi=90)
