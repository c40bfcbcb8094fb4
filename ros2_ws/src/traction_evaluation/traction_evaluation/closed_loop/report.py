"""Report on slip control in closed loop and on estimation: docs/control.md with pictures."""

import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from traction_controller.control.slip_controller import SlipController
from traction_controller.control.slip_state import SlipState
from traction_evaluation.closed_loop import trial, trial_figures
from traction_evaluation.closed_loop.closed_loop import DT, Drive
from traction_evaluation.closed_loop.controllers import Controller, controllers, limiting
from traction_evaluation.closed_loop.pi_tuning import FEW_GAINS, GAINS, tune_pi
from traction_evaluation.closed_loop.pictures import (
    draw_distributions,
    draw_scenarios,
    draw_steps,
)
from traction_evaluation.closed_loop.scenario import SCENARIOS, SENSORS, run_scenario
from traction_evaluation.closed_loop.statistics import Result
from traction_evaluation.closed_loop.tables import (
    HEADINGS,
    PART_HEADINGS,
    figure_row,
    parameter_table,
    part_rows,
    scenario_table,
    worst_table,
)
from traction_evaluation.closed_loop.targets import control_targets
from traction_evaluation.closed_loop.workers import Workers
from traction_evaluation.estimation.report import (
    bags_section,
    field_section,
    step_time,
    step_time_targets,
)
from traction_evaluation.loop.shipped import VEHICLE, digest, shipped_parameters
from traction_evaluation.markdown import (
    Target,
    fill,
    replace_section,
    said,
    section,
    table,
    target_table,
)
from traction_model.vehicle.vehicle import load_vehicle

DRAWS, TUNING_DRAWS = 2048, 128
"""Numbers of trials of every controller, and of the tuning of the fixed PI."""

QUICK_DRAWS, QUICK_TUNING_DRAWS = 16, 4
"""The same numbers for a short run."""

ESTIMATION_HEADING = '## 5. Estimation on recorded runs'
FIELD_HEADING = '## 6. Field data'
DIGEST_LINE = 'Digest of the shipped parameters: '


