"""Distributions of uncertain quantities in definitions."""

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
    """Normal distribution, truncated to valid values of the quantity.

    Attributes
    ----------
    mean : float, optional
        Mean, in the unit of the quantity; default: its nominal value.
    deviation : float, optional
        Standard deviation before truncation, in the unit of the quantity, above 0.
    relative_deviation : float, optional
        The same as a share of the mean, above 0; give one of the two.
    min, max : float, optional
        Narrower limits of truncation, in the unit of the quantity.
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
    """Distribution of one quantity; exactly one of the attributes is given.

    Values are computed from probabilities by the inverse distribution function. So any set of
    points in the unit cube (random, Latin hypercube, Sobol) can be used.

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
        Normal distribution, truncated to valid values.
    choice : tuple of float or str, optional
        Values of equal probability, in the unit of the quantity; or names of soils.
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
        """Range of the values.

        Parameters
        ----------
        nominal : array_like, shape () or (k,)
            Nominal value of the quantity in all draws, in its unit.
        least, most : float
            Range of valid values, in the same unit; may be infinite.

        Returns
        -------
        low, high : float
            Smallest and largest possible value, in the same unit.

        Raises
        ------
        ValueError
            If a value in it is invalid, or nothing varies.
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
        """Values at probabilities.

        Parameters
        ----------
        shares : ndarray, shape (k,)
            Probabilities, dimensionless, at least 0 and below 1.
        nominal : array_like, shape () or (k,)
            Nominal value in every draw, in the unit of the quantity.
        least, most : float
            Range of valid values, in the same unit; may be infinite.

        Returns
        -------
        ndarray, shape (k,)
            Numbers in the same unit, or names for a choice of names.
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
        # A probability of 0 without a lower limit would give minus infinity.
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
