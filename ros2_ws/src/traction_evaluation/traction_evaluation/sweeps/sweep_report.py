"""Sweep for the command line: progress, results as Parquet, table, picture."""

from collections import Counter
from datetime import datetime
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from traction_evaluation.drives.picture import FigureDistribution, draw_sweep
from traction_evaluation.sweeps.sweep import SweepResult, numbers, rank_correlations, run_sweep
from traction_model.definition import DefinitionError
from traction_model.simulation.sweep import FIGURES, read_sweep
from traction_node.closest import closest
from traction_node.parameter_file import config

SHOWN_ERRORS = 3

# Figures in the picture.
DRAWN = ('slip_mean', 'tractive_efficiency', 'final_speed')


def sweep(
    definition: str,
    folder: Path,
    console: Console,
    *,
    workers: int | None = None,
    scheduler: str = '',
    draws: int | None = None,
    seed: int | None = None,
) -> bool:
    """Run a sweep; print its figures, write results and a picture.

    Parameters
    ----------
    definition : str
        YAML file, or name of a shipped one.
    folder : Path
        Folder for the results; each sweep has a new folder inside.
    console : Console
        Console for progress and figures.
    workers : int, optional
        Number of processes on this machine; default: one per core.
    scheduler : str
        Address of a Dask scheduler to use instead.
    draws, seed : int, optional
        Number of draws and seed; default: from the file.

    Returns
    -------
    bool
        True if the user interrupted it; finished draws are kept and shown.

    Raises
    ------
    DefinitionError
        If the definition cannot be used.
    RuntimeError, ValueError, OSError
        As `traction_evaluation.sweeps.sweep.run_sweep`, or if no draw succeeded.
    """
    path = find_definition(definition, config('traction_evaluation', 'sweep_tractor.yaml').parent)
    read = read_sweep(path, draws=draws, seed=seed)
    folder = folder / f'{path.stem}_{datetime.now().strftime("%Y-%m-%d_%H-%M-%S")}'
    folder.mkdir(parents=True)
    parquet = folder / 'sweep.parquet'
    with Progress(
        TextColumn(path.stem),
        BarColumn(),
        TextColumn('{task.completed} of {task.total} draws, {task.fields[failed]} failed'),
        TimeElapsedColumn(),
        TextColumn('left'),
        TimeRemainingColumn(),
        console=console,
    ) as progress:
        task = progress.add_task('', total=read.definition.draws, failed=0)
        result = run_sweep(
            read,
            parquet,
            workers=workers,
            scheduler=scheduler,
            progress=lambda finished, failed: progress.update(
                task, completed=finished, failed=failed
            ),
        )
    if result.interrupted:
        console.print(f'interrupted: {len(result.table)} of {result.asked} draws are finished')
    _print_failures(result, console)
    if len(result.succeeded):
        console.print(summary(result))
        picture = folder / 'sweep.png'
        draw_sweep(distributions(result), f'{path.stem}: {len(result.succeeded)} draws', picture)
        console.print(f'picture  {picture}', soft_wrap=True)
    console.print(f'results  {parquet}', soft_wrap=True)
    if not len(result.succeeded) and not result.interrupted:
        raise RuntimeError('no draw succeeded; the results tell why each failed')
    return result.interrupted


def find_definition(name: str, shipped: Path) -> Path:
    """Path of a definition, from its path or the name of a shipped one.

    Parameters
    ----------
    name : str
        Path, or name without ``.yaml``.
    shipped : Path
        Folder of the shipped ones, ``sweep_*.yaml``.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    DefinitionError
        If neither exists.
    """
    path = Path(name)
    if path.exists() or path.suffix in ('.yaml', '.yml'):
        return path
    known = {file.stem: file for file in shipped.glob('sweep_*.yaml')}
    if name not in known:
        raise DefinitionError(
            f"'{name}': no such file, nor a sweep that is shipped{closest(name, known)}"
        )
    return known[name]


def distributions(result: SweepResult) -> list[FigureDistribution]:
    """Distributions for the picture of a sweep.

    Parameters
    ----------
    result : SweepResult
        Result of a sweep.

    Returns
    -------
    list of FigureDistribution
        Mean slip, tractive efficiency and final speed, SI units.
    """
    shown = []
    for name in DRAWN:
        unit = FIGURES[name].unit
        label = name.replace('_', ' ') + ('' if unit == '1' else f', {unit}')
        values = numbers(result.succeeded, name)
        shown.append(FigureDistribution(label, values, rank_correlations(result, name)))
    return shown


def _print_failures(result: SweepResult, console: Console) -> None:
    """Print the number of failed draws and the most frequent reasons."""
    if not result.failed:
        return
    console.print(f'{result.failed} of {len(result.table)} draws failed:', style='yellow')
    reasons = Counter(text for text in result.table['error'].to_pylist() if text)
    for text, count in reasons.most_common(SHOWN_ERRORS):
        console.print(f'  {count} times: {text}', markup=False, highlight=False, soft_wrap=True)
    if len(reasons) > SHOWN_ERRORS:
        console.print(f'  and {len(reasons) - SHOWN_ERRORS} other reasons')


def summary(result: SweepResult) -> Table:
    """Statistics of every figure over the draws that succeeded.

    Parameters
    ----------
    result : SweepResult
        Result of a sweep.

    Returns
    -------
    Table
        Table with units, for printing.
    """
    table = Table(title=f'{len(result.succeeded)} draws', title_style='bold')
    table.add_column('', no_wrap=True)
    for heading in ('mean', 'deviation', 'p5', 'median', 'p95'):
        table.add_column(heading, justify='right')
    for name, figure in FIGURES.items():
        values = numbers(result.succeeded, name)
        values = values[np.isfinite(values)]
        if not figure.unit:
            table.add_row(f'{name}, %', f'{100 * values.mean():.1f}')
            continue
        scale, unit = (1e-3, 'kJ') if figure.unit == 'J' else (1.0, figure.unit)
        statistics = (
            [values.mean(), values.std(), *np.percentile(values, [5, 50, 95])]
            if values.size
            else [np.nan] * 5
        )
        label = name if unit == '1' else f'{name}, {unit}'
        table.add_row(label, *(f'{scale * value:.4g}' for value in statistics))
    return table
