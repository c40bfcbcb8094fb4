"""Report on faults injected into the running suite: docs/safety.md."""

import tempfile
from pathlib import Path

from rich.console import Console
from rich.table import Table

from traction_evaluation.faults.bench import (
    BusBench,
    Describe,
    FaultBench,
    Outcome,
    Row,
    recorded,
)
from traction_evaluation.faults.table import BUS_ROWS, ROWS
from traction_evaluation.markdown import fill
from traction_evaluation.markdown import table as markdown_table
from traction_node.transport import keep_local

HEAD = ('hazard', 'noticed by', 'safe is', 'limit', 'safe after', 'told after', 'drives after')


def _ms(seconds: float) -> str:
    return f'{1e3 * seconds:.0f} ms'


def cells(row: Row, outcome: Outcome | None) -> tuple[str, ...]:
    """Cells of a row, with dashes if it failed.

    Parameters
    ----------
    row : Row
    outcome : Outcome or None
        None if the fault was not reported, outputs were not safe or the tractor did not drive
        again.
    """
    measured = ('**none**', '-', '-')
    if outcome is not None:
        times = outcome.reaction, outcome.told, outcome.recovery
        measured = (_ms(times[0]), _ms(times[1]), f'{times[2]:.1f} s')
        if outcome.reaction > row.limit:
            measured = (f'**{measured[0]}**', *measured[1:])
    return row.name, row.detection, row.safe, _ms(row.limit), *measured


def measured(describe: Describe, console: Console) -> tuple[list[tuple[Row, Outcome | None]], str]:
    """Measure every row, and the completeness of the recording."""
    found: list[tuple[Row, Outcome | None]] = []

    def measure(bench: FaultBench | BusBench, rows: tuple[Row, ...]) -> None:
        for row in rows:
            try:
                found.append((row, bench.measure(row)))
            except TimeoutError as error:
                console.print(f'{row.name}: {error}', style='red')
                found.append((row, None))

    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / 'bag'
        with (
            console.status('faults of commands, nodes and sensors'),
            FaultBench(describe, bag) as bench,
        ):
            measure(bench, ROWS)
            kept, heard = recorded(bench, bag)
    with console.status('faults of the bus'), BusBench(describe) as bus:
        measure(bus, BUS_ROWS)
    return found, f'{kept} of {heard}'


def write_report(describe: Describe, docs: Path) -> int:
    """Measure all faults and write safety.md.

    Parameters
    ----------
    describe : callable
        Returns the nodes, as `traction_bringup.system.system`.
    docs : Path
        Folder of safety.md.

    Returns
    -------
    int
        Exit status: 0, or 2 if a row is beyond its limit.
    """
    keep_local()
    console = Console()
    found, kept = measured(describe, console)
    lines = [cells(row, outcome) for row, outcome in found]
    table = Table(*HEAD)
    for line in lines:
        table.add_row(*(text.replace('`', '').replace('**', '') for text in line))
    console.print(table)
    good = sum(o is not None and o.reaction <= row.limit for row, o in found)
    summary = f'{good} of {len(found)} faults within their limits.'
    console.print(f'{summary} Recorded: {kept} torques.')
    template = Path(__file__).with_name('safety.template.md')
    text = fill(template, summary=summary, table=markdown_table(HEAD, lines), recorded=kept)
    (docs / 'safety.md').write_text(text, encoding='utf-8')
    return 0 if good == len(found) else 2