def evaluate(
    docs: Path,
    bags: Path,
    field_data: Path | None = None,
    *,
    draws: int | None = None,
    tuning_draws: int | None = None,
    seed: int = 1,
    quick: bool = False,
) -> int:
    """Run the evaluation and write the report.

    Parameters
    ----------
    docs : Path
        Folder of ``control.md`` and of ``images``.
    bags : Path
        Folder of Project Chrono's bags.
    field_data : Path, optional
        Folder of the field data; without it their section is kept.
    draws, tuning_draws : int, optional
        Numbers of trials of every controller, and of the tuning of the fixed PI, powers of 2;
        default: `DRAWS` and `TUNING_DRAWS`.
    seed : int
        Seed of the draws, at least 0.
    quick : bool
        True for few trials, few gains and one Kalman filter.

    Returns
    -------
    int
        Exit status: 0, or 2 if a target is missed.

    Raises
    ------
    ValueError
        If a number of draws is no power of 2.
    """
    usual = (QUICK_DRAWS, QUICK_TUNING_DRAWS) if quick else (DRAWS, TUNING_DRAWS)
    drawn = trial.draws(usual[0] if draws is None else draws, seed)
    # Separate draws for the tuning.
    tuning = trial.draws(usual[1] if tuning_draws is None else tuning_draws, seed + 1)
    gains = FEW_GAINS if quick else GAINS
    # Output to a file has no terminal width.
    console = Console(width=None if sys.stdout.isatty() else 190)
    # Before the first file is written there.
    at_commit = commit(docs)
    images = docs / 'images'
    images.mkdir(parents=True, exist_ok=True)

    with Workers(console) as workers:
        best, least = tune_pi(workers, tuning, gains)
        console.print(f'fixed PI: {best.text}')
        console.print(f'of the least slip RMSE: {least.text}')
        every = controllers(best.controller)
        quarter = drawn[: max(1, len(drawn) // 4)]
        lpv = every[-1]
        others = [
            replace(lpv, text='LPV, pulses told', pulses_told=True),
            replace(lpv, text='LPV, true slip', perfect=True),
        ]
        found = workers.run(
            'trials', [*((each, drawn) for each in every), *((each, quarter) for each in others)]
        )
        bag_text, bag_targets = bags_section(bags, workers.map, at_commit, quick)
    results = {each.text: Result.of(found[each], drawn) for each in every}
    told = {each.text: Result.of(found[each], quarter) for each in others}

    with Progress(console=console, transient=True) as progress:
        task = progress.add_task('scenarios', total=len(SCENARIOS) * (len(every) + 1))
        drives = run_scenarios(every, lambda: progress.advance(task))

    draw_steps(results, images / 'control_steps.png')
    draw_distributions(results, images / 'control_distributions.png')
    draw_scenarios(drives, ('no control', 'fixed PI', 'LPV'), images / 'control_scenarios.png')

    rows = [[name, *figure_row(result)] for name, result in results.items()]
    told_rows = [[name, *figure_row(result)] for name, result in told.items()]
    summary = Table(title=f'{len(drawn)} trials, {len(quarter)} of those told more')
    for heading in ('', *HEADINGS):
        summary.add_column(heading, justify='right' if heading else 'left')
    for row in (*rows, *told_rows):
        summary.add_row(*row)
    console.print(summary)

    targets = control_targets(results)
    step_rows, step_targets = time_steps(every)
    field_targets: list[Target] = []
    if field_data is None:
        console.print('field data: section left as it was: none were given')
        field_text = section(docs / 'control.md', FIELD_HEADING)
    else:
        field_text, field_targets = field_section(field_data)
    reached = [*targets, *bag_targets, *field_targets, *step_targets]
    for line in said(reached):
        console.print(line, highlight=False)

    speeds = np.array([draw.speed for draw in drawn])
    speed_ends = np.linspace(*trial.SPEEDS, 5)
    pulses = np.array([draw.pulses_per_turn for draw in drawn])
    pulse_ends = np.geomspace(*trial.PULSES_PER_TURN, 5)
    judged = results['LPV']
    text = fill(
        Path(__file__).with_name('control.template.md'),
        commit=at_commit,
        digest=f'{DIGEST_LINE}`{digest()}`',
        parameters=parameter_table([*every, *others]),
        draws=len(drawn),
        seed=seed,
        target=f'{trial.TARGET:g}',
        step=f'{trial_figures.STEP:g}',
        first_step=f'{trial.FIRST_STEP:g}',
        settle=f'{trial.SETTLE:g}',
        under_way=f'{trial.UNDER_WAY:g}',
        window=f'{trial_figures.STEP_WINDOW:g}',
        last=f'{trial_figures.LAST:g}',
        drop_window=f'{trial.DROP_WINDOW:g}',
        min_draft=f'{trial.MIN_DRAFT:g}',
        error=f'{trial_figures.LARGEST_ERROR:g}',
        runaway=f'{trial_figures.RUNAWAY:g}',
        tuning=len(tuning),
        tried=len(gains[0]) * len(gains[1]),
        fixed_pi=best.text,
        min_pi=least.text,
        quarter=len(quarter),
        limit=f'{shipped_parameters()["slip_controller"]["slip_target"]:g}',
        pulses_per_turn=f'{SENSORS.pulses_per_turn:g}',
        checks=target_table(targets),
        field=field_text,
        estimation=bag_text,
        steps=table(('what', 'step, us'), step_rows),
        step_checks=target_table(step_targets),
        all=table(('controller', *HEADINGS), rows),
        told=table(('controller', *HEADINGS), told_rows),
        speeds=table(
            ('controller', 'speed, m/s', *PART_HEADINGS),
            part_rows(results, speeds, speed_ends, 1),
        ),
        pulses=table(
            ('controller', 'pulses a turn', *PART_HEADINGS),
            part_rows({'LPV': judged}, pulses, pulse_ends, 0),
        ),
        worst=worst_table(judged, drawn),
        scenarios=scenario_table(drives),
    )
    (docs / 'control.md').write_text(text, encoding='utf-8')
    console.print(f'report   {docs / "control.md"}', soft_wrap=True)
    return 0 if all(each.met for each in reached) else 2


def evaluate_estimation(docs: Path, bags: Path, *, quick: bool = False) -> int:
    """Evaluate only estimation on the bags, and rewrite that section of the report.

    Parameters
    ----------
    docs : Path
        Folder of ``control.md``.
    bags : Path
        Folder of Project Chrono's bags.
    quick : bool
        True: only the shipped Kalman filter.

    Returns
    -------
    int
        Exit status: 0, or 2 if a target is missed.

    Raises
    ------
    ValueError
        If the report does not exist, or was written with other parameters than the shipped ones.
    """
    report = docs / 'control.md'
    if not report.is_file() or written_digest(report) != digest():
        raise ValueError(
            f'{report} was not written with the shipped parameters: run the whole evaluation'
        )
    console = Console(width=None if sys.stdout.isatty() else 190)
    with Workers(console) as workers:
        text, targets = bags_section(bags, workers.map, commit(docs), quick)
    replace_section(report, ESTIMATION_HEADING, text)
    for line in said(targets):
        console.print(line, highlight=False)
    console.print(f'report   {report}', soft_wrap=True)
    return 0 if all(each.met for each in targets) else 2


def written_digest(report: Path) -> str:
    """Digest of the parameters in a report.

    Parameters
    ----------
    report : Path
        ``control.md``.

    Returns
    -------
    str
        The digest; empty if there is none.
    """
    for line in report.read_text(encoding='utf-8').splitlines():
        if line.startswith(DIGEST_LINE):
            return line.removeprefix(DIGEST_LINE).strip('`')
    return ''


def commit(folder: Path) -> str:
    """Commit of the repository of a folder.

    Parameters
    ----------
    folder : Path
        Folder in the repository.

    Returns
    -------
    str
        Abbreviated hash, with ``-dirty`` if files differ; `unknown` outside a repository.
    """
    try:
        done = subprocess.run(
            ['git', '-C', str(folder), 'describe', '--always', '--dirty', '--abbrev=12'],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return 'unknown'
    return done.stdout.strip()


def run_scenarios(
    chosen: Sequence[Controller], progress: Callable[[], None]
) -> dict[tuple[str, str], Drive]:
    """Run every scenario without control and with each controller in mode limit.

    Parameters
    ----------
    chosen : sequence of Controller
        Controllers to use.
    progress : callable
        Called after each drive.

    Returns
    -------
    dict of (str, str) to Drive
        Drives by names of scenario and controller.
    """
    vehicle = load_vehicle(VEHICLE)
    found = {}
    for name in SCENARIOS:
        found[name, 'no control'] = run_scenario(name, vehicle, None)
        progress()
        for controller in chosen:
            loop = limiting(controller).loop(SENSORS.pulses_per_turn)
            found[name, controller.text] = run_scenario(name, vehicle, loop)
            progress()
    return found


def time_steps(every: Sequence[Controller]) -> tuple[list[list[str]], list[Target]]:
    """Computing time of a step of every controller and of the estimator.

    Parameters
    ----------
    every : sequence of Controller
        Controllers to time, the LPV one last.

    Returns
    -------
    rows : list of list of str
        Name and median time, us.
    targets : list of Target
        Targets of LPV controller and estimator.
    """
    vehicle = load_vehicle(VEHICLE)
    loads = vehicle.static_loads().tolist()
    rims, torques = [2.4] * 4, [1000.0, 1000.0, 4000.0, 4000.0]
    state = SlipState(
        slip=[0.14, 0.16, 0.15, 0.15], valid=[True] * 4, rim_speed=rims, speed=2.0,
        slip_stiffness=loads, gross_traction=loads,
    )  # fmt: skip
    times = {}
    for controller in every:
        acting = controller.loop(0.0).controller
        now = 0.0

        def step(acting: SlipController = acting) -> None:
            nonlocal now
            now += DT
            acting.wheel_states(now, torques)
            acting.torque_request(now, torques)
            acting.slip_estimate(now, now, state)

        times[controller.text] = step_time(step)
    estimator = every[-1].loop(0.0).estimator
    speeds = [rim / wheel.radius for rim, wheel in zip(rims, vehicle.wheels, strict=True)]
    t = 0.0

    def estimate() -> None:
        nonlocal t
        t += DT
        # Varied in the last bits, or the sensor would count as stuck.
        ripple = 1.0 + 1e-6 * (round(t / DT) % 7)
        estimator.wheel_states(t, [ripple * speed for speed in speeds], torques)
        estimator.radar(t, 2.0 * ripple, 0.0025)

    times['estimator, wheels and radar'] = step_time(estimate)
    rows = [[name, f'{1e6 * found:.0f}'] for name, found in times.items()]
    return rows, step_time_targets(times['LPV'], times['estimator, wheels and radar'])
