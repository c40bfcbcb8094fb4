"""Markdown of the reports: tables, targets and templates."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from string import Template
from typing import NamedTuple


class Target(NamedTuple):
    """Target of a report with its result.

    Attributes
    ----------
    text : str
        Description of the target.
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
        One per column.
    rows : iterable of iterable of str
        Cells of every row.

    Returns
    -------
    str
        Table without a line break at the end.
    """
    columns = list(headings)
    lines = ['| ' + ' | '.join(columns) + ' |', '|---' * len(columns) + '|']
    return '\n'.join(lines + ['| ' + ' | '.join(row) + ' |' for row in rows])


def target_table(targets: Iterable[Target]) -> str:
    """Markdown table of targets; missed ones are bold.

    Parameters
    ----------
    targets : iterable of Target
        In the order of the rows.

    Returns
    -------
    str
        As for `table`.
    """
    return table(
        ('target', 'found', 'limit', ''),
        (
            [each.text, each.found, each.limit, 'met' if each.met else '**missed**']
            for each in targets
        ),
    )


def fill(template: Path, **values: object) -> str:
    """Text of a template with its values.

    Parameters
    ----------
    template : Path
        File with ``$name`` in place of values.
    **values : object
        Values by name.

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
    """Text of a section of an earlier report.

    Parameters
    ----------
    path : Path
        Markdown file.
    heading : str
        Heading line of the section, with ``## ``.

    Returns
    -------
    str
        Text without heading, up to the next heading of its level; empty if there is none.
    """
    if not path.is_file():
        return ''
    _, _, rest = path.read_text(encoding='utf-8').partition(f'{heading}\n')
    return rest.partition('\n## ')[0].strip()


def replace_section(path: Path, heading: str, text: str) -> None:
    """Replace a section of a report.

    Parameters
    ----------
    path : Path
        Markdown file.
    heading : str
        The section's heading line, ``## `` included.
    text : str
        Without heading.

    Raises
    ------
    ValueError
        If the file has no such section.
    """
    whole = path.read_text(encoding='utf-8')
    before, found, rest = whole.partition(f'\n{heading}\n')
    if not found:
        raise ValueError(f"{path} has no section '{heading}'")
    _, following, after = rest.partition('\n## ')
    end = f'{following}{after}' if following else ''
    path.write_text(f'{before}{found}\n{text}\n{end}', encoding='utf-8')


def said(targets: Sequence[Target]) -> Iterable[str]:
    """Targets as lines for a terminal.

    Parameters
    ----------
    targets : sequence of Target
        In the order of the lines.

    Returns
    -------
    iterable of str
        One line per target.
    """
    for each in targets:
        word = 'met   ' if each.met else 'MISSED'
        yield f'{word} {each.text}: {each.found} ({each.limit})'
