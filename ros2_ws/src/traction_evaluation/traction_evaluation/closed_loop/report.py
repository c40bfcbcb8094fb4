"""Evaluate slip control in closed loop, and slip estimation: `make evaluate`.

Writes docs/control.md and its pictures, prints what is met and what is not, and ends with status
2 where a target is missed.
"""

import argparse
import copy
import math
import multiprocessing
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from string import Template
from typing import NamedTuple

# One thread a process: all cores are busy with draws.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
os.environ.setdefault('OMP_NUM_THREADS', '1')

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from traction_controller.control.slip_control import Mode, SlipControl
from traction_controller.estimation.slip_filter import GUESSED_SOIL, SlipFilter
from traction_controller.synthesis.certificate import DENSER
from traction_controller.synthesis.gain_table import read_gain_table, read_table_file
from traction_evaluation.baselines.laws import ALL_LAWS
from traction_evaluation.closed_loop import scenario, trial
from traction_evaluation.closed_loop.closed_loop import DT
from traction_evaluation.estimation import field_data as field_data
from traction_evaluation.estimation import report as evaluate_estimation
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import load_vehicle

ROOT = Path()

VEHICLE = 'tractor_4wd'
SOIL = 'sandy_loam_chrono'
METHOD = 'ekf'
"""Kalman filter of the trials: the quickest; section 5 of the report compares them."""

LAG = 0.2
"""What the controls take the drive's lag for, s: the middle of what is drawn."""

GAINS = ROOT / 'ros2_ws/src/traction_controller/config/gains' / f'{VEHICLE}.yaml'
"""Gain table of the LPV controller."""

HOLD_TORQUE = 2.0
"""Largest torque in hold, as a share of static load times radius: never the limit."""

CHUNK = 4

# Targets of the LPV controller.
MAX_SETTLING = 1.0
MAX_OVERSHOOT = 0.2
RMSE_SHARE = 0.5

# Fixed PI: gains that are tried, as shares of static load times radius, 1 and 1/s.
PI_GAINS = ((0.1, 0.2, 0.4, 0.8, 1.2, 1.6, 2.4), (0.4, 0.8, 1.6, 2.4, 3.2, 4.8, 6.4))
QUICK_PI_GAINS = ((0.4, 1.2), (1.6, 3.2))
SHORTLIST = 4
TUNING_DRAWS = 128
DRAWS = 2048

QUANTILES = (0.05, 0.5, 0.95)


@dataclass(frozen=True)
class Controller:
    """A control law with its settings, and what it sees.

    Attributes
    ----------
    text : str
        Its name in the report.
    law : str
        Name of the law.
    settings : tuple of (str, float)
        Settings of the law by name.
    truth : bool
        Whether it sees the true slip in place of an estimate.
    table : str
        File of its gain table, where it has one.
    """

    text: str
    law: str
    settings: tuple[tuple[str, float], ...] = ()
    truth: bool = False
    table: str = ''


class Outcome(NamedTuple):
    """Figures of a trial, and the mean answers of its wheels, with sensor noise and without."""

    figures: trial.Figures
    responses: np.ndarray


@cache
def _nominal():
    return load_vehicle(VEHICLE), load_soil(SOIL)


@cache
def _control(controller, mode, target):
    """Control of a controller; copied for use, as some take long to make."""
    vehicle, _ = _nominal()
    loads = vehicle.static_loads()
    hold = [
        HOLD_TORQUE * float(load) * wheel.radius
        for load, wheel in zip(loads, vehicle.wheels, strict=True)
    ]
    settings = {controller.law: dict(controller.settings)}
    if controller.table:
        settings[controller.law]['gain_table'] = read_gain_table(controller.table, vehicle, DT)
    return SlipControl(
        vehicle, target, mode, lag=LAG, dt=DT, law=controller.law, settings=settings,
        laws=ALL_LAWS, hold_torque=hold,
    )  # fmt: skip


