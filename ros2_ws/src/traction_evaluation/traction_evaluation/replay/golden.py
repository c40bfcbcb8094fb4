"""Golden files: stored outputs of a replay, for comparison with later replays.

A golden file is readable text, suitable for `git diff`. For every topic it has the first message
of each half second, with the fields that changed. A bag written by a replay can be used instead;
it has all messages.
"""

import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import fields, is_dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from traction_evaluation.replay.replay import Replay
from tractor_io.bags.message_types import typestore
from tractor_io.bags.reader import BagReader

WINDOW = 500_000_000
"""Period for which a golden file has one message of each topic, ns."""

TOLERANCE = 1e-6
"""Tolerance of equal numbers, relative, or absolute below 1: processors differ in last bits."""

_HEADING = '# traction golden 1'


class Sample(NamedTuple):
    """Message as plain values.

    Attributes
    ----------
    time : int
        Time in the bag, ns.
    topic : str
        Topic, with its leading slash.
    fields : dict of str to object
        Value of each field by its path, such as ``header.stamp.sec``; SI units.
    """

    time: int
    topic: str
    fields: dict[str, Any]


class Divergence(NamedTuple):
    """First difference between two replays in a topic.

    Attributes
    ----------
    time : float
        Time since the start of the bag, s.
    topic, field : str
        Topic, and path of the field; empty if a whole message is missing or new.
    expected, found : object
        Values in the golden file and in the replay; None if there is no message.
    """

    time: float
    topic: str
    field: str
    expected: Any
    found: Any

    def __str__(self) -> str:
        where = f'{self.topic} at {self.time:.3f} s'
        if not self.field:
            return f'{where}: ' + ('message is missing' if self.found is None else 'new message')
        return f'{where}, {self.field}: expected {self.expected}, found {self.found}'


def _plain(message: Any, path: str = '') -> Iterator[tuple[str, Any]]:
    """Fields of a message as (path, plain value)."""
    if isinstance(message, np.ndarray):
        yield path, message.tolist()
    elif isinstance(message, list) and message and is_dataclass(message[0]):
        yield path, [dict(_plain(entry)) for entry in message]
    elif is_dataclass(message):
        for each in fields(message):
            # Constants of the type, and its name.
            if each.name.isupper() or each.name.startswith('__'):
                continue
            yield from _plain(getattr(message, each.name), f'{path}.{each.name}'.lstrip('.'))
    else:
        yield path, message


def samples(result: Replay) -> Iterator[Sample]:
    """Messages of a replay, in order, as plain values."""
    store = typestore()
    for name, type_name, ns, data in result.messages:
        yield Sample(ns, name, dict(_plain(store.deserialize_cdr(data, type_name))))


def thinned(all_samples: Iterable[Sample]) -> Iterator[Sample]:
    """First sample of each half second, for every topic."""
    seen: dict[str, int] = {}
    for sample in all_samples:
        window = sample.time // WINDOW
        # Diagnostics are published at changes.
        if seen.get(sample.topic) != window or sample.topic == '/diagnostics':
            seen[sample.topic] = window
            yield sample


def write_golden(result: Replay, path: Path | str) -> None:
    """Write a golden file.

    Parameters
    ----------
    result : Replay
        Replay to store.
    path : Path or str
        File to write; an existing one is replaced.
    """
    lines = [_HEADING]
    last: dict[tuple[str, str], str] = {}
    for sample in thinned(samples(result)):
        lines.append(f'{sample.time} {sample.topic}')
        for name, value in sample.fields.items():
            text = json.dumps(_rounded(value), ensure_ascii=False)
            if last.get((sample.topic, name)) != text:
                last[sample.topic, name] = text
                lines.append(f'  {name} = {text}')
    Path(path).write_text('\n'.join(lines) + '\n', encoding='utf-8')


def _rounded(value: Any) -> Any:
    if isinstance(value, list):
        return [_rounded(entry) for entry in value]
    if isinstance(value, dict):
        return {name: _rounded(entry) for name, entry in value.items()}
    return float(f'{value:.9g}') if isinstance(value, float) else value


