"""Estimates of a bag compared with the bag's ground truth."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from traction_controller.estimation.slip_filter import SlipFilter
from traction_evaluation.drives.recording import Array, vehicle_and_soil, vehicle_prefix
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import load_vehicle
from traction_node.joints import JointOrder
from traction_node.stamp import nanoseconds
from tractor_io.bags.bag_error import BagError
from tractor_io.bags.reader import BagReader


@dataclass(frozen=True)
class EstimateErrors:
    """How far the estimates of a replay lie from ground truth, over judged samples only.

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
        Judged samples of every wheel.
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
    """Collects estimates beside their truth.

    Parameters
    ----------
    settle : float
        Samples before this time are not judged, s.
    until : float
        Nor are those after this time, s.
    min_speed : float
        Nor are those with a rim slower than this, m/s.
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
        """Take an estimate.

        Parameters
        ----------
        t : float
            Time since the start of the bag, s.
        wheel_names : sequence of str
            The wheels, n of them, always the same.
        slip, variances : array_like, shape (n,)
            Estimated slip of each wheel and its variance, dimensionless.
        speed : float
            Estimated ground speed, m/s.
        truth : object
            Message of `ground_truth/slip_estimate` for the same time.

        Raises
        ------
        JointError
            If the truth does not tell of every wheel.
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
        """How far they lie apart; None where there was nothing to judge."""
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


def estimate_errors(
    path: Path | str,
    vehicle: str = '',
    soil: str = '',
    *,
    settle: float = 2.0,
    until: float = math.inf,
    min_speed: float = 0.3,
    method: str = 'ukf',
    radar_gap: tuple[float, float] | None = None,
    radar_seed: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> EstimateErrors:
    """Send a bag through the estimator and compare slip with ground truth.

    Parameters
    ----------
    path : Path or str
        Bag with `wheel_states`, `radar` and `ground_truth/slip_estimate`, in any namespace.
    vehicle, soil : str
        As the estimator takes them; empty for those the bag names.
    settle : float
        Samples before this time are not judged, s.
    until : float
        Nor are those after this time, s.
    min_speed : float
        Nor are those with a rim slower than this, m/s.
    method : {'ukf', 'ekf', 'lpv'}
        Kalman filter.
    radar_gap : (float, float), optional
        From when to when the radar is silent, s.
    radar_seed : int, optional
        Radar readings are made anew, from ground truth and noise of this seed as large as the
        readings say theirs is.
    progress : callable, optional
        Called with the share that is done, 0 to 1.

    Returns
    -------
    EstimateErrors
        SI units.

    Raises
    ------
    BagError
        If the bag cannot be read, lacks a topic, or names no vehicle and none is given.
    DefinitionError
        If vehicle or soil are not known.
    ValueError
        If the method is not known.
    """
    with BagReader(path) as bag:
        prefix = vehicle_prefix(bag)
        topics = bag.find(
            prefix + topic for topic in ('wheel_states', 'radar', 'ground_truth/slip_estimate')
        )
        vehicle, soil = vehicle_and_soil(bag, vehicle, soil)
        model = load_vehicle(vehicle)
        estimation = SlipFilter(model, load_soil(soil), min_speed=min_speed, method=method)
        speeds = JointOrder(model.wheel_names, 'wheel_states velocity')
        torques = JointOrder(model.wheel_names, 'wheel_states effort')
        start, end = bag.start, bag.end
        estimates: dict[int, tuple[Array, Array, float]] = {}
        judge = Judge(settle, until, min_speed)
        noise = None if radar_seed is None else np.random.default_rng(radar_seed)
        # Noise of readings that wait for the truth of their time.
        anew: dict[int, tuple[float, float]] = {}
        for message in bag.messages(sorted(topics)):
            if progress is not None:
                progress((message.time - start) / max(1, end - start))
            ns = nanoseconds(message.message.header.stamp)
            t = (ns - start) * 1e-9
            content = message.message
            kind = message.topic.removeprefix(prefix)
            if kind == 'radar':
                if radar_gap is not None and radar_gap[0] <= t < radar_gap[1]:
                    continue
                variance = content.twist.covariance[0]
                if noise is None:
                    estimation.radar(t, content.twist.twist.linear.x, variance)
                else:
                    anew[ns] = noise.normal(0.0, math.sqrt(variance)), variance
            elif kind == 'wheel_states':
                names = list(content.name)
                estimation.wheel_states(
                    t,
                    speeds.values(names, content.velocity),
                    torques.values(names, content.effort),
                )
                estimates = {
                    ns: (estimation.slip.copy(), estimation.slip_variance.copy(), estimation.v)
                }
            else:
                if ns in estimates:
                    judge.add(t, model.wheel_names, *estimates[ns], content)
                if ns in anew:
                    off, variance = anew.pop(ns)
                    estimation.radar(t, content.ground_based_speed + off, variance)
    errors = judge.errors(model.wheel_names)
    if errors is None:
        raise BagError(f'{path}: nothing to judge after {settle:g} s above {min_speed:g} m/s')
    return errors