def control(controller, mode=Mode.HOLD, target=trial.TARGET):
    """Slip control of a controller, its memory empty."""
    return copy.deepcopy(_control(controller, mode, target))


def estimation(controller, pulses_per_turn):
    """What a controller sees: an estimation that knows the nominal vehicle and its sensors."""
    vehicle, soil = _nominal()
    if controller.truth:
        return None
    return SlipFilter(
        vehicle, soil, GUESSED_SOIL, method=METHOD, tachometer_pulses=pulses_per_turn
    )


def run_draws(controller, draws, quiet=True):
    """Drive trials."""
    vehicle, soil = _nominal()
    outcomes = []
    for draw in draws:
        driven = trial.run_trial(
            draw,
            vehicle,
            soil,
            lambda draw: estimation(controller, draw.pulses_per_turn),
            lambda draw: control(controller),
            quiet,
        )
        answers = np.array([driven.noisy_answer, driven.quiet_answer])
        outcomes.append(Outcome(driven.figures, answers))
    return outcomes


class Workers:
    """Processes on all cores that drive trials.

    Parameters
    ----------
    console : Console
        Where progress is shown.
    """

    def __init__(self, console):
        self._console = console
        self._pool = ProcessPoolExecutor(
            len(os.sched_getaffinity(0)), mp_context=multiprocessing.get_context('spawn')
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._pool.shutdown(cancel_futures=True)

    def map(self, text, function, work):
        """Values of a function for many sets of arguments, in their order."""
        found = []
        with Progress(console=self._console, transient=True) as progress:
            task = progress.add_task(text, total=len(work))
            for value in self._pool.map(function, *zip(*work, strict=True)):
                found.append(value)
                progress.advance(task)
        return found

    def run(self, text, jobs, quiet=True):
        """Drive the trials of several controllers: outcomes of each, in the order of draws."""
        chunks = [
            (controller, draws[k : k + CHUNK])
            for controller, draws in jobs
            for k in range(0, len(draws), CHUNK)
        ]
        found = {controller: [] for controller, _ in jobs}
        with Progress(console=self._console, transient=True) as progress:
            task = progress.add_task(text, total=sum(len(draws) for _, draws in chunks))
            for (controller, draws), outcomes in zip(
                chunks,
                self._pool.map(partial(run_draws, quiet=quiet), *zip(*chunks, strict=True)),
                strict=True,
            ):
                found[controller] += outcomes
                progress.advance(task, len(draws))
        return found


@dataclass
class Result:
    """What came of all trials of one controller.

    Attributes
    ----------
    columns : dict of str to ndarray
        Figures by name.
    responses : ndarray, shape (k, 2, samples)
        Mean answers to the step, with sensor noise and without.
    lags : ndarray, shape (k,)
        Lag of each draw, s.
    """

    columns: dict = field(default_factory=dict)
    responses: np.ndarray = field(default_factory=lambda: np.empty((0, 2, 0)))
    lags: np.ndarray = field(default_factory=lambda: np.empty(0))

    @classmethod
    def of(cls, outcomes, draws):
        """Gather outcomes."""
        return cls(
            trial.columns([each.figures for each in outcomes]),
            np.array([each.responses for each in outcomes]),
            np.array([draw.lag for draw in draws]),
        )

    @property
    def stable(self):
        """Share of stable trials."""
        return float(self.columns['stable'].mean())

    @property
    def rmse(self):
        """Root mean square slip error over all trials."""
        return float(np.sqrt(np.mean(self.columns['rmse'] ** 2)))

    def settling_beyond_lag(self, kind='settling', share=0.95):
        """Percentile of settling time less the draw's own lag, s."""
        return quantile(self.columns[kind] - self.lags, share)

    @property
    def efficiency(self):
        """Tractive work over shaft energy, summed over all trials."""
        return float(self.columns['work'].sum() / self.columns['energy'].sum())

    def part(self, chosen):
        """Result of some of the trials."""
        columns = {name: values[chosen] for name, values in self.columns.items()}
        return Result(columns, self.responses[chosen], self.lags[chosen])


def quantile(values, share):
    """Quantile that is one of the values: some are infinite."""
    return float(np.quantile(values, share, method='higher'))


def seconds(value):
    """A time as text; one that never came is longer than was looked."""
    return f'{value:.2f}' if math.isfinite(value) else f'> {trial.STEP_WINDOW:g}'


def table(headings, rows):
    """Markdown table."""
    lines = ['| ' + ' | '.join(headings) + ' |', '|---' * len(headings) + '|']
    return '\n'.join(lines + ['| ' + ' | '.join(row) + ' |' for row in rows])


def verdict_table(verdict):
    """Markdown table of targets."""
    rows = [[t, found, limit, 'met' if met else '**missed**'] for t, found, limit, met in verdict]
    return table(('target', 'found', 'limit', ''), rows)


def tune_pi(workers, draws, gains):
    """Find the fixed PI gains of least slip error among those most often stable.

    All are tried on a quarter of the draws, the best of them on all.
    """
    tried = [
        Controller('PI', 'pi', (('proportional', p), ('integral', i)))
        for p in gains[0]
        for i in gains[1]
    ]
    few = draws[: max(1, len(draws) // 4)]

    def worth(result):
        return -result.stable, result.rmse

    found = workers.run('tuning the fixed PI', [(each, few) for each in tried], False)
    first = {each: Result.of(outcomes, few) for each, outcomes in found.items()}
    # Those that may be the best, whether stability comes first or not.
    short = sorted(tried, key=lambda each: worth(first[each]))[:SHORTLIST]
    short += sorted(tried, key=lambda each: first[each].rmse)[:SHORTLIST]
    short = list(dict.fromkeys(short))
    found = workers.run('tuning the fixed PI', [(each, draws) for each in short], False)
    results = {each: Result.of(outcomes, draws) for each, outcomes in found.items()}
    best = min(results, key=lambda each: worth(results[each]))
    least = min(results, key=lambda each: results[each].rmse)
    return best, results[best], least, results[least]


def gains_text(controller, result):
    """Gains of a fixed PI and what they are worth, in words."""
    gains = dict(controller.settings)
    return (
        f'proportional {gains["proportional"]:g} and integral {gains["integral"]:g} per second: '
        f'{100 * result.stable:.0f} % stable, slip RMSE {result.rmse:.4f}'
    )


def figure_row(result):
    """Cells of a row of the table of all controllers."""
    c = result.columns
    return [
        f'{100 * result.stable:.1f}',
        seconds(quantile(c['settling_quiet'], 0.5)),
        seconds(result.settling_beyond_lag('settling_quiet', 0.75)),
        seconds(result.settling_beyond_lag('settling_quiet')),
        seconds(result.settling_beyond_lag('settling_throughout')),
        seconds(quantile(c['settling'], 0.5)),
        seconds(result.settling_beyond_lag()),
        f'{100 * quantile(c["overshoot_quiet"], 0.95):.0f}',
        f'{100 * quantile(c["overshoot"], 0.95):.0f}',
        f'{result.rmse:.4f}',
        f'{quantile(c["rmse"], 0.5):.4f}',
        f'{np.sqrt(np.mean(c["rmse_before"] ** 2)):.4f}',
        f'{quantile(c["peak"], 0.5):.2f}',
        f'{quantile(c["peak"], 0.95):.2f}',
        f'{result.efficiency:.4f}',
        f'{quantile(c["estimate_rmse"], 0.5):.4f}',
    ]


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

FIELD_HEADING = '## 6. Field data\n'

COLOURS = ('#999999', '#E69F00', '#009E73', '#CC79A7', '#56B4E9', '#0072B2')


def controllers(fixed_pi):
    """All controllers, the one that the targets are for last."""
    return [
        Controller('fixed PI', 'pi', fixed_pi.settings),
        Controller('scheduled PI', 'scheduled_pi'),
        Controller('sliding mode', 'sliding_mode'),
        Controller('LQI', 'lqi'),
        Controller('LPV', 'lpv', table=str(GAINS)),
    ]


def certificate_check():
    """Target of the certificate: it holds on a grid denser than that of the synthesis."""
    try:
        _, margins = read_table_file(GAINS, DENSER)
    except ValueError as error:
        found, met = str(error), False
    else:
        found = f'least margin {margins.least:.2e} of {margins.points} inequalities'
        met = margins.least >= 0
    return f'certificate on a grid {DENSER} times denser', found, 'at least 0', met


def checks(results):
    """Targets of the LPV controller: what, found, limit as text, and whether it is met."""
    lpv = results['LPV']
    others = {name: each for name, each in results.items() if name != 'LPV'}
    pi = results['fixed PI']
    best = max(each.efficiency for each in others.values())
    answers = []
    for noise, suffix in (('without sensor noise', '_quiet'), ('with sensor noise', '')):
        settling = lpv.settling_beyond_lag(f'settling{suffix}')
        over = quantile(lpv.columns[f'overshoot{suffix}'], 0.95)
        answers += [
            (
                f'settling of a 0.05 step less the lag, 95th percentile, {noise}',
                f'{seconds(settling)} s',
                f'at most {MAX_SETTLING:g} s',
                settling <= MAX_SETTLING,
            ),
            (
                f'overshoot, 95th percentile, {noise}',
                f'{100 * over:.1f} %',
                f'at most {100 * MAX_OVERSHOOT:g} %',
                over <= MAX_OVERSHOOT,
            ),
        ]
    return [
        certificate_check(),
        ('stable', f'{100 * lpv.stable:.2f} %', '100 %', lpv.stable == 1.0),
        *answers,
        (
            "slip RMSE over the best fixed PI's",
            f'{lpv.rmse / pi.rmse:.3f}',
            f'at most {RMSE_SHARE:g}',
            lpv.rmse <= RMSE_SHARE * pi.rmse,
        ),
        (
            "tractive work per energy less the best baseline's",
            f'{lpv.efficiency - best:+.4f}',
            'at least 0',
            lpv.efficiency >= best,
        ),
    ]


def draw_steps(results, path):
    """Answers to the step: median and 5 to 95 % of the trials."""
    figure = Figure(figsize=(13, 6), layout='constrained')
    axes = figure.subplots(2, 3, sharex=True, sharey=True).flat
    for (name, result), axis in zip(results.items(), axes, strict=False):
        t = np.arange(result.responses.shape[2]) * DT
        for kind, colour, label in ((0, '#E69F00', 'with noise'), (1, '#0072B2', 'without')):
            low, middle, high = np.quantile(result.responses[:, kind], QUANTILES, axis=0)
            axis.fill_between(t, low, high, color=colour, alpha=0.3, lw=0)
            axis.plot(t, middle, color=colour, label=label)
        axis.axhline(trial.STEP, color='#444444', lw=0.8, ls='--')
        axis.set_title(name)
        axis.set_ylim(-0.02, 0.12)
        axis.grid(alpha=0.25)
    for axis in figure.axes[len(results) :]:
        axis.set_visible(False)
    figure.axes[0].legend(fontsize=8, loc='lower right')
    figure.supxlabel('time after the step, s')
    figure.supylabel('change of slip, mean of the wheels')
    figure.savefig(path, dpi=90)


def draw_distributions(results, path):
    """Distribution of settling time, overshoot, slip error and peak over all trials."""
    figure = Figure(figsize=(13, 3.6), layout='constrained')
    kinds = (
        ('settling_quiet', 'settling time without noise, s', trial.STEP_WINDOW),
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


def run_scenarios(chosen, progress):
    """Drive every scenario without control and with each controller."""
    vehicle, _ = _nominal()
    found = {}
    for name in scenario.SCENARIOS:
        for controller in (None, *chosen):
            acting = None if controller is None else control(
                controller, Mode.LIMIT, scenario.LIMIT
            )  # fmt: skip
            seen = None if controller is None else estimation(
                controller, scenario.SENSORS.pulses_per_turn
            )  # fmt: skip
            text = 'no control' if controller is None else controller.text
            found[name, text] = scenario.run_scenario(name, vehicle, seen, acting)
            progress()
    return found


def scenario_rows(drives):
    """Rows of the table of scenarios."""
    rows = []
    for (name, text), drive in drives.items():
        judged = drive.t >= scenario.SCENARIOS[name].happens
        above = np.maximum(drive.slip[judged] - scenario.LIMIT, 0.0)
        work, energy = drive.efficiency(scenario.SCENARIOS[name].happens)
        rows.append(
            [
                scenario.SCENARIOS[name].text,
                text,
                f'{np.sqrt(np.mean(above**2)):.4f}',
                f'{drive.slip[judged].max():.2f}',
                f'{drive.x[-1] - drive.x[judged][0]:.1f}',
                f'{1e-3 * energy / (drive.x[-1] - drive.x[judged][0]):.1f}',
                f'{work / energy:.3f}',
            ]
        )
    return rows


def draw_scenarios(drives, shown, path):
    """Slip of all wheels, one row a scenario and one column a controller, and the speeds."""
    names = list(scenario.SCENARIOS)
    figure = Figure(figsize=(15, 2.4 * len(names)), layout='constrained')
    axes = figure.subplots(len(names), len(shown) + 1, sharex='row', squeeze=False)
    for name, row in zip(names, axes, strict=True):
        for text, colour, axis in zip(shown, COLOURS, row, strict=False):
            drive = drives[name, text]
            for j, style in enumerate(('-', '-', '--', '--')):
                axis.plot(drive.t, drive.slip[:, j], style, lw=1, color=COLOURS[-1 - j])
            axis.axhline(scenario.LIMIT, color='#444444', lw=0.8, ls=':')
            axis.set_ylim(-0.05, 1.0)
            row[-1].plot(drive.t, drive.v, color=colour, label=text)
        for axis in row:
            axis.axvline(scenario.SCENARIOS[name].happens, color='#bbbbbb', lw=0.8)
            axis.grid(alpha=0.25)
        row[0].set_ylabel(f'{name.replace("_", " ")}\nslip')
        row[-1].set_ylabel('speed, m/s')
    for text, axis in zip(shown, axes[0], strict=False):
        axis.set_title(text)
    for axis in axes[-1]:
        axis.set_xlabel('time, s')
    axes[0, -1].legend(fontsize=8)
    figure.savefig(path, dpi=80)


def part_rows(results, values, ends, digits):
    """Rows of all controllers in ranges of something drawn."""
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
                    seconds(part.settling_beyond_lag('settling_quiet')),
                    f'{100 * quantile(part.columns["overshoot_quiet"], 0.95):.0f}',
                    f'{part.rmse:.4f}',
                    f'{quantile(part.columns["estimate_rmse"], 0.5):.4f}',
                ]
            )
    return rows


def worst_rows(result, draws, count=8):
    """The trials of greatest slip error, with what was drawn."""
    order = np.argsort(result.columns['rmse'])[::-1][:count]
    rows = []
    for k in order:
        drawn = asdict(draws[k])
        drawn.pop('seed')
        rows.append(
            [f'{result.columns["rmse"][k]:.3f}', f'{result.columns["estimate_rmse"][k]:.3f}']
            + [f'{value:.3g}' for value in drawn.values()]
        )
    return ('RMSE', "estimate's", *drawn), rows


def field_part(console):
    """Section of the field data, and its targets; without the data it stays as it was."""
    said = field_data.missing()
    if said:
        console.print(f'field data: section left as it was: {said}', soft_wrap=True)
        written = (ROOT / 'docs' / 'control.md').read_text(encoding='utf-8')
        _, _, section = written.partition(FIELD_HEADING)
        return section.partition('\n## ')[0].strip(), []
    values, verdict = evaluate_estimation.field_section(table)
    values['checks'] = verdict_table(verdict)
    return template('field', **values).strip(), verdict


def time_steps(every):
    """Times of a step of every controller and of estimation, and their targets."""
    vehicle, soil = _nominal()
    rows, times = [], {}
    loads = vehicle.static_loads().tolist()
    rims, torques = [2.4] * 4, [1000.0, 1000.0, 4000.0, 4000.0]
    for controller in every:
        acting = control(controller)

        def step(acting=acting):
            acting.step(
                DT, [0.14, 0.16, 0.15, 0.15], [True] * 4, rims, 2.0, loads, torques, torques,
                gross_tractions=loads,
            )  # fmt: skip

        times[controller.text] = evaluate_estimation.step_time(step)
        rows.append([controller.text, f'{1e6 * times[controller.text]:.0f}'])
    sees = SlipFilter(vehicle, soil, method=METHOD)
    speeds = np.array(rims) / [wheel.radius for wheel in vehicle.wheels]
    t = 0.0

    def estimate():
        nonlocal t
        t += DT
        sees.wheel_states(t, speeds, torques)
        sees.radar(t, 2.0, 0.0025)

    times['estimation'] = evaluate_estimation.step_time(estimate)
    rows.append(['estimation, wheels and radar', f'{1e6 * times["estimation"]:.0f}'])
    return rows, [
        (
            f'{what}: step of four wheels',
            f'{1e6 * times[name]:.0f} us',
            f'at most {1e6 * most:g} us',
            times[name] <= most,
        )
        for what, name, most in (
            ('LPV controller', 'LPV', evaluate_estimation.CONTROL_STEP),
            ('estimation', 'estimation', evaluate_estimation.ESTIMATION_STEP),
        )
    ]


def template(name, **values):
    """Text of a template beside this file, filled in."""
    package = Path(__file__).parents[1]
    text = next(package.glob(f'*/{name}.template.md')).read_text(encoding='utf-8')
    return Template(text).substitute(values)


def main(arguments=None):
    """Run everything and write the report."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', 1)[0])
    parser.add_argument('--docs', type=Path, default=ROOT / 'docs', help='folder to write to')
    parser.add_argument('--draws', type=int, help=f'trials, a power of 2 ({DRAWS})')
    parser.add_argument('--tuning-draws', type=int, help='trials that the fixed PI is tuned on, '
                        f'a power of 2 ({TUNING_DRAWS})')  # fmt: skip
    parser.add_argument('--seed', type=int, default=1, help='seed of the draws')
    parser.add_argument('--quick', action='store_true',
                        help='a look: 16 trials, and four fixed PIs on 4')  # fmt: skip
    chosen = parser.parse_args(arguments)
    usual = (16, 4) if chosen.quick else (DRAWS, TUNING_DRAWS)
    given = (chosen.draws, chosen.tuning_draws)
    counts = [u if g is None else g for u, g in zip(usual, given, strict=True)]
    try:
        draws = trial.draws(counts[0], chosen.seed)
        # Others than those that are judged.
        tuning = trial.draws(counts[1], chosen.seed + 1)
    except ValueError as error:
        parser.error(str(error))
    pi_gains = QUICK_PI_GAINS if chosen.quick else PI_GAINS
    docs = chosen.docs
    # A file has no width of its own.
    console = Console(width=None if sys.stdout.isatty() else 190)
    (docs / 'images').mkdir(parents=True, exist_ok=True)

    with Workers(console) as workers:
        best, tuned, least, min_tuned = tune_pi(workers, tuning, pi_gains)
        console.print(f'fixed PI: {gains_text(best, tuned)}')
        console.print(f'of the least slip RMSE: {gains_text(least, min_tuned)}')
        every = controllers(best)
        seeing = replace(every[-1], text='LPV, true slip', truth=True)
        quarter = draws[: max(1, len(draws) // 4)]
        found = workers.run(
            'trials', [*((each, draws) for each in every), (seeing, quarter)]
        )  # fmt: skip
        bag_values, bag_verdict = evaluate_estimation.bags_section(
            table, workers.map, chosen.quick
        )
    results = {each.text: Result.of(found[each], draws) for each in every}
    perfect = Result.of(found[seeing], quarter)

    with Progress(console=console, transient=True) as progress:
        task = progress.add_task('scenarios', total=len(scenario.SCENARIOS) * (len(every) + 1))
        drives = run_scenarios(every, lambda: progress.advance(task))

    images = docs / 'images'
    draw_steps(results, images / 'control_steps.png')
    draw_distributions(results, images / 'control_distributions.png')
    draw_scenarios(drives, ('no control', 'fixed PI', 'LPV'), images / 'control_scenarios.png')

    all_rows = [[name, *figure_row(result)] for name, result in results.items()]
    all_rows.append([seeing.text, *figure_row(perfect)])
    summary = Table(title=f'{len(draws)} trials')
    for heading in ('', *HEADINGS):
        summary.add_column(heading, justify='right' if heading else 'left')
    for row in all_rows:
        summary.add_row(*row)
    console.print(summary)
    verdict = checks(results)
    field_values, field_verdict = field_part(console)
    step_rows, step_verdict = time_steps(every)
    for text, value, limit, met in (*verdict, *bag_verdict, *field_verdict, *step_verdict):
        console.print(
            f'{"met   " if met else "MISSED"} {text}: {value} ({limit})', highlight=False
        )

    speeds = np.array([draw.speed for draw in draws])
    ends = np.linspace(*trial.DISTRIBUTIONS['speed'].uniform, 5)
    speed_rows = part_rows(results, speeds, ends, 1)
    pulses = np.array([draw.pulses_per_turn for draw in draws])
    ends = np.geomspace(*trial.DISTRIBUTIONS['pulses_per_turn'].log_uniform, 5)
    pulse_rows = part_rows({'LPV': results['LPV']}, pulses, ends, 0)
    worst_headings, worst = worst_rows(results['LPV'], draws)
    text = template(
        'control',
        draws=len(draws),
        seed=chosen.seed,
        target=f'{trial.TARGET:g}',
        step=f'{trial.STEP:g}',
        first_step=f'{trial.FIRST_STEP:g}',
        settle=f'{trial.SETTLE:g}',
        under_way=f'{trial.UNDER_WAY:g}',
        window=f'{trial.STEP_WINDOW:g}',
        last=f'{trial.LAST:g}',
        drop_window=f'{trial.DROP_WINDOW:g}',
        min_draft=f'{trial.MIN_DRAFT:g}',
        error=f'{trial.LARGEST_ERROR:g}',
        runaway=f'{trial.RUNAWAY:g}',
        lag=f'{LAG:g}',
        method=METHOD.upper(),
        tuning=len(tuning),
        tried=len(pi_gains[0]) * len(pi_gains[1]),
        fixed_pi=gains_text(best, tuned),
        min_pi=gains_text(least, min_tuned),
        quarter=len(quarter),
        checks=verdict_table(verdict),
        field=field_values,
        bag_checks=verdict_table(bag_verdict),
        **bag_values,
        steps=table(('what', 'step, us'), step_rows),
        step_checks=verdict_table(step_verdict),
        all=table(('controller', *HEADINGS), all_rows),
        speeds=table(('controller', 'speed, m/s', *PART_HEADINGS), speed_rows),
        pulses=table(('controller', 'pulses a turn', *PART_HEADINGS), pulse_rows),
        worst=table(worst_headings, worst),
        scenarios=table(
            (
                'what happens',
                'controller',
                'RMS above the limit',
                'largest slip',
                'distance, m',
                'energy, kJ/m',
                'work per energy',
            ),
            scenario_rows(drives),
        ),
    )
    (docs / 'control.md').write_text(text, encoding='utf-8')
    console.print(f'report   {docs / "control.md"}', soft_wrap=True)
    met = [met for *_, met in (*verdict, *bag_verdict, *field_verdict, *step_verdict)]
    return 0 if all(met) else 2


if __name__ == '__main__':
    sys.exit(main())
