"""Terrain: soils and slopes along the path of a vehicle, from code, YAML or CSV."""

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from traction_model.definition import Definition, DefinitionError, build, read_yaml
from traction_model.kernel import inlined
from traction_model.soil.soil import Soil, load_soil
from traction_model.vehicle.wheel import Wheel
from traction_node.bounded_yaml import BoundedYamlError, read_text

STEEPEST = math.pi / 4
"""Steepest grade, rad."""


class Terrain:
    """Soils and slopes along the path of a vehicle.

    Parameters
    ----------
    soils : Soil or sequence
        Soils in order along the path: each a Soil, or a tuple with one Soil per track from left to
        right (`Vehicle.tracks`).
    starts : sequence of float
        Start of each soil after the first, m along the path from the initial position of the rear
        axle, strictly increasing.
    grades : float or sequence of float
        Slope of the path, rad, uphill positive, within +-pi/4: one for the whole path, or one per
        soil. The slope at the rear axle acts on the vehicle.

    Attributes
    ----------
    n_tracks : int or None
        Number of tracks of the soils; None if they are uniform across the path.

    Raises
    ------
    ValueError
        If the numbers of soils, starts and grades do not match, starts do not increase, a grade is
        too steep, or soils have different numbers of tracks.
    """

    def __init__(
        self,
        soils: Soil | Sequence[Soil | tuple[Soil, ...]],
        starts: Sequence[float] = (),
        grades: float | Sequence[float] = 0.0,
    ) -> None:
        self.soils = (soils,) if isinstance(soils, Soil) else tuple(soils)
        if len(self.soils) != len(starts) + 1:
            raise ValueError(
                f'{len(self.soils)} soils need {len(self.soils) - 1} starts, got {len(starts)}'
            )
        self.starts = np.array([-np.inf, *starts])
        if not np.all(np.isfinite(self.starts[1:])) or np.any(np.diff(self.starts) <= 0):
            raise ValueError(f'starts of soils must be finite and increase, got {list(starts)} m')
        if np.shape(grades) not in ((), (len(self.soils),)):
            raise ValueError(f'{len(self.soils)} soils need as many grades, got {np.size(grades)}')
        self.grades = np.array(np.broadcast_to(grades, len(self.soils)), dtype=float)
        for grade in self.grades:
            if not abs(grade) <= STEEPEST:
                raise ValueError(f'grade must be within +-pi/4 rad, got {grade}')
        tracks = sorted({len(soil) for soil in self.soils if not isinstance(soil, Soil)})
        if len(tracks) > 1 or tracks == [0]:
            raise ValueError(f'soils across the path are given for {tracks} tracks')
        self.n_tracks = tracks[0] if tracks else None

    def soil(self, row: int, track: int) -> Soil:
        """Soil of one stretch under one track.

        Parameters
        ----------
        row : int
            Index of the stretch.
        track : int
            Index of the track, from the left, dimensionless.

        Returns
        -------
        Soil
            The soil, in SI units.
        """
        soil = self.soils[row]
        return soil if isinstance(soil, Soil) else soil[track]

    def packed(self, wheel: Wheel, track: int = 0) -> NDArray[np.float64]:
        """Packed soils for a wheel, for kernels.

        Parameters
        ----------
        wheel : Wheel
            The wheel.
        track : int
            Index of its track, from the left, dimensionless.

        Returns
        -------
        ndarray, shape (k, 17)
            The soils in SI units, see `Soil.packed`.
        """
        rows = range(len(self.soils))
        return np.array([self.soil(row, track).packed(wheel) for row in rows])


class Stretch(Definition):
    """Stretch of a path in a terrain file.

    Attributes
    ----------
    start : float
        Start, m along the path; required for all but the first.
    soil : str
        A preset, or ``file.yaml:name``.
    grade : float
        Slope, rad, uphill positive, within +-pi/4.
    """

    start: float = 0.0
    soil: str
    grade: float = Field(default=0.0, ge=-STEEPEST, le=STEEPEST)


def load_terrain(path: str | Path) -> Terrain:
    """Load soils and slopes along a path from a file.

    Parameters
    ----------
    path : str or Path
        A ``.csv`` file with the columns ``start`` (m), ``soil`` and, if wanted, ``grade``
        (rad); or a YAML file with a list of mappings of these keys. Soils are presets, or
        ``file.yaml:name`` with a path relative to this file.

    Returns
    -------
    Terrain
        The terrain, in SI units.

    Raises
    ------
    DefinitionError
        If it is invalid; the text has file, row and key.
    """
    path = Path(path)
    rows = _csv_rows(path) if path.suffix.lower() == '.csv' else _yaml_rows(path)
    stretches: list[Stretch] = []
    soils = []
    for where, row in rows:
        stretch = build(Stretch, row, where)
        if stretches and 'start' not in stretch.model_fields_set:
            raise DefinitionError(f'{where}: start: missing, as of all stretches but the first')
        try:
            soils.append(load_soil(stretch.soil, path.parent))
        except DefinitionError as error:
            raise DefinitionError(f'{where}: soil: {error}') from error
        stretches.append(stretch)
    if not stretches:
        raise DefinitionError(f'{path}: no stretch in it')
    try:
        return Terrain(soils, [s.start for s in stretches[1:]], [s.grade for s in stretches])
    except ValueError as error:
        raise DefinitionError(f'{path}: {error}') from error


def _csv_rows(path: Path) -> list[tuple[str, dict[str, Any]]]:
    try:
        text = read_text(path)
    except BoundedYamlError as error:
        raise DefinitionError(str(error)) from error
    rows = csv.DictReader(text.splitlines(), restkey='more')
    return [
        # An empty cell counts as missing.
        (f'{path}: line {rows.line_num}', {key: value for key, value in row.items() if value})
        for row in rows
    ]


def _yaml_rows(path: Path) -> list[tuple[str, dict[str, Any]]]:
    rows = read_yaml(path, list)
    return [(f'{path}: entry {number}', row) for number, row in enumerate(rows, 1)]


@inlined
def soil_row(x, starts):
    """Index of the soil at a position along the path.

    Parameters
    ----------
    x : float
        Position along the path, m.
    starts : ndarray, shape (k,)
        Start of each soil, m; the first is minus infinity.

    Returns
    -------
    int
        Index of the soil.
    """
    low, high = 0, starts.size
    while high - low > 1:
        middle = (low + high) // 2
        if x >= starts[middle]:
            low = middle
        else:
            high = middle
    return low


def as_terrain(ground: Terrain | Soil) -> Terrain:
    """Terrain of one soil, or the terrain itself.

    Parameters
    ----------
    ground : Terrain or Soil
        Terrain or soil, SI units.

    Returns
    -------
    Terrain
        Terrain, SI units.
    """
    return Terrain(ground) if isinstance(ground, Soil) else ground
