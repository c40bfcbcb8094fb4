"""Small YAML texts: written without aliases, and read within limits.

Nested aliases let a short YAML text expand without limit, and deep nesting exhausts the stack. The
files of this package need neither, so both are rejected.
"""

from typing import Any

import yaml

LONGEST_TEXT = 4 * 1024 * 1024
"""Limit of the length of a text, characters."""

LONGEST_SCALAR = 3000
"""Limit of an unquoted value, characters: Python cannot print longer integers."""

DEEPEST = 32
"""Limit of the nesting of lists and mappings, levels."""


class PlainYamlError(ValueError):
    """A text is no YAML, or exceeds a limit."""


def load_plain_yaml(text: str) -> Any:
    """Read a YAML text.

    Parameters
    ----------
    text : str
        The text.

    Returns
    -------
    object
        Of mappings, lists, texts, numbers, dates.

    Raises
    ------
    PlainYamlError
        If it is no YAML, too long or too deep, or has aliases or tags of a programme.
    """
    if len(text) > LONGEST_TEXT:
        raise PlainYamlError(f'more than {LONGEST_TEXT} characters')
    loader = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
    try:
        _check_limits(text, loader)
        return yaml.load(text, loader)
    except PlainYamlError:
        raise
    except yaml.YAMLError as error:
        raise PlainYamlError(f'not valid YAML: {error}') from error
    except Exception as error:
        # Values that their own tag does not fit surface as KeyError, IndexError and others.
        raise PlainYamlError(f'not valid YAML: a value cannot be read: {error!r}') from error


class _PlainDumper(yaml.SafeDumper):
    def ignore_aliases(self, data: Any) -> bool:
        # rosbag2's reader takes repeated values, but no anchors.
        return True


def dump_plain_yaml(content: Any, inline_lists: bool = False) -> str:
    """Write a YAML text without aliases, keys in the order given.

    Parameters
    ----------
    content : object
        Of mappings, lists, texts, numbers.
    inline_lists : bool
        Lists and mappings that hold no others in one line.

    Returns
    -------
    str
        The text, without a line break at its end.
    """
    return yaml.dump(
        content, Dumper=_PlainDumper, default_flow_style=None if inline_lists else False,
        sort_keys=False, allow_unicode=True,
    ).strip()  # fmt: skip


def _check_limits(text: str, loader: Any) -> None:
    """Check the parser's events one by one, before objects are built."""
    depth = 0
    for event in yaml.parse(text, loader):
        line = f'line {event.start_mark.line + 1}' if event.start_mark else 'somewhere'
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > DEEPEST:
                raise PlainYamlError(f'{line}: nested deeper than {DEEPEST} levels')
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        elif isinstance(event, yaml.AliasEvent):
            raise PlainYamlError(f'{line}: aliases (*{event.anchor}) are not understood')
        # The C and Python parsers mark unquoted values in different ways.
        elif (
            isinstance(event, yaml.ScalarEvent)
            and event.style in (None, '')
            and (len(event.value) > LONGEST_SCALAR)
        ):
            raise PlainYamlError(f'{line}: value of more than {LONGEST_SCALAR} characters')
