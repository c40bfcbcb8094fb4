"""Definitions (soils, vehicles) from YAML, with errors that name file and key."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from traction_node import bounded_yaml
from traction_node.bounded_yaml import BoundedYamlError
from traction_node.closest import closest

LONGEST = 60
"""Number of characters of a wrong value shown in an error."""

Model = TypeVar('Model', bound='Definition')


class DefinitionError(ValueError):
    """Invalid definition; the text names file, key and reason."""


class Definition(BaseModel):
    """Base class of soils, wheels and vehicles: frozen, no unknown keys, no NaN or infinity."""

    model_config = ConfigDict(frozen=True, extra='forbid', allow_inf_nan=False)


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
        content = bounded_yaml.read_yaml(path)
    except BoundedYamlError as error:
        raise DefinitionError(str(error)) from error
    if not isinstance(content, kind):
        wanted = 'mapping' if kind is dict else kind.__name__
        raise DefinitionError(f'{path}: expected a {wanted}, found {type(content).__name__}')
    return content


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
