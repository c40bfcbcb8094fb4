"""Synthesis and check of gain tables, for the command line."""

import time
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from traction_controller.synthesis.certificate import DENSER, LoopDesign, Margins, check
from traction_controller.synthesis.gain_table import (
    Scheduling,
    TableFile,
    largest_pole,
    read_table_file,
    table_wheels,
    write_gain_table,
)
from traction_controller.synthesis.lpv_synthesis import synthesize
from traction_model.definition import build
from traction_model.vehicle.vehicle import load_vehicle


def synthesize_table(
    vehicle: str, output: Path, console: Console, settings: dict[str, Any]
) -> None:
    """Compute a gain table for a vehicle; write it if its certificate passes every check.

    Parameters
    ----------
    vehicle : str
        Preset or YAML file.
    output : Path
        YAML file to write.
    console : Console
        Console for messages.
    settings : dict
        Values for `LoopDesign` that override its defaults, SI units.

    Raises
    ------
    ValueError
        If an entry is out of range, or the certificate does not hold on the denser grid.
    SynthesisError
        If no gains are found.
    """
    started = time.monotonic()
    wheels, scheduling = table_wheels(load_vehicle(vehicle)), Scheduling()
    design = build(LoopDesign, settings, 'design')
    needed = largest_pole(wheels, scheduling)
    if needed > design.largest_pole:
        design = build(LoopDesign, {**settings, 'largest_pole': needed}, 'design')
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task('', total=1.0)
        certificate = synthesize(
            design,
            lambda text, share: progress.update(task, description=text, completed=share),
        )
        progress.update(task, description=f'checking on a grid {DENSER} times denser')
        check(certificate, DENSER)
    output.parent.mkdir(parents=True, exist_ok=True)
    write_gain_table(output, Path(vehicle).stem, wheels, scheduling, certificate)
    console.print(
        f'{output} written after {time.monotonic() - started:.0f} s',
        soft_wrap=True,
        highlight=False,
    )
    check_table(output, console)


def check_table(path: Path, console: Console) -> None:
    """Check a gain table on its grid and a denser one, and print its guarantee.

    Parameters
    ----------
    path : Path
        YAML file.
    console : Console
        Console for messages.

    Raises
    ------
    DefinitionError
        If the file is missing or not laid out like a gain table.
    GainTableError
        If its numbers were changed or its certificate does not hold.
    """
    content, on_grid = read_table_file(path)
    started = time.monotonic()
    denser = check(content.certificate, DENSER)
    _report(content, {'as synthesised': on_grid, f'{DENSER} times denser': denser}, console)
    console.print(f'checked in {time.monotonic() - started:.1f} s', highlight=False)


def _report(content: TableFile, found: dict[str, Margins], console: Console) -> None:
    certificate = content.certificate
    design = certificate.design
    measure = 'gamma' if design.kind == 'hinf' else 'cost'
    gains = Table(title=f'{content.vehicle}: gains over the slip pole', title_style='bold')
    commands = [f'command -{k + 1}' for k in range(design.delays[1])]
    for heading in ('slip pole, 1/s', 'slip, 1/s', 'torque', *commands, measure):
        gains.add_column(heading, justify='right')
    rows = zip(design.poles, certificate.gains, certificate.performance, strict=True)
    for pole, row, performance in rows:
        numbers = [f'{pole:.3g}', *(f'{gain:.3f}' for gain in row), f'{performance:.2f}']
        gains.add_row(*numbers)
    console.print(gains)
    margins = Table(title='certificate', title_style='bold')
    for heading in ('grid', 'inequalities', 'least margin', 'where'):
        margins.add_column(heading, justify='left' if heading in ('grid', 'where') else 'right')
    for grid, margin in found.items():
        margins.add_row(grid, str(margin.points), f'{margin.least:.2e}', margin.where)
    console.print(margins)
