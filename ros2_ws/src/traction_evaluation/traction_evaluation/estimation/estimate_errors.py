"""Errors of the estimates on a bag, also with modified radar readings."""

import copy
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from traction_evaluation.drives.recording import vehicle_prefix
from traction_evaluation.replay.judge import EstimateErrors, Judge
from traction_evaluation.replay.replay import TRUTH, Replay, replay
from traction_node.stamp import nanoseconds
from tractor_io.bags.bag_error import BagError
from tractor_io.bags.reader import BagReader


class OtherRadar:
    """Replacement of the radar readings of a bag.

    Parameters
    ----------
    path : Path or str
        Bag; with ground truth if `seed` is given.
    gap : (float, float), optional
        Start and end of a gap without readings, s after the start of the bag.
    seed : int, optional
        Seed for new readings: ground truth plus noise with the variance of the message.

    Raises
    ------
    BagError
        If the bag cannot be read, or lacks the ground truth.
    """

    def __init__(
        self,
        path: Path | str,
        gap: tuple[float, float] | None = None,
        seed: int | None = None,
    ) -> None:
        self._gap = gap
        self._noise = None if seed is None else np.random.default_rng(seed)
        self._true_speed: dict[int, float] = {}
        with BagReader(path) as bag:
            self._start = bag.start
            if self._noise is not None:
                for message in bag.messages(sorted(bag.find([vehicle_prefix(bag) + TRUTH]))):
                    stamp = nanoseconds(message.message.header.stamp)
                    self._true_speed[stamp] = message.message.ground_based_speed

    def __call__(self, message: Any) -> Any:
        """Replacement of a reading.

        Parameters
        ----------
        message : object
            TwistWithCovarianceStamped of the topic `radar`, m/s and m²/s².

        Returns
        -------
        object or None
            Message to deliver; None in the gap, and without ground truth at its time.
        """
        stamp = nanoseconds(message.header.stamp)
        t = (stamp - self._start) * 1e-9
        if self._gap is not None and self._gap[0] <= t < self._gap[1]:
            return None
        if self._noise is None:
            return message
        deviation = math.sqrt(message.twist.covariance[0])
        noise = float(self._noise.normal(0.0, deviation))
        if stamp not in self._true_speed:
            return None
        made = copy.deepcopy(message)
        made.twist.twist.linear.x = self._true_speed[stamp] + noise
        return made


def replay_with_radar(
    path: Path | str,
    *,
    vehicle: str = '',
    soil: str = '',
    method: str = 'ukf',
    judge: Judge | None = None,
    radar_gap: tuple[float, float] | None = None,
    radar_seed: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Replay:
    """Replay a bag with other radar readings, or another Kalman filter.

    Parameters
    ----------
    path : Path or str
        Bag with `wheel_states` and `radar`, in any namespace.
    vehicle, soil : str
        Vehicle and nominal soil; empty: from the bag.
    method : {'ukf', 'ekf', 'scheduled_gain'}
        Kalman filter; other parameters are as shipped.
    judge : Judge, optional
        Comparison of the estimates with ground truth.
    radar_gap, radar_seed
        As for `OtherRadar`.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Returns
    -------
    Replay
        The outputs.

    Raises
    ------
    BagError
        As for `replay` and `OtherRadar`.
    ValueError
        If vehicle, soil or method are unknown.
    """
    return replay(
        path,
        vehicle=vehicle,
        soil=soil,
        parameters={'slip_estimator': {'method': method}},
        judge=judge,
        change_radar=OtherRadar(path, radar_gap, radar_seed),
        progress=progress,
    )


def estimate_errors(
    path: Path | str,
    *,
    settle: float = 2.0,
    until: float = math.inf,
    min_speed: float = 0.3,
    **changes: Any,
) -> EstimateErrors:
    """Replay a bag and compare slip with ground truth.

    Parameters
    ----------
    path : Path or str
        Bag with `wheel_states`, `radar` and `ground_truth/slip_estimate`, in any namespace.
    settle, until, min_speed : float
        As for `Judge`; s, s and m/s.
    **changes
        As for `replay_with_radar`.

    Returns
    -------
    EstimateErrors
        Errors, SI units.

    Raises
    ------
    BagError
        If the bag cannot be read or lacks a topic, or the vehicle is neither given nor in it.
    ValueError
        If vehicle, soil or method are unknown.
    """
    with BagReader(path) as bag:
        prefix = vehicle_prefix(bag)
        bag.find(prefix + name for name in ('wheel_states', 'radar', TRUTH))
    judge = Judge(settle, until, min_speed)
    found = replay_with_radar(path, judge=judge, **changes).errors
    if found is None:
        raise BagError(f'{path}: nothing to judge after {settle:g} s above {min_speed:g} m/s')
    return found
