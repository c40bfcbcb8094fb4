"""Definitions (soils, vehicles) from YAML, with errors that name file and key."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from traction_node.closest import closest

LONGEST_TEXT = 16 * 1024 * 1024
"""Limit of the length of a file, characters."""

LONGEST_SCALAR = 3000
"""Limit of an unquoted value, characters: Python cannot print longer integers."""

DEEPEST = 32
"""Limit of the nesting of lists and mappings, levels."""

MAX_VALUES = 1_000_000
"""Limit of the number of values of a file, with aliases expanded."""

LONGEST = 60
"""Number of characters of a wrong value shown in an error."""

Model = TypeVar('Model', bound='Definition')


class DefinitionError(ValueError):
    """Invalid definition; the text names file, key and reason."""


class Definition(BaseModel):
    """Base class of soils, wheels and vehicles: frozen, no unknown keys, no NaN or infinity."""

    model_config = ConfigDict(frozen=True, extra='forbid', allow_inf_nan=False)


def read_text(path: Path) -> str:
    """Read a text file.

    Parameters
    ----------
    path : Path
        File to read, UTF-8, with or without a byte order mark.

    Returns
    -------
    str
        The text.

    Raises
    ------
    DefinitionError
        If the file is missing, is not text or too long.
    """
    try:
        with path.open(encoding='utf-8-sig') as file:
            text = file.read(LONGEST_TEXT + 1)
    except OSError as error:
        raise DefinitionError(f'{path}: {error.strerror}') from error
    except UnicodeDecodeError as error:
        raise DefinitionError(f'{path}: not text: {error}') from error
    if len(text) > LONGEST_TEXT:
        raise DefinitionError(f'{path}: more than {LONGEST_TEXT} characters')
    return text


def read_yaml(path: Path, kind: type = dict) -> Any:
    """Read a YAML mapping or list.

    Parameters
    ----------
    path : Path
        File to read.
    kind : type
        Expected type, `dict` or `list`.

    Returns
    -------
    dict or list
        The content of the file.

    Raises
    ------
    DefinitionError
        If the file is missing, is not YAML, or has another type.
    """
    try:
        # C parser if available, since gain tables have tens of thousands of numbers.
        loader = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
        text = read_text(path)
        _check_limits(path, text, loader)
        content = yaml.load(text, loader)
    except DefinitionError:
        raise
    except yaml.YAMLError as error:
        raise DefinitionError(f'{path}: not valid YAML: {error}') from error
    except Exception as error:
        # A value that does not suit its tag raises KeyError, IndexError and others.
        raise DefinitionError(
            f'{path}: not valid YAML: a value cannot be read: {error!r}'
        ) from error
    if not isinstance(content, kind):
        wanted = 'mapping' if kind is dict else kind.__name__
        raise DefinitionError(f'{path}: expected a {wanted}, found {type(content).__name__}')
    return content


def _check_limits(path: Path, text: str, loader: Any) -> None:
    """Check the parser's events one by one, before objects are built.

    Aliases count with the size of their content: nested aliases expand without limit, and an alias
    within itself never ends.
    """
    sizes: dict[str, int | None] = {}
    # Anchor of every enclosing list and mapping, and number of values before it.
    around: list[tuple[str | None, int]] = []
    count = 0
    for event in yaml.parse(text, loader):
        where = f'{path}: line {event.start_mark.line + 1 if event.start_mark else "?"}'
        if isinstance(event, yaml.AliasEvent):
            size = sizes.get(event.anchor or '', 1)
            if size is None:
                raise DefinitionError(f'{where}: *{event.anchor} stands within itself')
            count += size
        elif isinstance(event, yaml.ScalarEvent):
            if event.style in (None, '') and len(event.value) > LONGEST_SCALAR:
                raise DefinitionError(f'{where}: value of more than {LONGEST_SCALAR} characters')
            count += 1
            if event.anchor:
                sizes[event.anchor] = 1
        elif isinstance(event, yaml.CollectionStartEvent):
            around.append((event.anchor, count))
            count += 1
            if event.anchor:
                sizes[event.anchor] = None
            if len(around) > DEEPEST:
                raise DefinitionError(f'{where}: nested deeper than {DEEPEST} levels')
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = around.pop()
            if anchor:
                sizes[anchor] = count - before
        if count > MAX_VALUES:
            raise DefinitionError(f'{where}: more than {MAX_VALUES} values')


def build(model: type[Model], content: Any, where: str) -> Model:
    """Definition from a mapping; the error names place and key of the first fault.

    Parameters
    ----------
    model : type
        Class of the definition.
    content : dict
        Its keys and values.
    where : str
        Place for the error, such as the file.

    Returns
    -------
    Definition
        An instance of `model`.

    Raises
    ------
    DefinitionError
        On an unknown, missing or mistyped key, or a value out of range.
    """
    try:
        return model.model_validate(content)
    except ValidationError as error:
        # With a mistyped key another one is missing; report the mistyped one.
        faults = _of_likeliest_members(model, error.errors())
        fault = next((f for f in faults if f['type'] == 'extra_forbidden'), faults[0])
        members = _members(model, fault['loc'])
        key = '.'.join(
            str(part) for k, part in enumerate(fault['loc'], 1) if fault['loc'][:k] not in members
        )
        reason = fault['msg'].replace('a valid tuple', 'a list').replace('Tuple', 'List')
        if fault['type'] == 'extra_forbidden':
            reason = 'unknown key' + closest(
                str(fault['loc'][-1]), _keys(model, fault['loc'][:-1])
            )
        elif fault['type'] == 'missing':
            reason = 'missing'
        elif fault['type'] == 'value_error':
            # The text of the own checks is complete.
            reason = str(fault['ctx']['error'])
        else:
            given = repr(fault['input'])
            reason += f', got {given if len(given) <= LONGEST else given[:LONGEST] + "…"}'
        raise DefinitionError(': '.join(filter(None, (where, key, reason)))) from error


def _nested(annotation: Any) -> list[type[BaseModel]]:
    """Models in the annotation of a field."""
    return [
        candidate
        for candidate in (annotation, *getattr(annotation, '__args__', ()))
        if isinstance(candidate, type) and issubclass(candidate, BaseModel)
    ]


def _members(
    model: type[BaseModel], location: tuple[int | str, ...]
) -> dict[tuple[int | str, ...], type[BaseModel]]:
    """Members of unions in a location.

    A location has their names, or ``function-after[_check(), Name]`` for models with a validator.
    """
    members = {}
    candidates = [model]
    for k, part in enumerate(location, 1):
        named = [c for c in candidates if re.search(rf'\b{c.__name__}\]*$', str(part))]
        if named and len(candidates) > 1:
            candidates = named
            members[location[:k]] = named[0]
        elif candidates and part in candidates[0].model_fields:
            candidates = _nested(candidates[0].model_fields[str(part)].annotation)
    return members


def _of_likeliest_members(model: type[BaseModel], faults: list[Any]) -> list[Any]:
    """Faults of a union, restricted to its member with the fewest faults."""
    counts: dict[tuple[int | str, ...], dict[tuple[int | str, ...], int]] = {}
    for fault in faults:
        for member in _members(model, fault['loc']):
            union = counts.setdefault(member[:-1], {})
            union[member] = union.get(member, 0) + 1
    kept = {min(union, key=lambda member: union[member]) for union in counts.values()}
    return [f for f in faults if all(m in kept for m in _members(model, f['loc']))]


def _keys(model: type[BaseModel], location: tuple[int | str, ...]) -> Iterable[str]:
    """Keys of the model nested at a location of a validation error."""
    members = _members(model, location)
    for k, part in enumerate(location, 1):
        if location[:k] in members:
            model = members[location[:k]]
        elif not isinstance(part, int):
            # In a union, the member is next.
            model = _nested(model.model_fields[part].annotation)[0]
    return model.model_fields
