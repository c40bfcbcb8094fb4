"""Demo: a tractor drives onto a soft patch, without and with slip control."""

from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from traction_bringup.system import system
from traction_evaluation.drives.figures import DriveFigures, judge, latency
from traction_evaluation.drives.picture import draw
from traction_evaluation.drives.recording import Recording, read_recording
from traction_node.parameter_file import config, read_parameters
from traction_node.running_system import RunningSystem
from traction_node.stamp import seconds
from traction_node.transport import keep_local
from tractor_io.can.interface import free_port

SETTLE = 2.0
"""Start of the evaluation of slip after the rear axle reaches the soft patch, s."""

TITLES = ('without control', 'with slip control')


def demo(
    folder: Path, duration: float, console: Console, can: str = ''
) -> tuple[DriveFigures, DriveFigures]:
    """Run two drives and compare them; write bags and a picture.

    Parameters
    ----------
    folder : Path
        Folder for the results; each demo has a new folder inside.
    duration : float
        Length of each drive, s, above 0.
    console : Console
        Console for progress and figures.
    can : str
        CAN interface between tractor and suite, see `traction_bringup.system.system`; empty for
        topics.

    Returns
    -------
    without, with_control : DriveFigures
        Figures on the soft patch, SI units.

    Raises
    ------
    NodeEndedError
        If a node ends unexpectedly.
    ValueError
        If `duration` is too short to reach the soft patch.
    """
    keep_local()
    drive = read_parameters(config('traction_bringup', 'drive_cycle.yaml'))['drive_cycle']
    plant = read_parameters(config('traction_model', 'plant.yaml'))['plant_node']
    target, soft_from = float(drive['slip_target']), float(plant['soil_starts'][1])

    changes: dict[str, dict[str, Any]] = {'drive_cycle': {'duration': duration}}
    if can:
        # An unused port, separate from other buses on this machine.
        port = free_port()
        changes |= {
            name: {'interface': can, 'port': port} for name in ('can_bridge', 'tractor_ecu')
        }

    folder = folder / datetime.now().strftime('%Y-%m-%d_%H-%M-%S')
    folder.mkdir(parents=True)
    bags = [folder / 'without_control', folder / 'with_control']
    for bag, controlled, title in zip(bags, (False, True), TITLES, strict=True):
        _drive(bag, controlled, title, duration, console, changes)
    recordings = [read_recording(bag) for bag in bags]
    figures = [judge(recording, target, soft_from, SETTLE) for recording in recordings]

    picture = folder / 'demo.png'
    draw(recordings, [t.capitalize() for t in TITLES], picture, slip_target=target,
         soft_from=soft_from)  # fmt: skip
    console.print(_table(recordings, figures, target))
    console.print(f'picture  {picture}', soft_wrap=True)
    for bag in bags:
        console.print(f'bag      {bag}', soft_wrap=True)
    return figures[0], figures[1]


def _drive(
    bag: Path,
    controlled: bool,
    title: str,
    duration: float,
    console: Console,
    changes: Mapping[str, Mapping[str, Any]],
) -> None:
    """Run the system for one drive and record it."""
    can = str(changes.get('can_bridge', {}).get('interface', ''))
    nodes = system(simulated=True, controlled=controlled, bag=bag, can=can, parameters=changes)
    with Progress(
        TextColumn('{task.description:18}'),
        BarColumn(),
        TextColumn('{task.completed:4.1f} of {task.total:g} s  {task.fields[state]}'),
        TimeElapsedColumn(),
        console=console,
    ) as progress:
        task = progress.add_task(title, total=duration, state=f'starting {len(nodes)} nodes')
        with RunningSystem(nodes) as running:
            odometry = running.probe.subscribe('ground_truth/odometry')
            began: list[float] = []

            def tick() -> None:
                if not odometry:
                    return
                newest = odometry[-1]
                stamp = seconds(newest.header.stamp)
                if not began:
                    began.append(stamp)
                del odometry[:-1]
                x, v = newest.pose.pose.position.x, newest.twist.twist.linear.x
                progress.update(
                    task, completed=stamp - began[0], state=f'{x:5.1f} m at {v:4.2f} m/s'
                )

            # Longer than real time, for slow machines.
            running.run_until_end_of('drive_cycle', 4 * duration + 30, tick)
            progress.update(task, completed=duration)


def _table(recordings: list[Recording], figures: list[DriveFigures], target: float) -> Table:
    """Table with the figures of both drives."""
    table = Table(
        title=f'On the soft patch, slip from {SETTLE:g} s after entry', title_style='bold'
    )
    table.add_column('')
    for title in TITLES:
        table.add_column(title, justify='right')

    def row(name: str, texts: list[str], end: bool = False) -> None:
        table.add_row(name, *texts, end_section=end)

    row(f'slip RMSE against {target:g}', [f'{f.slip_rmse:.3f}' for f in figures])
    row('slip error, p95', [f'{f.slip_p95:.3f}' for f in figures])
    row(
        'largest slip of each wheel',
        [', '.join(f'{slip:.2f}' for slip in f.slip_peak) for f in figures],
    )
    row('distance', [f'{f.distance:.1f} m' for f in figures])
    row('mean speed', [f'{f.mean_speed:.2f} m/s' for f in figures])
    row('energy per metre', [f'{f.energy_per_metre / 1e3:.1f} kJ/m' for f in figures])
    row('peak wheel speed', [f'{f.peak_wheel_speed:.1f} rad/s' for f in figures], end=True)
    for label, quantity in (
        ('wheel_states', 'wheel_speed'),
        ('slip_estimate', 'slip_estimate'),
        ('wheel_torque_command', 'torque_command'),
        ('wheel_torque', 'torque'),
    ):
        row(f'{label}, rate', [f'{recording.rate(quantity):.1f} Hz' for recording in recordings])
    delays = [np.percentile(1e3 * latency(recording), [50, 99]) for recording in recordings]
    row('command latency, p50', [f'{p50:.1f} ms' for p50, _ in delays])
    row('command latency, p99', [f'{p99:.1f} ms' for _, p99 in delays])
    return table
