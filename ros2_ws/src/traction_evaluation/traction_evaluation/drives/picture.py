"""Pictures: slip, speeds and torques of recorded drives; figures and correlations of sweeps."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from traction_evaluation.drives.recording import Array, Recording, Series

matplotlib.use('Agg')

# Colour-blind safe; wheels of one axle share a colour, the right one is dashed.
_COLOURS = ('#0072B2', '#D55E00', '#009E73', '#CC79A7')
_TARGET = '#444444'
_ESTIMATE = '#F0E442'
_SOFT = '#c8a165'

DPI = 110
"""Dots per inch of all pictures."""

MAX_BARS = 12
"""Largest number of correlations shown for a sweep, the strongest first."""


def draw(
    recordings: Sequence[Recording],
    titles: Sequence[str],
    path: Path | str,
    *,
    slip_target: float | None = None,
    soft_from: float | None = None,
) -> None:
    """Draw drives side by side as a PNG.

    Parameters
    ----------
    recordings : sequence of Recording
        Drives, one per column.
    titles : sequence of str
        Their titles.
    path : Path or str
        File to write.
    slip_target : float, optional
        Target, dimensionless; default: target of each recording, if any.
    soft_from : float, optional
        Start of soft soil, m along the path; shaded from the time when the rear axle reaches it.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    columns = len(recordings)
    figure = Figure(figsize=(1.5 + 5.8 * columns, 8.6), layout='constrained')
    axes = figure.subplots(3, columns, sharex='col', sharey='row', squeeze=False)
    for column, (recording, title) in enumerate(zip(recordings, titles, strict=True)):
        target = slip_target if slip_target is not None else recording.slip_target
        slip, speed, torque = axes[:, column]
        slip.set_title(title, fontsize=12, fontweight='bold')
        _draw_slip(slip, recording, target)
        _draw_speed(speed, recording)
        _draw_torque(torque, recording)
        torque.set_xlabel('time, s')
        end = recording.end
        for axis in axes[:, column]:
            if not axis.lines:
                axis.text(0.5, 0.5, 'not recorded', transform=axis.transAxes, ha='center')
            axis.grid(alpha=0.25)
            axis.set_xlim(0.0, end)
            _shade(axis, recording, soft_from, end)
    axes[0, 0].set_ylabel('slip')
    axes[1, 0].set_ylabel('speed, m/s')
    axes[2, 0].set_ylabel('shaft torque, kN·m')
    kmh = axes[1, -1].secondary_yaxis('right', functions=(lambda v: 3.6 * v, lambda k: k / 3.6))
    kmh.set_ylabel('km/h')
    for axis, place in zip(
        axes[:, -1], ('upper right', 'upper right', 'center right'), strict=True
    ):
        if axis.lines:
            axis.legend(fontsize=8, loc=place, framealpha=0.9)
    figure.savefig(path, dpi=DPI)


def _lines(
    axis: Axes,
    series: Series,
    names: Sequence[str],
    *,
    scale: float = 1.0,
    label: str = '',
    width: float = 1.2,
) -> None:
    """One line per wheel; wheels of an axle share a colour, the right one is dashed."""
    if series.values.shape[1:] != (len(names),):
        # Not measured.
        return
    axles = list(dict.fromkeys(name[0] for name in names))
    for j, name in enumerate(names):
        colour = _COLOURS[axles.index(name[0]) % len(_COLOURS)]
        dashed = '--' if len(names) > 1 and name.endswith('r') else '-'
        values = scale * series.values[:, j]
        axis.plot(series.t, values, dashed, color=colour, lw=width, label=name + label)


def _draw_slip(axis: Axes, recording: Recording, target: float | None) -> None:
    for kind in ('slip', 'slip_estimate'):
        if kind in recording:
            series = recording[kind]
            if kind == 'slip' and 'slip_valid' in recording:
                # Slip is undefined at standstill.
                shown = np.where(recording['slip_valid'].values > 0, series.values, np.nan)
                series = Series(series.t, shown, series.logged)
            _lines(axis, series, recording.wheel_names)
            break
    if target is not None:
        axis.axhline(target, color=_TARGET, lw=1.0, ls=':', label=f'target {target:g}')
        axis.axhspan(target - 0.03, target + 0.03, color=_TARGET, alpha=0.08, lw=0)
    axis.set_ylim(-0.05, 1.05)


def _draw_speed(axis: Axes, recording: Recording) -> None:
    if 'rim_speed' in recording:
        _lines(axis, recording['rim_speed'], recording.wheel_names, label=' rim', width=1.0)
    for kind, label in (('speed', 'over ground'), ('speed_estimate', 'over ground, estimated')):
        if kind in recording:
            series = recording[kind]
            if kind == 'speed':
                axis.plot(series.t, series.values, 'k-', lw=2.0, label=label)
            else:
                axis.plot(series.t, series.values, ':', color=_ESTIMATE, lw=1.4, label=label)
    # The axis does not include the rim speed of spinning wheels.
    over_ground = [kind for kind in ('speed', 'speed_estimate', 'radar') if kind in recording]
    if over_ground:
        top = 3.0 * max(float(np.nanmax(recording[kind].values)) for kind in over_ground)
        axis.set_ylim(min(0.0, axis.get_ylim()[0]), top)


