"""Small YAML texts: written without aliases, and read within limits.

YAML can say much in little: aliases that repeat aliases grow without end, and nesting exhausts the
stack of whoever walks it. Neither has a place in what this package reads.
"""

from typing import Any

import yaml

LONGEST_TEXT = 4 * 1024 * 1024
"""Characters of a text, more are refused."""

LONGEST_SCALAR = 3000
"""Characters of an unquoted value: longer numbers cannot be written out again."""

DEEPEST = 32
"""Levels of lists and mappings in one another, more are refused."""


class PlainYamlError(ValueError):
    """A text that is no YAML, or has more than its place in a file of ours."""


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
    """Walk the text event by event, which takes no memory, before anything is built."""
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
        # The parsers say in different ways that a value is not quoted.
        elif (
            isinstance(event, yaml.ScalarEvent)
            and event.style in (None, '')
            and (len(event.value) > LONGEST_SCALAR)
        ):
            raise PlainYamlError(f'{line}: value of more than {LONGEST_SCALAR} characters')
