"""Comparison of estimates with ground truth."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from traction_evaluation.drives.recording import Array
from traction_node.joints import JointOrder


@dataclass(frozen=True)
class EstimateErrors:
    """Errors of the estimates of a replay against ground truth, over the compared samples.

    Attributes
    ----------
    wheel_names : tuple of str
        The wheels.
    slip_rmse : ndarray, shape (n,)
        Root mean square of the slip error of each wheel, dimensionless.
    slip_p95 : ndarray, shape (n,)
        95th percentile of its magnitude, dimensionless.
    within_two_sigma : ndarray, shape (n,)
        Share of errors within two reported standard deviations, dimensionless.
    speed_rmse : float
        Root mean square of the ground speed error, m/s.
    samples : int
        Number of compared samples per wheel.
    """

    wheel_names: tuple[str, ...]
    slip_rmse: Array
    slip_p95: Array
    within_two_sigma: Array
    speed_rmse: float
    samples: int

    @property
    def total_slip_rmse(self) -> float:
        """Root mean square of the slip error over all wheels, dimensionless."""
        return float(np.sqrt(np.mean(self.slip_rmse**2)))


class Judge:
    """Collection of estimates with their ground truth.

    Parameters
    ----------
    settle : float
        Samples before this time are left out, s.
    until : float
        Samples after this time are left out, s.
    min_speed : float
        Samples with a slower rim are left out, m/s.
    """

    def __init__(self, settle: float = 2.0, until: float = math.inf, min_speed: float = 0.3):
        self._window = settle, until
        self._min_speed = min_speed
        self._errors: list[Array] = []
        self._deviations: list[Array] = []
        self._speed_errors: list[float] = []
        self._order: JointOrder | None = None

    def add(
        self,
        t: float,
        wheel_names: Sequence[str],
        slip: Array,
        variances: Array,
        speed: float,
        truth: Any,
    ) -> None:
        """Add an estimate.

        Parameters
        ----------
        t : float
            Time since the start of the bag, s.
        wheel_names : sequence of str
            Names of the n wheels, the same at every call.
        slip, variances : array_like, shape (n,)
            Estimated slip of each wheel and its variance, dimensionless.
        speed : float
            Estimated ground speed, m/s.
        truth : object
            Message of `ground_truth/slip_estimate` for the same time.

        Raises
        ------
        JointError
            If the ground truth lacks a wheel.
        """
        settle, until = self._window
        self._order = self._order or JointOrder(wheel_names, 'ground truth')
        names = list(truth.wheel_names)
        true_slip = self._order.values(names, truth.slip)
        rims = np.abs(self._order.values(names, truth.wheel_based_speed))
        if settle <= t <= until and np.all(rims > self._min_speed):
            self._errors.append(np.asarray(slip) - true_slip)
            self._deviations.append(np.sqrt(variances))
            self._speed_errors.append(speed - truth.ground_based_speed)

    def errors(self, wheel_names: Sequence[str]) -> EstimateErrors | None:
        """Errors over all samples; None without samples."""
        if not self._errors:
            return None
        error = np.array(self._errors)
        return EstimateErrors(
            wheel_names=tuple(wheel_names),
            slip_rmse=np.sqrt(np.mean(error**2, axis=0)),
            slip_p95=np.percentile(np.abs(error), 95, axis=0),
            within_two_sigma=np.mean(np.abs(error) <= 2 * np.array(self._deviations), axis=0),
            speed_rmse=float(np.sqrt(np.mean(np.square(self._speed_errors)))),
            samples=len(error),
        )
