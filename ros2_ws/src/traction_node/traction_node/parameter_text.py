"""Tables of parameters as text: YAML of a parameter file, Markdown of a README."""

import json
import re
from collections.abc import Iterable, Mapping
from textwrap import wrap
from typing import Any

from traction_node.parameter import NodeParameter

WIDTH = 99
"""Length limit of lines of a parameter file, characters."""

BEGIN, END = '<!-- parameters of {} -->', '<!-- end of parameters -->'
"""Comments around a generated table in a README; the first names the node."""

# Texts that need no quotes in YAML.
_PLAIN_TEXT = re.compile(r'[A-Za-z_][A-Za-z0-9_./-]*')
_OTHER_WORDS = {'true', 'false', 'yes', 'no', 'on', 'off', 'y', 'n', 'null'}


def value_text(value: object) -> str:
    """Value as YAML, in one line.

    Parameters
    ----------
    value : bool, int, float, str, or list or tuple of str or float
        Value of a parameter.
    """
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, list | tuple):
        return '[' + ', '.join(value_text(entry) for entry in value) + ']'
    if isinstance(value, str):
        plain = _PLAIN_TEXT.fullmatch(value) and value.lower() not in _OTHER_WORDS
        return value if plain else json.dumps(value, ensure_ascii=False)
    return str(value)


def yaml_text(
    heading: str, nodes: Mapping[str, tuple[Iterable[NodeParameter], Mapping[str, Any]]]
) -> str:
    """Parameter file with description, unit and range of every parameter.

    Parameters
    ----------
    heading : str
        Purpose of the file, for its first lines.
    nodes : mapping of str to tuple
        By name of node: parameters to write, and values that override their defaults.

    Returns
    -------
    str
        YAML for a node of that name in any namespace.

    Raises
    ------
    ParameterError
        If a value is not allowed.
    """
    lines = [f'# {line}' for line in wrap(heading, WIDTH - 2)]
    for name, (parameters, values) in nodes.items():
        lines += [f'/**/{name}:', '  ros__parameters:']
        for parameter in parameters:
            limits = parameter.range_text or parameter.unit
            note = parameter.description + (f'; {limits}' if limits else '')
            if parameter.name in values:
                note += f'; without this line {value_text(parameter.default)}'
            lines += [f'    # {line}' for line in wrap(note, WIDTH - 6)]
            value = parameter.check(values.get(parameter.name, parameter.default))
            lines.append(f'    {parameter.name}: {value_text(value)}')
    return '\n'.join(lines) + '\n'


def markdown_table(parameters: Iterable[NodeParameter]) -> str:
    """Table of parameters for a README; * marks those that can change while the node runs.

    Parameters
    ----------
    parameters : iterable of NodeParameter
        Parameters of a node.

    Returns
    -------
    str
        Lines of Markdown.
    """
    lines = ['| parameter | default | range | what it does |', '|---|---|---|---|']
    for parameter in parameters:
        name = f'`{parameter.name}`' + ('' if parameter.read_only else ' *')
        limits = parameter.range_text or parameter.unit
        cells = (name, f'`{value_text(parameter.default)}`', limits, parameter.description)
        lines.append('| ' + ' | '.join(cell.replace('|', r'\|') for cell in cells) + ' |')
    return '\n'.join(lines) + '\n'


def put_table(readme: str, node: str, parameters: Iterable[NodeParameter]) -> str:
    """Text of a README with a new table of a node between its two comments.

    Parameters
    ----------
    readme : str
        Text with the comments `BEGIN` and `END`.
    node : str
        Name of the node.
    parameters : iterable of NodeParameter
        Parameters of the node.

    Returns
    -------
    str
        The new text.

    Raises
    ------
    ValueError
        If the README lacks the comments.
    """
    begin = BEGIN.format(node)
    before, found, rest = readme.partition(begin)
    _, ended, after = rest.partition(END)
    if not (found and ended):
        raise ValueError(f'no place for the parameters of {node}: "{begin}" and "{END}"')
    return f'{before}{begin}\n{markdown_table(parameters)}{END}{after}'
