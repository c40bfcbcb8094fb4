"""Ruts of wheels, for the wheels behind them.

Each track is a row of cells along the path. A cell has depth of compression, shear displacement
and width of the rut. A ring buffer of cells follows the vehicle in both directions. Soil outside
it, or without a pass of a wheel, counts as undisturbed.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from traction_model.kernel import inlined

CELL = 0.02
"""Length of a cell, m."""

BEHIND = 4.0
"""Distance behind the last wheel over which ruts are kept, m."""


class Ruts(NamedTuple):
    """Ruts of a vehicle; m tracks of k cells.

    Attributes
    ----------
    depth : ndarray, shape (m, k)
        Depth below the undisturbed ground, m; 0 for undisturbed soil.
    shear : ndarray, shape (m, k)
        Shear displacement, m.
    width : ndarray, shape (m, k)
        Width, m.
    newest : ndarray, shape (m,)
        Index of the foremost cell, from the start of the path, dimensionless.
    """

    depth: NDArray[np.float64]
    shear: NDArray[np.float64]
    width: NDArray[np.float64]
    newest: NDArray[np.int64]


def fresh_ruts(tracks: int, length: float) -> Ruts:
    """Ruts before any pass of a wheel.

    Parameters
    ----------
    tracks : int
        Number of tracks.
    length : float
        From the last to the first axle, m.

    Returns
    -------
    Ruts
        Empty ruts.
    """
    cells = math.ceil((length + BEHIND) / CELL) if tracks else 1
    return Ruts(
        np.zeros((tracks, cells)),
        np.zeros((tracks, cells)),
        np.zeros((tracks, cells)),
        np.full(tracks, np.iinfo(np.int64).min // 2),
    )


@inlined
def rut_at(x, track, ruts):
    """Rut at a position, linear between cells, width weighted by depth.

    Parameters
    ----------
    x : float
        Position along the path, m.
    track : int
        Index of the track, -1 for none.
    ruts : Ruts
        The ruts.

    Returns
    -------
    depth, shear, width : float
        m, m, m; all 0 for undisturbed soil.
    """
    if track < 0:
        return 0.0, 0.0, 0.0
    cells = ruts.depth.shape[1]
    place = x / CELL
    # On a GPU floor and ceil return floats.
    first = int(math.floor(place))  # noqa: RUF046
    depth = 0.0
    shear = 0.0
    width = 0.0
    for cell in (first, first + 1):
        if ruts.newest[track] - cells < cell <= ruts.newest[track]:
            share = 1.0 - abs(place - cell)
            row = cell % cells
            depth += share * ruts.depth[track, row]
            shear += share * ruts.shear[track, row]
            width += share * ruts.depth[track, row] * ruts.width[track, row]
    return depth, shear, width / depth if depth > 0.0 else 0.0


@inlined
def press_rut(x_from, x_to, depth, shear, width, track, ruts):
    """Add a rut along the motion of a wheel, one cell behind it, outside its own contact.

    Parameters
    ----------
    x_from, x_to : float
        Previous and present position of the wheel's bottom, m along the path.
    depth : float
        Sinkage, m.
    shear : float
        Shear displacement of the soil at the exit, m.
    width : float
        Width of the wheel, m.
    track : int
        Index of the track, -1 for none.
    ruts : Ruts
        The ruts, changed in place.
    """
    if track < 0:
        return
    cells = ruts.depth.shape[1]
    if x_to >= x_from:
        first = int(math.floor(x_from / CELL))  # noqa: RUF046
        last = int(math.floor(x_to / CELL)) - 1  # noqa: RUF046
    else:
        first = int(math.ceil(x_to / CELL)) + 1  # noqa: RUF046
        last = int(math.ceil(x_from / CELL))  # noqa: RUF046
    if first > last:
        return
    newest = ruts.newest[track]
    oldest = newest - cells + 1
    if last > newest:
        clear_from, clear_to = max(newest + 1, last - cells + 1), last
        ruts.newest[track] = last
    elif first < oldest:
        clear_from, clear_to = first, min(oldest, first + cells) - 1
        ruts.newest[track] = first + cells - 1
    else:
        clear_from, clear_to = 0, -1
    for cell in range(clear_from, clear_to + 1):
        ruts.depth[track, cell % cells] = 0.0
        ruts.shear[track, cell % cells] = 0.0
        ruts.width[track, cell % cells] = 0.0
    for cell in range(max(first, ruts.newest[track] - cells + 1), last + 1):
        row = cell % cells
        ruts.depth[track, row] = max(ruts.depth[track, row], depth)
        ruts.shear[track, row] = max(ruts.shear[track, row], shear)
        ruts.width[track, row] = max(ruts.width[track, row], width)