def read_golden(path: Path | str) -> Iterator[Sample]:
    """Read a golden file.

    Parameters
    ----------
    path : Path or str
        As for `write_golden`.

    Yields
    ------
    Sample
        In order; SI units.

    Raises
    ------
    ValueError
        If a line cannot be read.
    """
    known: dict[str, dict[str, Any]] = {}
    current = None
    with Path(path).open(encoding='utf-8') as file:
        if file.readline().rstrip('\n') != _HEADING:
            raise ValueError(f'{path}: not a golden file, it does not begin with {_HEADING!r}')
        for number, line in enumerate(file, 2):
            try:
                if not line.startswith('  '):
                    if current is not None:
                        yield current
                    ns, name = line.split()
                    current = Sample(int(ns), name, known.setdefault(name, {}).copy())
                    known[name] = current.fields
                else:
                    field, text = line.strip().split(' = ', 1)
                    current.fields[field] = json.loads(text)  # type: ignore[union-attr]
            except (ValueError, AttributeError) as error:
                raise ValueError(f'{path}: line {number}: {error}') from error
        if current is not None:
            yield current


def _bag_samples(path: Path) -> Iterator[Sample]:
    with BagReader(path) as bag:
        for message in bag.messages():
            yield Sample(message.time, message.topic, dict(_plain(message.message)))


def compare(result: Replay, golden: Path | str, tolerance: float = TOLERANCE) -> list[Divergence]:
    """First differences of a replay from a golden file or an earlier replay.

    Parameters
    ----------
    result : Replay
        Replay to compare.
    golden : Path or str
        Golden file, or bag of an earlier replay.
    tolerance : float
        Relative, and absolute below 1, dimensionless; 0: equal numbers. A golden file has nine
        digits.

    Returns
    -------
    list of Divergence
        First difference of every topic, in order of time; empty if there are none.

    Raises
    ------
    ValueError
        If the golden file or bag cannot be read.
    """
    golden = Path(golden)
    whole = golden.is_dir() or golden.suffix in ('.mcap', '.db3')
    expected = _by_topic(_bag_samples(golden) if whole else read_golden(golden))
    found = _by_topic(samples(result) if whole else thinned(samples(result)))
    divergences = []
    for name in {**expected, **found}:
        first = _first_difference(expected.get(name, []), found.get(name, []), tolerance)
        if first is not None:
            time, *what = first
            divergences.append(Divergence((time - result.start) * 1e-9, name, *what))
    return sorted(divergences, key=lambda divergence: divergence.time)


def _by_topic(all_samples: Iterable[Sample]) -> dict[str, list[Sample]]:
    found: dict[str, list[Sample]] = {}
    for sample in all_samples:
        found.setdefault(sample.topic, []).append(sample)
    return found


def _first_difference(
    expected: list[Sample], found: list[Sample], tolerance: float
) -> tuple[int, str, Any, Any] | None:
    """Time, field and values where two lists of samples of a topic first differ."""
    for old, new in zip_longest(expected, found):
        if old is None or (new is not None and new.time < old.time):
            return new.time, '', None, new.fields
        if new is None or old.time < new.time:
            return old.time, '', old.fields, None
        for name in {**old.fields, **new.fields}:
            difference = _difference(old.fields.get(name), new.fields.get(name), tolerance)
            if difference is not None:
                inner, before, now = difference
                return new.time, name + inner, before, now
    return None


def _difference(old: Any, new: Any, tolerance: float) -> tuple[str, Any, Any] | None:
    """Path and values where two plain values first differ."""
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        entries = [(f'[{k}]', a, b) for k, (a, b) in enumerate(zip(old, new, strict=True))]
    elif isinstance(old, dict) and isinstance(new, dict) and old.keys() == new.keys():
        entries = [(f'.{name}', old[name], new[name]) for name in old]
    elif isinstance(old, float) and isinstance(new, float):
        close = old == new or abs(old - new) <= tolerance * max(1.0, abs(old))
        same = close or (math.isnan(old) and math.isnan(new))
        return None if same else ('', old, new)
    else:
        return None if type(old) is type(new) and old == new else ('', old, new)
    for path, a, b in entries:
        difference = _difference(a, b, tolerance)
        if difference is not None:
            return path + difference[0], *difference[1:]
    return None
