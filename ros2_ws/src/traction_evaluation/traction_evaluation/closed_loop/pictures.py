"""Pictures of the report on slip control."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from traction_evaluation.closed_loop.closed_loop import DT, Drive
from traction_evaluation.closed_loop.scenario import SCENARIOS
from traction_evaluation.closed_loop.statistics import Result
from traction_evaluation.closed_loop.trial_figures import STEP, STEP_WINDOW
from traction_evaluation.loop.shipped import shipped_parameters

COLOURS = ('#999999', '#E69F00', '#009E73', '#CC79A7', '#56B4E9', '#0072B2')

QUANTILES = (0.05, 0.5, 0.95)


def draw_steps(results: Mapping[str, Result], path: Path) -> None:
    """Draw step responses: median and 5 to 95 % of the trials.

    Parameters
    ----------
    results : mapping of str to Result
        Results by name of controller.
    path : Path
        PNG file to write.
    """
    figure = Figure(figsize=(13, 6), layout='constrained')
    axes = figure.subplots(2, 3, sharex=True, sharey=True).flat
    for (name, result), axis in zip(results.items(), axes, strict=False):
        t = np.arange(result.responses.shape[2]) * DT
        for kind, colour, label in ((0, '#E69F00', 'with noise'), (1, '#0072B2', 'without')):
            low, middle, high = np.quantile(result.responses[:, kind], QUANTILES, axis=0)
            axis.fill_between(t, low, high, color=colour, alpha=0.3, lw=0)
            axis.plot(t, middle, color=colour, label=label)
        axis.axhline(STEP, color='#444444', lw=0.8, ls='--')
        axis.set_title(name)
        axis.set_ylim(-0.02, 0.12)
        axis.grid(alpha=0.25)
    for axis in figure.axes[len(results) :]:
        axis.set_visible(False)
    figure.axes[0].legend(fontsize=8, loc='lower right')
    figure.supxlabel('time after the step, s')
    figure.supylabel('change of slip, mean of the wheels')
    figure.savefig(path, dpi=90)


def draw_distributions(results: Mapping[str, Result], path: Path) -> None:
    """Draw distributions of settling time, overshoot, slip error and peak over all trials.

    Parameters
    ----------
    results : mapping of str to Result
        Results by name of controller.
    path : Path
        PNG file to write.
    """
    figure = Figure(figsize=(13, 3.6), layout='constrained')
    kinds = (
        ('settling_noise_free', 'settling time without noise, s', STEP_WINDOW),
        ('overshoot', 'overshoot with noise, share of the step', 2.0),
        ('rmse', 'slip RMSE', 0.3),
        ('peak', 'peak of slip after tau_max halves', 1.0),
    )
    for (kind, label, most), axis in zip(kinds, figure.subplots(1, 4, sharey=True), strict=True):
        for (name, result), colour in zip(results.items(), COLOURS, strict=False):
            values = np.sort(result.columns[kind])
            shares = np.arange(1, len(values) + 1) / len(values)
            finite = np.isfinite(values)
            axis.step(values[finite], shares[finite], where='post', color=colour, label=name)
        axis.set_xlim(0, most)
        axis.set_xlabel(label)
        axis.grid(alpha=0.25)
    figure.axes[0].set_ylabel('share of trials')
    figure.axes[0].legend(fontsize=8)
    figure.savefig(path, dpi=90)


def draw_scenarios(
    drives: Mapping[tuple[str, str], Drive], shown: Sequence[str], path: Path
) -> None:
    """Draw slip of all wheels and speed, one row per scenario and one column per controller.

    Parameters
    ----------
    drives : mapping of (str, str) to Drive
        Drives by names of scenario and controller.
    shown : sequence of str
        Controllers to show.
    path : Path
        PNG file to write.
    """
    names = list(SCENARIOS)
    limit = shipped_parameters()['slip_controller']['slip_target']
    figure = Figure(figsize=(15, 2.4 * len(names)), layout='constrained')
    axes = figure.subplots(len(names), len(shown) + 1, sharex='row', squeeze=False)
    for name, row in zip(names, axes, strict=True):
        for text, colour, axis in zip(shown, COLOURS, row, strict=False):
            drive = drives[name, text]
            for j, style in enumerate(('-', '-', '--', '--')):
                axis.plot(drive.t, drive.slip[:, j], style, lw=1, color=COLOURS[-1 - j])
            axis.axhline(limit, color='#444444', lw=0.8, ls=':')
            axis.set_ylim(-0.05, 1.0)
            row[-1].plot(drive.t, drive.v, color=colour, label=text)
        for axis in row:
            axis.axvline(SCENARIOS[name].happens, color='#bbbbbb', lw=0.8)
            axis.grid(alpha=0.25)
        row[0].set_ylabel(f'{name.replace("_", " ")}\nslip')
        row[-1].set_ylabel('speed, m/s')
    for text, axis in zip(shown, axes[0], strict=False):
        axis.set_title(text)
    for axis in axes[-1]:
        axis.set_xlabel('time, s')
    axes[0, -1].legend(fontsize=8)
    figure.savefig(path, dpi=80)
