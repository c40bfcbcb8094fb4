"""Markdown of the reports: tables, targets, and templates to fill in."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from string import Template
from typing import NamedTuple


class Target(NamedTuple):
    """A target of a report, and what was found.

    Attributes
    ----------
    text : str
        What is asked for.
    found, limit : str
        Measured value and limit, with units.
    met : bool
        True if the limit holds.
    """

    text: str
    found: str
    limit: str
    met: bool


def table(headings: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Markdown table.

    Parameters
    ----------
    headings : iterable of str
        One a column.
    rows : iterable of iterable of str
        Cells of every row.

    Returns
    -------
    str
        Without a line break at the end.
    """
    columns = list(headings)
    lines = ['| ' + ' | '.join(columns) + ' |', '|---' * len(columns) + '|']
    return '\n'.join(lines + ['| ' + ' | '.join(row) + ' |' for row in rows])


def target_table(targets: Iterable[Target]) -> str:
    """Markdown table of targets, those missed in bold.

    Parameters
    ----------
    targets : iterable of Target
        In the order of the rows.

    Returns
    -------
    str
        As of `table`.
    """
    return table(
        ('target', 'found', 'limit', ''),
        (
            [each.text, each.found, each.limit, 'met' if each.met else '**missed**']
            for each in targets
        ),
    )


def fill(template: Path, **values: object) -> str:
    """Text of a template, filled in.

    Parameters
    ----------
    template : Path
        File with ``$name`` where a value goes.
    **values : object
        By name.

    Returns
    -------
    str
        The text.

    Raises
    ------
    KeyError
        If a value is missing.
    """
    return Template(template.read_text(encoding='utf-8')).substitute(values)


def section(path: Path, heading: str) -> str:
    """Text of a section of a report that was written before.

    Parameters
    ----------
    path : Path
        Markdown file.
    heading : str
        The section's heading line, ``## `` included.

    Returns
    -------
    str
        Without heading, up to the next heading of its level; empty where there is none.
    """
    if not path.is_file():
        return ''
    _, _, rest = path.read_text(encoding='utf-8').partition(f'{heading}\n')
    return rest.partition('\n## ')[0].strip()


def said(targets: Sequence[Target]) -> Iterable[str]:
    """Targets as lines for a terminal.

    Parameters
    ----------
    targets : sequence of Target
        In the order of the lines.

    Returns
    -------
    iterable of str
        One line a target.
    """
    for each in targets:
        word = 'met   ' if each.met else 'MISSED'
        yield f'{word} {each.text}: {each.found} ({each.limit})'
