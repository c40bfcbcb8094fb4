"""Scheduling of LPV models: parameters with unit and range, and checked vectors of them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from traction_node.closest import closest

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SchedulingParameter:
    """One scheduling parameter of an LPV model: its unit and range.

    Attributes
    ----------
    name : str
        As `LpvModel.schedule` takes it.
    unit : str
        Unit, '1' when dimensionless.
    low, high : ndarray, shape (n,) or (1,)
        Range of every wheel, or of the vehicle, in `unit`.
    reciprocal : bool
        Whether it is 1/slip: magnitudes below 1 do not exist, and samples are even in slip.
    """

    name: str
    unit: str
    low: Array
    high: Array
    reciprocal: bool = False

    def extremes(self, j: int) -> tuple[float, ...]:
        """Values of the parameter at which a monotone function takes its extremes.

        Parameters
        ----------
        j : int
            Entry: the wheel, or 0 for a parameter of the vehicle.

        Returns
        -------
        tuple of float
            The ends, in `unit`, and for 1/slip also -1 and 1 where they are within.
        """
        low, high = float(self.low[j]), float(self.high[j])
        inner = (-1.0, 1.0) if self.reciprocal else ()
        return tuple(sorted({low, high} | {edge for edge in inner if low < edge < high}))

    def sample(self, shares: Array) -> Array:
        """Value at a share of the range.

        Parameters
        ----------
        shares : ndarray, shape (n,) or (1,)
            0 (lowest) to 1 (highest), dimensionless.

        Returns
        -------
        ndarray
            Values in `unit`, of the same shape.
        """
        if not self.reciprocal:
            return self.low + shares * (self.high - self.low)
        values = np.empty_like(self.low)
        for j, share in enumerate(shares):
            # Even in slip, over the one or two branches that the range has.
            low, high = float(self.low[j]), float(self.high[j])
            branches = [
                (1 / min(high, far), 1 / max(low, near))
                for near, far in ((1.0, math.inf), (-math.inf, -1.0))
                if max(low, near) <= min(high, far)
            ]
            place = share * sum(end - start for start, end in branches)
            for start, end in branches:
                if place <= end - start or (start, end) == branches[-1]:
                    values[j] = 1 / min(start + place, end)
                    break
                place -= end - start
        return values


@dataclass(frozen=True)
class Schedule:
    """A checked scheduling vector of one `LpvModel`; made by `LpvModel.schedule` or `at`.

    Attributes
    ----------
    values : dict of str to ndarray
        Entry of every wheel, or of the vehicle, by parameter, in the parameter's unit.
    """

    values: Mapping[str, Array]

    def __getitem__(self, name: str) -> Array:
        if name not in self.values:
            raise KeyError(f"unknown scheduling parameter '{name}'{closest(name, self.values)}")
        return self.values[name]

    def vector(self) -> Array:
        """Return rho as one vector, parameter by parameter, wheel by wheel.

        Returns
        -------
        ndarray, shape (p,)
            The values, each in its parameter's unit.
        """
        return np.concatenate([*self.values.values()])
