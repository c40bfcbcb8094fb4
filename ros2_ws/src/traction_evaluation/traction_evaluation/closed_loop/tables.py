"""Tables of the report on slip control."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from traction_evaluation.closed_loop.closed_loop import Drive
from traction_evaluation.closed_loop.controllers import REASONS, Controller
from traction_evaluation.closed_loop.scenario import SCENARIOS
from traction_evaluation.closed_loop.statistics import Result, quantile, seconds
from traction_evaluation.closed_loop.trial import TrialDraw
from traction_evaluation.loop.shipped import differences, shipped_parameters
from traction_evaluation.markdown import table

Array = NDArray[np.float64]

HEADINGS = (
    'stable, %', 'settling without noise, 50 %, s', 'less lag, 75 %, s', 'less lag, 95 %, s',
    'all wheels throughout, less lag, 95 %, s', 'settling with noise, 50 %, s',
    'less lag, 95 %, s', 'overshoot without noise, 95 %, %', 'with noise', 'slip RMSE',
    'RMSE 50 %', 'RMSE before tau_max halves', 'peak 50 %', 'peak 95 %', 'work per energy',
    'estimate RMSE 50 %',
)  # fmt: skip

PART_HEADINGS = (
    'stable, %', 'settling without noise less lag, 95 %, s', 'overshoot without noise 95 %, %',
    'slip RMSE', 'estimate RMSE 50 %',
)  # fmt: skip


def figure_row(result: Result) -> list[str]:
    """Row of the table of all controllers.

    Parameters
    ----------
    result : Result
        Result of one controller.

    Returns
    -------
    list of str
        Cells as in `HEADINGS`.
    """
    c = result.columns
    return [
        f'{100 * result.stable:.1f}',
        seconds(quantile(c['settling_noise_free'], 0.5)),
        seconds(result.settling_beyond_lag('settling_noise_free', 0.75)),
        seconds(result.settling_beyond_lag('settling_noise_free')),
        seconds(result.settling_beyond_lag('settling_throughout')),
        seconds(quantile(c['settling'], 0.5)),
        seconds(result.settling_beyond_lag()),
        f'{100 * quantile(c["overshoot_noise_free"], 0.95):.0f}',
        f'{100 * quantile(c["overshoot"], 0.95):.0f}',
        f'{result.rmse:.4f}',
        f'{quantile(c["rmse"], 0.5):.4f}',
        f'{np.sqrt(np.mean(c["rmse_before"] ** 2)):.4f}',
        f'{quantile(c["peak"], 0.5):.2f}',
        f'{quantile(c["peak"], 0.95):.2f}',
        f'{result.efficiency:.4f}',
        f'{quantile(c["estimate_rmse"], 0.5):.4f}',
    ]


def part_rows(
    results: Mapping[str, Result], values: Array, ends: Array, digits: int
) -> list[list[str]]:
    """Rows of controllers by ranges of a drawn value.

    Parameters
    ----------
    results : mapping of str to Result
        By name of the controller.
    values : ndarray, shape (k,)
        Drawn value of every trial.
    ends : ndarray, shape (m,)
        Ends of the ranges, increasing, in the unit of `values`.
    digits : int
        Decimals of the printed ends.

    Returns
    -------
    list of list of str
        Cells as in `PART_HEADINGS`, after name and range.
    """
    rows = []
    for name, result in results.items():
        for low, high in pairwise(ends):
            part = result.part((values >= low) & (values < high))
            if not len(part.lags):
                continue
            rows.append(
                [
                    name,
                    f'{low:.{digits}f} to {high:.{digits}f}',
                    f'{100 * part.stable:.1f}',
                    seconds(part.settling_beyond_lag('settling_noise_free')),
                    f'{100 * quantile(part.columns["overshoot_noise_free"], 0.95):.0f}',
                    f'{part.rmse:.4f}',
                    f'{quantile(part.columns["estimate_rmse"], 0.5):.4f}',
                ]
            )
    return rows


def worst_table(result: Result, draws: Sequence[TrialDraw], count: int = 8) -> str:
    """Table of the trials with the largest slip error, with their draws.

    Parameters
    ----------
    result : Result
        Of one controller.
    draws : sequence of TrialDraw
        Draws, in the order of the trials.
    count : int
        Number of trials.

    Returns
    -------
    str
        Markdown table.
    """
    order = np.argsort(result.columns['rmse'])[::-1][:count]
    rows = []
    for k in order:
        drawn = asdict(draws[k])
        drawn.pop('seed')
        rows.append(
            [f'{result.columns["rmse"][k]:.3f}', f'{result.columns["estimate_rmse"][k]:.3f}']
            + [f'{value:.3g}' for value in drawn.values()]
        )
    return table(('RMSE', "estimate's", *drawn), rows)


def scenario_table(drives: Mapping[tuple[str, str], Drive]) -> str:
    """Table of the scenarios.

    Parameters
    ----------
    drives : mapping of (str, str) to Drive
        By names of scenario and controller.

    Returns
    -------
    str
        Markdown table.
    """
    limit = shipped_parameters()['slip_controller']['slip_target']
    rows = []
    for (name, text), drive in drives.items():
        judged = drive.t >= SCENARIOS[name].happens
        above = np.maximum(drive.slip[judged] - limit, 0.0)
        work, energy = drive.efficiency(SCENARIOS[name].happens)
        rows.append(
            [
                SCENARIOS[name].text,
                text,
                f'{np.sqrt(np.mean(above**2)):.4f}',
                f'{drive.slip[judged].max():.2f}',
                f'{drive.x[-1] - drive.x[judged][0]:.1f}',
                f'{1e-3 * energy / (drive.x[-1] - drive.x[judged][0]):.1f}',
                f'{work / energy:.3f}',
            ]
        )
    headings = (
        'what happens', 'controller', 'RMS above the limit', 'largest slip', 'distance, m',
        'energy, kJ/m', 'work per energy',
    )  # fmt: skip
    return table(headings, rows)


def parameter_table(controllers: Sequence[Controller]) -> str:
    """Table of the parameters of controllers, as differences from the shipped ones.

    Parameters
    ----------
    controllers : sequence of Controller
        Controllers of the report.

    Returns
    -------
    str
        Markdown table: parameter, as shipped, as run, controllers, reason.
    """
    shipped = shipped_parameters()
    # One row for each change, with all its controllers.
    rows: dict[tuple[str, str, str, str], list[str]] = {}
    for controller in controllers:
        changed = differences(controller.parameters)
        if controller.pulses_told:
            changed['slip_estimator.tachometer_pulses'] = 'as drawn'
        for name, value in changed.items():
            node, _, parameter = name.partition('.')
            row = f'`{name}`', f'{shipped[node][parameter]}', f'{value}', REASONS[name]
            rows.setdefault(row, []).append(controller.text)
        if controller.perfect:
            why = 'tells errors of control from those of estimation'
            rows.setdefault(('estimator', 'VehicleEstimator', 'true slip', why), []).append(
                controller.text
            )
    return table(
        ('parameter', 'as shipped', 'as run', 'controllers', 'why'),
        [
            [*row[:3], 'all' if len(names) == len(controllers) else '; '.join(names), row[3]]
            for row, names in sorted(rows.items(), key=lambda each: each[0][0])
        ],
    )
