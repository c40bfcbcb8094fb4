"""Put faults into the running suite and measure what it makes of them: `make faults`.

Prints the table, writes docs/safety.md, and ends with status 2 where a row is beyond its limit.
"""

import argparse
import sys
import tempfile
from pathlib import Path
from string import Template

from fault_bench import BusBench, FaultBench, Outcome, Row, recorded
from fault_table import BUS_ROWS, ROWS
from rich.console import Console
from rich.table import Table

from traction_bringup.runner import keep_local

ROOT = Path(__file__).resolve().parents[1]

HEAD = ('hazard', 'noticed by', 'safe is', 'limit', 'safe after', 'told after', 'drives after')


def _ms(seconds: float) -> str:
    return f'{1e3 * seconds:.0f} ms'


def cells(row: Row, outcome: Outcome | None) -> tuple[str, ...]:
    """A row as texts, with dashes where it failed.

    Parameters
    ----------
    row : Row
    outcome : Outcome or None
        None where the fault was not told of, outputs were not safe or the tractor did not drive
        again.
    """
    measured = ('**none**', '-', '-')
    if outcome is not None:
        times = outcome.reaction, outcome.told, outcome.recovery
        measured = (_ms(times[0]), _ms(times[1]), f'{times[2]:.1f} s')
        if outcome.reaction > row.limit:
            measured = (f'**{measured[0]}**', *measured[1:])
    return row.name, row.detection, row.safe, _ms(row.limit), *measured


def measured(console: Console) -> tuple[list[tuple[Row, Outcome | None]], str]:
    """Measure every row, and what of it was recorded."""
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
        with console.status('faults of commands, nodes and sensors'), FaultBench(bag) as bench:
            measure(bench, ROWS)
            kept, heard = recorded(bench, bag)
    with console.status('faults of the bus'), BusBench() as bus:
        measure(bus, BUS_ROWS)
    return found, f'{kept} of {heard}'


def main(arguments: list[str] | None = None) -> int:
    """Entry point.

    Parameters
    ----------
    arguments : list of str, optional
        Command line; that of the process when left out.

    Returns
    -------
    int
        Exit status: 0, or 2 where a row is beyond its limit.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--docs', type=Path, default=ROOT / 'docs', help='folder of safety.md')
    docs = parser.parse_args(arguments).docs
    keep_local()
    console = Console()
    found, kept = measured(console)
    lines = [cells(row, outcome) for row, outcome in found]
    table = Table(*HEAD)
    for line in lines:
        table.add_row(*(text.replace('`', '').replace('**', '') for text in line))
    console.print(table)
    good = sum(o is not None and o.reaction <= row.limit for row, o in found)
    summary = f'{good} of {len(found)} faults within their limits.'
    console.print(f'{summary} Recorded: {kept} torques.')
    rows = ('| ' + ' | '.join(line) + ' |' for line in (HEAD, ('---',) * len(HEAD), *lines))
    template = Template((ROOT / 'tools/safety.template.md').read_text(encoding='utf-8'))
    text = template.substitute(summary=summary, table='\n'.join(rows), recorded=kept)
    (docs / 'safety.md').write_text(text, encoding='utf-8')
    return 0 if good == len(found) else 2


if __name__ == '__main__':
    sys.exit(main())
