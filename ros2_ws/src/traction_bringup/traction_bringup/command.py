"""The command `traction`: demo, ecu, replay, plot, bag, sweep, synthesize, and the reports."""

import contextlib
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress
from rich.table import Table

app = typer.Typer(
    help='Off-road traction control: simulate, replay, plot, evaluate.',
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
bag_app = typer.Typer(help='Show, make, import, repair and cut bags.', no_args_is_help=True)
app.add_typer(bag_app, name='bag')
# Paths may have brackets.
console = Console(markup=False)


@contextlib.contextmanager
def _progress(text: str) -> Iterator[Callable[[float], None]]:
    """Progress bar; yields a function to call with the share done."""
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task(escape(text), total=1.0)
        yield lambda share: progress.update(task, completed=share)


Bag = Annotated[Path, typer.Argument(help='Bag: folder, .mcap or .db3 file.')]


@app.command()
def demo(
    folder: Annotated[
        Path, typer.Option(help='Folder for picture and bags.', file_okay=False)
    ] = Path('out/demo'),
    duration: Annotated[float, typer.Option(help='Length of each drive, s.', min=12.0)] = 30.0,
    can: Annotated[
        str,
        typer.Option(help='CAN interface between tractor and suite: udp_multicast, socketcan.'),
    ] = '',
) -> None:
    """Drive a tractor onto a soft patch, without control and with it."""
    from traction_bringup.demo import demo as run_demo

    run_demo(folder, duration, console, can)


@app.command()
def ecu(
    can: Annotated[
        str, typer.Option(help='CAN interface of the tractor: udp_multicast, socketcan.')
    ] = 'udp_multicast',
    channel: Annotated[
        str, typer.Option(help='Name of the bus, or multicast address; default: of the interface.')
    ] = '',
    port: Annotated[
        int | None,
        typer.Option(help='Port of a bus over UDP; default: 43113.', min=1, max=65535),
    ] = None,
    parameters: Annotated[
        str,
        typer.Option(
            help='YAML file with your parameters of plant_node, tractor_ecu and drive_cycle.'
        ),
    ] = '',
) -> None:
    """Simulate a tractor on a CAN bus, until Ctrl-C."""
    from traction_bringup.ecu import ecu as run_ecu

    run_ecu(can, channel, port, parameters, console)


@app.command()
def replay(
    bag: Bag,
    output: Annotated[
        Path | None, typer.Option('--output', '-o', help='Bag to write the outputs to.')
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option(help='Golden file, or bag of an earlier replay, for comparison.'),
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(help='Tolerance of --against, relative; 0: equal.', min=0.0),
    ] = None,
    golden: Annotated[Path | None, typer.Option(help='Golden file to write or replace.')] = None,
    vehicle: Annotated[str, typer.Option(help='Vehicle; default: from the bag.')] = '',
    soil: Annotated[str, typer.Option(help='Nominal soil; default: from the bag.')] = '',
    params_file: Annotated[
        Path | None,
        typer.Option(help='YAML file with parameters of the nodes.'),
    ] = None,
    param: Annotated[
        list[str] | None,
        typer.Option('--param', '-p', help='NODE.NAME=VALUE, may be repeated.'),
    ] = None,
    settle: Annotated[
        float, typer.Option(help='Time to leave out at the start of the comparison, s.', min=0.0)
    ] = 2.0,
    min_speed: Annotated[
        float, typer.Option(help='Lowest rim speed in the comparison, m/s.', min=0.05)
    ] = 0.3,
) -> None:
    """Replay a bag through estimator, controller and gate, with reproducible outputs.

    If the bag has ground truth, the estimates are compared with it. With --against the exit status
    is 1 if the outputs differ.
    """
    from traction_evaluation.replay.golden import TOLERANCE, compare, write_golden
    from traction_evaluation.replay.judge import Judge
    from traction_evaluation.replay.replay import chosen_parameters
    from traction_evaluation.replay.replay import replay as run_replay

    with _progress(f'replaying {bag.name}') as progress:
        result = run_replay(
            bag,
            vehicle=vehicle,
            soil=soil,
            parameters=chosen_parameters(params_file, param or ()),
            judge=Judge(settle, min_speed=min_speed),
            progress=progress,
        )

    def say(text: str, style: str = '') -> None:
        console.print(text, soft_wrap=True, highlight=False, style=style)

    errors = result.errors
    if errors is not None:
        table = Table(title=f'{bag}: slip estimate against ground truth', title_style='bold')
        for heading in ('wheel', 'RMSE', '95th percentile', 'within 2 sigma'):
            table.add_column(heading, justify='left' if heading == 'wheel' else 'right')
        for j, name in enumerate(errors.wheel_names):
            table.add_row(
                name,
                f'{errors.slip_rmse[j]:.4f}',
                f'{errors.slip_p95[j]:.4f}',
                f'{100 * errors.within_two_sigma[j]:.1f} %',
            )
        console.print(table)
        say(
            f'slip RMSE {errors.total_slip_rmse:.4f}, ground speed RMSE {errors.speed_rmse:.3f} '
            f'm/s, {errors.samples} samples after {settle:g} s above {min_speed:g} m/s'
        )
    elif result.truths:
        say(f'nothing to judge after {settle:g} s above {min_speed:g} m/s')
    say(
        f'{len(result.messages)} messages of {result.duration:.3f} s in {result.wall:.3f} s: '
        f'{result.duration / result.wall:.0f} times real time'
    )
    say(f'SHA-256  {result.sha256}')
    if output is not None:
        result.write(output)
        say(f'bag      {output}')
    found = []
    if against is not None:
        # First, as it may be the file that is to be replaced.
        found = compare(result, against, TOLERANCE if tolerance is None else tolerance)
    if golden is not None:
        write_golden(result, golden)
        say(f'golden   {golden}')
    for divergence in found:
        say(f'differs from {against}: {divergence}', style='red')
    if found:
        raise typer.Exit(1)
    if against is not None:
        say(f'as {against}')


@app.command()
def plot(
    bags: Annotated[list[Path], typer.Argument(help='Bags, drawn side by side.')],
    output: Annotated[
        Path | None, typer.Option('--output', '-o', help='PNG file; default: beside the bag.')
    ] = None,
    soft_from: Annotated[
        float | None, typer.Option(help='Start of the soft soil, m along the path.')
    ] = None,
) -> None:
    """Draw slip, speeds and torques of one or more bags."""
    from traction_evaluation.drives.picture import draw
    from traction_evaluation.drives.recording import read_recording

    recordings = [read_recording(bag) for bag in bags]
    # Resolved, since the path `.` has no name.
    places = [bag.resolve() for bag in bags]
    path = output or places[0].with_name(f'{places[0].name}.png')
    if not path.suffix:
        path = path.with_name(f'{path.name}.png')
    draw(recordings, [place.stem for place in places], path, soft_from=soft_from)
    console.print(f'picture  {path}', soft_wrap=True)


@app.command()
def sweep(
    definition: Annotated[
        str, typer.Argument(help='YAML file, or name of a shipped one: sweep_tractor.')
    ],
    output: Annotated[
        Path, typer.Option('--output', '-o', help='Folder for the results.', file_okay=False)
    ] = Path('out/sweep'),
    workers: Annotated[
        int | None, typer.Option(help='Number of processes; default: one per core.', min=1)
    ] = None,
    scheduler: Annotated[
        str, typer.Option(help='Dask scheduler to use instead, such as tcp://host:8786.')
    ] = '',
    draws: Annotated[
        int | None, typer.Option(help='Number of draws; default: from the file.', min=1)
    ] = None,
    seed: Annotated[int | None, typer.Option(help='Seed; default: from the file.', min=0)] = None,
) -> None:
    """Simulate many drives with random soil, vehicle and torque."""
    from traction_evaluation.sweeps.sweep_report import sweep as run_sweep_and_report

    interrupted = run_sweep_and_report(
        definition,
        output,
        console,
        workers=workers,
        scheduler=scheduler,
        draws=draws,
        seed=seed,
    )
    if interrupted:
        raise typer.Exit(130)


@app.command()
def synthesize(
    vehicle: Annotated[str, typer.Option(help='Preset or YAML file.')] = 'tractor_4wd',
    kind: Annotated[
        str, typer.Option(help='Guarantee: hinf (induced l2 gain) or lqr (cost).')
    ] = 'hinf',
    rate: Annotated[float, typer.Option(help='Rate of the controller, Hz.', min=1.0)] = 100.0,
    lag_min: Annotated[
        float, typer.Option(help='Smallest lag from command to shaft torque, s.', min=1e-3)
    ] = 0.1,
    lag_max: Annotated[float, typer.Option(help='Largest such lag, s.', min=1e-3)] = 0.3,
    delay: Annotated[float, typer.Option(help='Transport delay, s.', min=1e-4)] = 0.02,
    stiffness_error: Annotated[
        float, typer.Option(help='Largest factor between estimated and true stiffness.', min=1.05)
    ] = 2.0,
    response_time: Annotated[
        float, typer.Option(help='Weight: lower for a faster loop, s.', min=1e-3)
    ] = 0.3,
    effort: Annotated[
        float, typer.Option(help='Weight: higher for a smoother loop; for lqr about 1.', min=1e-6)
    ] = 20.0,
    output: Annotated[
        Path | None,
        typer.Option('--output', '-o', help='File to write; default: VEHICLE_KIND.yaml.'),
    ] = None,
    check: Annotated[
        Path | None, typer.Option(help='Only check this gain table, also on a denser grid.')
    ] = None,
) -> None:
    """Synthesise the gains of slip control for a vehicle, with their certificate."""
    from traction_bringup.synthesize import check_table, synthesize_table

    if check is not None:
        check_table(check, console)
        return
    # Rounded up: a command between two samples takes effect at the next.
    samples = math.ceil(delay * rate - 1e-6)
    synthesize_table(
        vehicle,
        output or Path(f'{Path(vehicle).stem}_{kind}.yaml'),
        console,
        {
            'kind': kind,
            'period': 1.0 / rate,
            'lags': (lag_min, lag_max),
            'delays': (samples, samples),
            'stiffness_error': stiffness_error,
            'response_time': response_time,
            'effort': effort,
        },
    )


Docs = Annotated[
    Path, typer.Option(help='Folder to write the report to.', exists=True, file_okay=False)
]
Bags = Annotated[
    Path,
    typer.Option(help="Folder of Project Chrono's bags.", exists=True, file_okay=False),
]
FieldData = Annotated[
    Path | None,
    typer.Option(
        help='Folder of field data; without it their section is kept.',
        exists=True,
        file_okay=False,
    ),
]


@app.command()
def evaluate(
    docs: Docs = Path('docs'),
    bags: Bags = Path('bags'),
    field_data: FieldData = None,
    draws: Annotated[
        int | None, typer.Option(help='Trials of every controller, a power of 2; default: 2048.')
    ] = None,
    tuning_draws: Annotated[
        int | None,
        typer.Option(help='Trials for the tuning of the fixed PI, a power of 2; default: 128.'),
    ] = None,
    seed: Annotated[int, typer.Option(help='Seed of the draws.', min=0)] = 1,
    quick: Annotated[
        bool, typer.Option('--quick', help='Short run: 16 trials, and four fixed PIs on 4.')
    ] = False,
    estimation_only: Annotated[
        bool,
        typer.Option(
            '--estimation-only', help='Only the section on the bags, in an existing report.'
        ),
    ] = False,
) -> None:
    """Evaluate slip control in closed loop, and estimation: control.md.

    The exit status is 2 if a target is missed.
    """
    from traction_evaluation.closed_loop.report import evaluate as run_evaluation
    from traction_evaluation.closed_loop.report import evaluate_estimation

    if estimation_only:
        raise typer.Exit(evaluate_estimation(docs, bags, quick=quick))
    raise typer.Exit(
        run_evaluation(
            docs,
            bags,
            field_data,
            draws=draws,
            tuning_draws=tuning_draws,
            seed=seed,
            quick=quick,
        )
    )


@app.command()
def verify(
    docs: Docs = Path('docs'), bags: Bags = Path('bags'), field_data: FieldData = None
) -> None:
    """Compare the model with Project Chrono, the paper and wheel tests: verification.md.

    The exit status is 1 if an expected limit does not hold.
    """
    from traction_evaluation.verification.report import verify as run_verification

    raise typer.Exit(run_verification(docs, bags, field_data))


@app.command()
def faults(docs: Docs = Path('docs')) -> None:
    """Inject faults into the running suite and measure their effects: safety.md.

    The exit status is 2 if a row is beyond its limit.
    """
    from traction_bringup.system import system
    from traction_evaluation.faults.report import write_report

    raise typer.Exit(write_report(system, docs))


@bag_app.command('make')
def make(
    names: Annotated[list[str] | None, typer.Argument(help='Names of runs; default: all.')] = None,
    bags: Bags = Path('bags'),
    csv: Annotated[
        Path | None,
        typer.Option(
            help='Folder of uncompressed CSV files, to compress first.',
            exists=True,
            file_okay=False,
        ),
    ] = None,
) -> None:
    """Make the bags of Project Chrono's runs from the CSV files beside them."""
    from traction_evaluation.verification.chrono_bags import make_bags

    for path, size in make_bags(names or (), bags, csv):
        console.print(f'{path}: {size / 1e3:.0f} kB', soft_wrap=True, highlight=False)


@bag_app.command()
def info(bag: Bag) -> None:
    """Show topics and custom data of a bag."""
    from tractor_io.bags.reader import BagReader

    with BagReader(bag) as reader:
        table = Table(title=f'{bag}: {reader.duration:.3f} s', title_style='bold')
        for heading in ('topic', 'type', 'messages', 'rate', 'quality of service'):
            table.add_column(
                heading, justify='right' if heading in ('messages', 'rate') else 'left'
            )
        for name, topic in reader.topics.items():
            # n messages have n - 1 intervals.
            rate = (topic.count - 1) / reader.duration if reader.duration > 0 else math.nan
            qos = 'reliable' if topic.qos.reliable else 'best effort'
            qos += ', latched' if topic.qos.latched else ''
            table.add_row(
                name,
                topic.type,
                str(topic.count),
                f'{rate:.1f} Hz',
                f'{qos}, depth {topic.qos.depth}',
            )
        console.print(table)
        for key, value in reader.custom_data.items():
            # Parameters of a node are many lines.
            lines = value.strip().splitlines()
            text = '\n    '.join([f'{key}:', *lines]) if len(lines) > 1 else f'{key}: {value}'
            console.print(text, soft_wrap=True, highlight=False)


@bag_app.command()
def repair(
    bag: Annotated[Path, typer.Argument(help='Bag folder or .mcap file that is cut short.')],
    output: Annotated[
        Path | None,
        typer.Option('--output', '-o', help='New bag; default: BAG_repaired.'),
    ] = None,
) -> None:
    """Copy all finished chunks of an incomplete bag to a new one."""
    from tractor_io.bags.repair import repair_bag

    with _progress(f'repairing {bag.name}') as progress:
        found = repair_bag(bag, output, progress)
    span = 1e-9 * (found.end - found.start)
    console.print(
        f'{sum(found.counts.values())} messages on {len(found.counts)} topics over {span:.3f} s; '
        f'{found.reason or "the file was whole"}',
        soft_wrap=True, highlight=False,
    )  # fmt: skip
    console.print(f'bag      {found.path}', soft_wrap=True)


@bag_app.command()
def cut(
    bag: Bag,
    output: Annotated[Path, typer.Option('--output', '-o', help='Folder of the new bag.')],
    start: Annotated[float, typer.Option(help='Start, s after the first message.')] = 0.0,
    end: Annotated[float | None, typer.Option(help='End, likewise; default: all.')] = None,
    topics: Annotated[
        list[str] | None,
        typer.Option('--topic', help='Topic to copy, may be repeated; default: all.'),
    ] = None,
) -> None:
    """Copy a part of a bag to a new one."""
    from tractor_io.bags.repair import cut_bag

    counts = cut_bag(bag, output, start, end, topics or ())
    console.print(f'{sum(counts.values())} messages on {len(counts)} topics', highlight=False)
    console.print(f'bag      {output}', soft_wrap=True)


@bag_app.command('import-csv')
def import_csv(
    file: Annotated[Path, typer.Argument(help='CSV file with column names in its first line.')],
    csv_map: Annotated[
        str,
        typer.Option(
            '--map', help='YAML map of the columns, or a shipped one: import_t7165s, import_rover.'
        ),
    ],
    output: Annotated[Path, typer.Option('--output', '-o', help='Folder of the new bag.')],
) -> None:
    """Convert a CSV file to a bag in SI units."""
    from tractor_io.bags.csv_import import find_map
    from tractor_io.bags.csv_import import import_csv as run_import

    with _progress(f'importing {file.name}') as progress:
        found = run_import(file, find_map(csv_map), output, progress)
    console.print(
        f'{sum(found.counts.values())} messages on {len(found.counts)} topics from {found.rows} '
        f'rows over {1e-9 * (found.end - found.start):.3f} s',
        soft_wrap=True, highlight=False,
    )  # fmt: skip
    console.print(f'bag      {found.path}', soft_wrap=True)


def main() -> int:
    """Run the command; invalid input gives one line and exit status 2.

    Returns
    -------
    int
        Exit status.
    """
    try:
        app()
    except (ValueError, OSError, RuntimeError) as error:
        stderr = Console(stderr=True, soft_wrap=True, highlight=False, markup=False)
        stderr.print(f'traction: {error}', style='red')
        return 2
    return 0
