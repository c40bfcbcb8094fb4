"""Scheduling of LPV models: parameters with unit and range, and checked vectors."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from traction_node.closest import closest

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SchedulingParameter:
    """Scheduling parameter of an LPV model with unit and range.

    Attributes
    ----------
    name : str
        Name, as for `LpvModel.schedule`.
    unit : str
        Unit; '1' if dimensionless.
    low, high : ndarray, shape (n,) or (1,)
        Range of every wheel, or of the vehicle, in `unit`.
    reciprocal : bool
        True for 1/slip: magnitudes are at least 1, and samples are uniform in slip.
    """

    name: str
    unit: str
    low: Array
    high: Array
    reciprocal: bool = False

    def extremes(self, j: int) -> tuple[float, ...]:
        """Values of the parameter at the extremes of a monotone function.

        Parameters
        ----------
        j : int
            Index of the wheel, or 0 for a parameter of the vehicle.

        Returns
        -------
        tuple of float
            Ends of the range, in `unit`, and for 1/slip also -1 and 1 if they are within.
        """
        low, high = float(self.low[j]), float(self.high[j])
        inner = (-1.0, 1.0) if self.reciprocal else ()
        return tuple(sorted({low, high} | {edge for edge in inner if low < edge < high}))

    def sample(self, shares: Array) -> Array:
        """Value at a fraction of the range.

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
            # Uniform in slip, over the one or two branches of the range.
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
    """Checked scheduling vector of one `LpvModel`; from `LpvModel.schedule` or `at`.

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
        """Rho as one vector, parameter by parameter, wheel by wheel.

        Returns
        -------
        ndarray, shape (p,)
            Values, each in its parameter's unit.
        """
        return np.concatenate([*self.values.values()])
