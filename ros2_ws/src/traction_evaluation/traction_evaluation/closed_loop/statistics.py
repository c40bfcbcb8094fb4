"""Statistics of all trials of a controller."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from traction_evaluation.closed_loop.trial import TrialDraw
from traction_evaluation.closed_loop.trial_figures import STEP_WINDOW, columns
from traction_evaluation.closed_loop.workers import Outcome

Array = NDArray[np.float64]


@dataclass
class Result:
    """Result of all trials of one controller.

    Attributes
    ----------
    columns : dict of str to ndarray, shape (k,)
        Figures by name, in the units of `trial_figures.Figures`.
    responses : ndarray, shape (k, 2, samples)
        Mean step responses, with sensor noise and without, dimensionless.
    lags : ndarray, shape (k,)
        Lag of the drive in each trial, s.
    """

    columns: dict[str, Array] = field(default_factory=dict)
    responses: Array = field(default_factory=lambda: np.empty((0, 2, 0)))
    lags: Array = field(default_factory=lambda: np.empty(0))

    @classmethod
    def of(cls, outcomes: list[Outcome], draws: list[TrialDraw]) -> 'Result':
        """Result from the outcomes of trials.

        Parameters
        ----------
        outcomes : list of Outcome
            One per trial.
        draws : list of TrialDraw
            Draws, in the same order.

        Returns
        -------
        Result
            SI units.
        """
        return cls(
            columns([each.figures for each in outcomes]),
            np.array([each.responses for each in outcomes]),
            np.array([draw.lag for draw in draws]),
        )

    @property
    def stable(self) -> float:
        """Share of stable trials, 0 to 1."""
        return float(self.columns['stable'].mean())

    @property
    def rmse(self) -> float:
        """Root mean square slip error over all trials, dimensionless."""
        return float(np.sqrt(np.mean(self.columns['rmse'] ** 2)))

    def settling_beyond_lag(self, kind: str = 'settling', share: float = 0.95) -> float:
        """Quantile of settling time less the lag of the drive.

        Parameters
        ----------
        kind : str
            Name of the settling time, see `trial_figures.Figures`.
        share : float
            Share of trials, 0 to 1.

        Returns
        -------
        float
            s; infinite if it did not settle.
        """
        return quantile(self.columns[kind] - self.lags, share)

    @property
    def efficiency(self) -> float:
        """Tractive work over shaft energy, summed over all trials, dimensionless."""
        return float(self.columns['work'].sum() / self.columns['energy'].sum())

    def part(self, chosen: NDArray[np.bool_]) -> 'Result':
        """Result of some of the trials.

        Parameters
        ----------
        chosen : ndarray of bool, shape (k,)
            True for the chosen trials.

        Returns
        -------
        Result
            SI units.
        """
        part = {name: values[chosen] for name, values in self.columns.items()}
        return Result(part, self.responses[chosen], self.lags[chosen])


def quantile(values: Array, share: float) -> float:
    """Quantile without interpolation, as values may be infinite.

    Parameters
    ----------
    values : ndarray, shape (k,)
        Any unit.
    share : float
        0 to 1.

    Returns
    -------
    float
        The next larger value.
    """
    return float(np.quantile(values, share, method='higher'))


def seconds(value: float) -> str:
    """Settling time as text.

    Parameters
    ----------
    value : float
        s.

    Returns
    -------
    str
        For an infinite value: longer than `STEP_WINDOW`.
    """
    return f'{value:.2f}' if math.isfinite(value) else f'> {STEP_WINDOW:g}'