def _draw_torque(axis: Axes, recording: Recording) -> None:
    _lines(axis, recording['shaft_torque'], recording.wheel_names, scale=1e-3)
    if 'torque_request' in recording:
        request = recording['torque_request']
        for j in range(request.values.shape[1]):
            axis.plot(request.t, 1e-3 * request.values[:, j], color=_TARGET, lw=0.8, ls=':',
                      label='requested' if j == 0 else None)  # fmt: skip


def _shade(axis: Axes, recording: Recording, soft_from: float | None, end: float) -> None:
    if soft_from is None or 'distance' not in recording:
        return
    distance = recording['distance']
    there = np.flatnonzero(distance.values >= soft_from)
    if there.size:
        axis.axvspan(distance.t[there[0]], end, color=_SOFT, alpha=0.18, lw=0, label='soft soil')


@dataclass(frozen=True)
class FigureDistribution:
    """Figure over all draws of a sweep, with correlations.

    Attributes
    ----------
    label : str
        Name with unit.
    values : ndarray, shape (k,)
        Values in that unit; NaN if a draw has none.
    correlations : dict of str to float
        Rank correlation with each varied quantity, -1 to 1, by name; NaN if undefined.
    """

    label: str
    values: Array
    correlations: Mapping[str, float]


def draw_sweep(distributions: Sequence[FigureDistribution], title: str, path: Path | str) -> None:
    """Draw histograms and correlations of the figures of a sweep as a PNG.

    Parameters
    ----------
    distributions : sequence of FigureDistribution
        Figures, one per column.
    title : str
        Title of the whole.
    path : Path or str
        File to write.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    strength = {
        name: max(
            np.nan_to_num(abs(distribution.correlations[name])) for distribution in distributions
        )
        for name in distributions[0].correlations
    }
    # The strongest at the top.
    names = sorted(strength, key=strength.__getitem__)[-MAX_BARS:]
    bars = 0.9 + 0.32 * max(1, len(names))
    figure = Figure(figsize=(2.4 + 4.2 * len(distributions), 3.9 + bars), layout='constrained')
    figure.suptitle(title, fontsize=12, fontweight='bold')
    axes = figure.subplots(
        2, len(distributions), squeeze=False, sharey='row', height_ratios=[3.4, bars]
    )
    for (above, below), distribution in zip(axes.T, distributions, strict=True):
        _draw_histogram(above, distribution)
        _draw_tornado(below, distribution, names)
    axes[0, 0].set_ylabel('draws')
    figure.savefig(path, dpi=DPI)


def _draw_histogram(axis: Axes, distribution: FigureDistribution) -> None:
    values = distribution.values[np.isfinite(distribution.values)]
    axis.set_xlabel(distribution.label)
    axis.grid(alpha=0.25)
    if not values.size:
        axis.text(0.5, 0.5, 'not defined in any draw', transform=axis.transAxes, ha='center')
        return
    p5, median, p95 = np.percentile(values, [5, 50, 95])
    axis.hist(values, bins=min(50, max(5, round(np.sqrt(len(values))))), color=_COLOURS[0])
    axis.axvspan(
        p5, p95, color=_TARGET, alpha=0.1, lw=0, label=f'p5 to p95: {p5:.3g} to {p95:.3g}'
    )
    axis.axvline(median, color=_TARGET, lw=1.2, ls='--', label=f'median: {median:.3g}')
    axis.legend(fontsize=8, loc='upper right', framealpha=0.9)
    # Room for the legend.
    axis.margins(y=0.3)


def _draw_tornado(axis: Axes, distribution: FigureDistribution, names: Sequence[str]) -> None:
    axis.set_xlim(-1.25, 1.25)
    axis.set_xticks([-1.0, -0.5, 0.0, 0.5, 1.0])
    axis.axvline(0.0, color=_TARGET, lw=0.8)
    axis.grid(alpha=0.25, axis='x')
    axis.set_xlabel('rank correlation')
    if not names:
        axis.set_yticks([])
        axis.text(0.5, 0.5, 'no numbers varied', transform=axis.transAxes, ha='center')
    for row, name in enumerate(names):
        rho = distribution.correlations[name]
        if np.isfinite(rho):
            axis.barh(row, rho, color=_COLOURS[0] if rho > 0 else _COLOURS[1])
            side = 1 if rho >= 0 else -1
            axis.text(rho + 0.03 * side, row, f'{rho:+.2f}', va='center', fontsize=8,
                      ha='left' if side > 0 else 'right')  # fmt: skip
    axis.set_yticks(range(len(names)), names, fontsize=9)
