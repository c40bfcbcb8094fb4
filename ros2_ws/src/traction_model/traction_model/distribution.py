"""Distributions of one uncertain quantity, as a definition names them."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator
from scipy.stats import truncnorm

from traction_model.definition import Definition

Array = NDArray[np.float64]

KINDS = ('relative', 'uniform', 'log_uniform', 'normal', 'choice')


class Normal(Definition):
    """A normal distribution, cut off where the quantity is no longer valid.

    Attributes
    ----------
    mean : float, optional
        In the unit of the quantity; its nominal value when not given.
    deviation : float, optional
        Standard deviation before the cut, in the unit of the quantity, above 0.
    relative_deviation : float, optional
        The same as a share of the mean, above 0; give one of the two.
    min, max : float, optional
        Narrower cut, in the unit of the quantity.
    """

    mean: float | None = None
    deviation: float | None = Field(default=None, gt=0)
    relative_deviation: float | None = Field(default=None, gt=0)
    min: float | None = None
    max: float | None = None

    @model_validator(mode='after')
    def _one_deviation(self) -> 'Normal':
        if (self.deviation is None) == (self.relative_deviation is None):
            raise ValueError('give either deviation or relative_deviation')
        return self


class Distribution(Definition):
    """Distribution that one quantity is drawn from: exactly one of the attributes is given.

    Values follow from shares of probability by the inverse distribution function, so that
    any set of points in the unit cube (random, Latin hypercube, Sobol) can be drawn from.

    Attributes
    ----------
    relative : float, optional
        Uniform within the nominal value times 1 -+ this share, above 0.
    uniform : tuple of float, optional
        Lower and upper end, in the unit of the quantity.
    log_uniform : tuple of float, optional
        Lower and upper end, both above 0, in the unit of the quantity: the logarithm is
        uniform.
    normal : Normal, optional
        Normal distribution, cut off where values are not valid.
    choice : tuple of float or str, optional
        Values, all alike likely, in the unit of the quantity; names of soils.
    """

    relative: float | None = Field(default=None, gt=0)
    uniform: tuple[float, float] | None = None
    log_uniform: tuple[float, float] | None = None
    normal: Normal | None = None
    choice: tuple[float | str, ...] | None = Field(default=None, min_length=1)

    @model_validator(mode='after')
    def _one_kind(self) -> 'Distribution':
        given = [kind for kind in KINDS if getattr(self, kind) is not None]
        if len(given) != 1:
            named = f', got {" and ".join(given)}' if given else ''
            raise ValueError(f'give exactly one of {", ".join(KINDS)}{named}')
        for kind in ('uniform', 'log_uniform'):
            ends = getattr(self, kind)
            if ends is not None and not ends[0] < ends[1]:
                raise ValueError(f'{kind}: the lower end must be below the upper, got {ends}')
        if self.log_uniform is not None and self.log_uniform[0] <= 0:
            raise ValueError(f'log_uniform: both ends must be above 0, got {self.log_uniform}')
        return self

    def support(self, nominal: ArrayLike, least: float, most: float) -> tuple[float, float]:
        """Range in which values lie.

        Parameters
        ----------
        nominal : array_like, shape () or (k,)
            Nominal value of the quantity in all draws, in its unit.
        least, most : float
            Range of valid values, in the same unit; may be infinite.

        Returns
        -------
        low, high : float
            Smallest and largest value that can be drawn, in the same unit.

        Raises
        ------
        ValueError
            If not all of that is valid, or nothing varies; the text says why.
        """
        nominal = np.asarray(nominal, dtype=float)
        if self.choice is not None:
            chosen = [value for value in self.choice if not isinstance(value, str)]
            if len(chosen) < len(self.choice):
                raise ValueError(f'choice: expected numbers, got {list(self.choice)}')
            low, high = min(chosen), max(chosen)
        elif self.relative is not None:
            if np.any(nominal == 0):
                raise ValueError('relative: the nominal value is 0; give uniform instead')
            ends = np.multiply.outer([1 - self.relative, 1 + self.relative], nominal)
            low, high = ends.min(), ends.max()
        elif self.normal is not None:
            mean, deviation, lower, upper = self._normal(nominal, least, most)
            if np.any(deviation == 0):
                raise ValueError('normal: the mean is 0; give deviation')
            if np.any(mean < lower) or np.any(mean > upper):
                raise ValueError(
                    f'normal: mean {np.ravel(mean)[0]:g} is not within {lower:g} to {upper:g}'
                )
            low, high = lower, upper
        else:
            low, high = self.uniform or self.log_uniform or (math.nan, math.nan)
        if low < least or high > most:
            raise ValueError(
                f'values from {low:g} to {high:g} are not within {least:g} to {most:g}'
            )
        return float(low), float(high)

    def values(self, shares: Array, nominal: ArrayLike, least: float, most: float) -> NDArray[Any]:
        """Values at shares of probability.

        Parameters
        ----------
        shares : ndarray, shape (k,)
            Dimensionless, at least 0 and below 1.
        nominal : array_like, shape () or (k,)
            Nominal value in every draw, in the unit of the quantity.
        least, most : float
            Range of valid values, in the same unit; may be infinite.

        Returns
        -------
        ndarray, shape (k,)
            Numbers in the same unit, or names, for a choice of names.
        """
        if self.choice is not None:
            return np.asarray(np.array(self.choice)[(shares * len(self.choice)).astype(int)])
        if self.relative is not None:
            return np.asarray(np.asarray(nominal) * (1 + self.relative * (2 * shares - 1)))
        if self.uniform is not None:
            low, high = self.uniform
            return low + (high - low) * shares
        if self.log_uniform is not None:
            low, high = self.log_uniform
            return low * (high / low) ** shares
        mean, deviation, lower, upper = self._normal(nominal, least, most)
        cut = (lower - mean) / deviation, (upper - mean) / deviation
        drawn = truncnorm.ppf(shares, *cut, loc=mean, scale=deviation)
        # A share of 0 without a lower end would be minus infinity.
        return np.asarray(np.clip(drawn, mean - 9 * deviation, mean + 9 * deviation))

    def _normal(
        self, nominal: ArrayLike, least: float, most: float
    ) -> tuple[Array, Array, float, float]:
        """Mean, deviation, lower and upper end of the normal distribution."""
        normal = self.normal
        assert normal is not None
        mean = np.asarray(nominal if normal.mean is None else normal.mean, dtype=float)
        if normal.deviation is not None:
            deviation = np.full_like(mean, normal.deviation)
        else:
            deviation = np.abs(mean) * (normal.relative_deviation or 0.0)
        lower = max(least, -math.inf if normal.min is None else normal.min)
        upper = min(most, math.inf if normal.max is None else normal.max)
        return mean, deviation, lower, upper
