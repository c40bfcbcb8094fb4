"""Reading of text files and YAML within limits.

Nested aliases let a short YAML text expand without limit, and deep nesting exhausts the stack.
"""

from pathlib import Path
from typing import Any

import yaml

LONGEST_TEXT = 16 * 1024 * 1024
"""Limit of the length of a text, characters."""

LONGEST_SCALAR = 3000
"""Limit of an unquoted value, characters: Python cannot print longer integers."""

DEEPEST = 32
"""Limit of the nesting of lists and mappings, levels."""

MAX_VALUES = 1_000_000
"""Limit of the number of values, with aliases expanded."""

# The C parser if there is one: gain tables hold tens of thousands of numbers.
_SafeLoader: Any = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)


class BoundedYamlError(ValueError):
    """A text cannot be read, is no YAML, or exceeds a limit."""


def read_text(path: Path | str) -> str:
    """Read a text file.

    Parameters
    ----------
    path : Path or str
        File to read, UTF-8, with or without a byte order mark.

    Returns
    -------
    str
        The text.

    Raises
    ------
    BoundedYamlError
        Naming the file, if it is missing, is not text or too long.
    """
    try:
        with Path(path).open(encoding='utf-8-sig') as file:
            text = file.read(LONGEST_TEXT + 1)
    except OSError as error:
        raise BoundedYamlError(f'{path}: {error.strerror}') from error
    except UnicodeDecodeError as error:
        raise BoundedYamlError(f'{path}: not text: {error}') from error
    if len(text) > LONGEST_TEXT:
        raise BoundedYamlError(f'{path}: more than {LONGEST_TEXT} characters')
    return text


def read_yaml(path: Path | str, loader: Any = _SafeLoader) -> Any:
    """Read a YAML file.

    Parameters
    ----------
    path : Path or str
        File to read, see `read_text`.
    loader : type
        As for `load_yaml`.

    Returns
    -------
    object
        Of mappings, lists, texts, numbers, dates.

    Raises
    ------
    BoundedYamlError
        Naming file and line, if it cannot be read.
    """
    text = read_text(path)
    try:
        return load_yaml(text, loader)
    except BoundedYamlError as error:
        raise BoundedYamlError(f'{path}: {error}') from error


def load_yaml(text: str, loader: Any = _SafeLoader) -> Any:
    """Content of a YAML text.

    Parameters
    ----------
    text : str
        The text.
    loader : type
        Loader of PyYAML that builds the content, a safe one.

    Returns
    -------
    object
        Of mappings, lists, texts, numbers, dates.

    Raises
    ------
    BoundedYamlError
        If it is no YAML, exceeds a limit or has tags of Python; the text is one line.
    """
    if len(text) > LONGEST_TEXT:
        raise BoundedYamlError(f'more than {LONGEST_TEXT} characters')
    try:
        _check_limits(text)
        return yaml.load(text, loader)
    except BoundedYamlError:
        raise
    except yaml.YAMLError as error:
        raise BoundedYamlError(f'not valid YAML: {" ".join(str(error).split())}') from error
    except Exception as error:
        # A value that does not suit its tag raises KeyError, IndexError and others.
        raise BoundedYamlError(f'not valid YAML: a value cannot be read: {error!r}') from error


def _check_limits(text: str) -> None:
    """Check the parser's events one by one, before objects are built.

    An alias counts as many values as it stands for; an alias within itself is refused.
    """
    sizes: dict[str, int | None] = {}
    # Anchor of each list and mapping that is open, and the number of values before it.
    around: list[tuple[str | None, int]] = []
    count = 0
    for event in yaml.parse(text, _SafeLoader):
        where = f'line {event.start_mark.line + 1 if event.start_mark else "?"}'
        if isinstance(event, yaml.AliasEvent):
            size = sizes.get(event.anchor or '', 1)
            if size is None:
                raise BoundedYamlError(f'{where}: *{event.anchor} stands within itself')
            count += size
        elif isinstance(event, yaml.ScalarEvent):
            # The C and Python parsers mark unquoted values in different ways.
            if event.style in (None, '') and len(event.value) > LONGEST_SCALAR:
                raise BoundedYamlError(f'{where}: value of more than {LONGEST_SCALAR} characters')
            count += 1
            if event.anchor:
                sizes[event.anchor] = 1
        elif isinstance(event, yaml.CollectionStartEvent):
            around.append((event.anchor, count))
            count += 1
            if event.anchor:
                sizes[event.anchor] = None
            if len(around) > DEEPEST:
                raise BoundedYamlError(f'{where}: nested deeper than {DEEPEST} levels')
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = around.pop()
            if anchor:
                sizes[anchor] = count - before
        if count > MAX_VALUES:
            raise BoundedYamlError(f'{where}: more than {MAX_VALUES} values')
