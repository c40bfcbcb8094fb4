"""Reading of definitions (soils, vehicles) from YAML with errors that name the culprit."""

import difflib
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

LONGEST = 60
"""Characters of a wrong value that an error shows."""

Model = TypeVar('Model', bound='Definition')


class DefinitionError(ValueError):
    """A definition that cannot be used; the text names file, key and reason."""


class Definition(BaseModel):
    """Base of soils, wheels and vehicles: frozen, no unknown keys, no NaN or infinity."""

    model_config = ConfigDict(frozen=True, extra='forbid', allow_inf_nan=False)


def closest(name: str, known: Iterable[str]) -> str:
    """Return a hint naming the known name nearest to a mistyped one.

    Parameters
    ----------
    name : str
        The unknown name.
    known : iterable of str
        The names there are.

    Returns
    -------
    str
        ``"; did you mean 'x'?"``, or the list of names when none is near.
    """
    names = sorted(known)
    near = difflib.get_close_matches(name, names, n=1)
    return f"; did you mean '{near[0]}'?" if near else f'; there are: {", ".join(names)}'


def read_text(path: Path) -> str:
    """Read a text file.

    Parameters
    ----------
    path : Path
        File to read, UTF-8, with or without the mark that spreadsheets begin it with.

    Returns
    -------
    str
        The text.

    Raises
    ------
    DefinitionError
        If the file is missing or is not text.
    """
    try:
        return path.read_text(encoding='utf-8-sig')
    except OSError as error:
        raise DefinitionError(f'{path}: {error.strerror}') from error
    except UnicodeDecodeError as error:
        raise DefinitionError(f'{path}: not text: {error}') from error


def read_yaml(path: Path, kind: type = dict) -> Any:
    """Read a YAML mapping or list.

    Parameters
    ----------
    path : Path
        File to read.
    kind : type
        What it must hold, `dict` or `list`.

    Returns
    -------
    dict or list
        The content of the file.

    Raises
    ------
    DefinitionError
        If the file is missing, is not YAML, or does not hold what it must.
    """
    try:
        # The parser in C where there is one: gain tables hold tens of thousands of numbers.
        content = yaml.load(read_text(path), getattr(yaml, 'CSafeLoader', yaml.SafeLoader))
    except yaml.YAMLError as error:
        raise DefinitionError(f'{path}: not valid YAML: {error}') from error
    if not isinstance(content, kind):
        wanted = 'mapping' if kind is dict else kind.__name__
        raise DefinitionError(f'{path}: expected a {wanted}, found {type(content).__name__}')
    return content


def build(model: type[Model], content: Any, where: str) -> Model:
    """Build a definition from a mapping, naming place and key of the first fault.

    Parameters
    ----------
    model : type
        The class to build.
    content : dict
        Its keys and values.
    where : str
        Named in the error, e.g. the file.

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
        # A mistyped key is missing as well: the typing error is what to tell.
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
            # A check of ours, which says all there is to say.
            reason = str(fault['ctx']['error'])
        else:
            given = repr(fault['input'])
            reason += f', got {given if len(given) <= LONGEST else given[:LONGEST] + "…"}'
        raise DefinitionError(': '.join(filter(None, (where, key, reason)))) from error


def _nested(annotation: Any) -> list[type[BaseModel]]:
    """Models that a field's value may be of, or its elements."""
    return [
        candidate
        for candidate in (annotation, *getattr(annotation, '__args__', ()))
        if isinstance(candidate, type) and issubclass(candidate, BaseModel)
    ]


def _members(
    model: type[BaseModel], location: tuple[int | str, ...]
) -> dict[tuple[int | str, ...], type[BaseModel]]:
    """Members of unions that a location passes.

    It holds their names, or ``function-after[_check(), Name]`` where they check themselves.
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
    """Keep, of the faults of a union's members, those of the member with the fewest."""
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
            # Of a union, its member comes next.
            model = _nested(model.model_fields[part].annotation)[0]
    return model.model_fields
