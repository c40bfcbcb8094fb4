"""Drivetrain from one engine to the wheels: engine torque to wheel torques and back.

One engine drives all driven wheels over a fixed ratio, so each wheel torque is a share of one
total torque. Differentials are open: left and right wheels have the same torque. While the front
axle is engaged, it has the share `front_share`; otherwise the rear axle has the whole torque.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class Drivetrain:
    """Ratio and torque shares between engine and wheels.

    Parameters
    ----------
    front : sequence of bool
        True for every wheel on the front axle; at least one wheel is on the rear axle.
    reference_torque : float
        Engine torque of 100 %, N·m, above 0.
    ratio : float
        Engine speed over wheel speed, in the gear driven, dimensionless, above 0.
    efficiency : float
        Wheel torque over the product of ratio and engine torque, dimensionless, above 0 to 1.
    front_share : float
        Share of torque of the front axle while it is engaged, dimensionless, 0 to below 1.

    Attributes
    ----------
    full_torque : float
        Sum of wheel torques at 100 % engine torque, N·m.

    Raises
    ------
    ValueError
        If a value is out of its range.
    """

    def __init__(
        self,
        front: Sequence[bool],
        reference_torque: float,
        ratio: float,
        efficiency: float = 1.0,
        front_share: float = 0.0,
    ) -> None:
        for name, value, most in (
            ('reference_torque', reference_torque, math.inf),
            ('ratio', ratio, math.inf),
            ('efficiency', efficiency, 1.0),
        ):
            if not (math.isfinite(value) and 0 < value <= most):
                raise ValueError(f'{name} must be above 0 and at most {most:g}, got {value}')
        if not 0 <= front_share < 1:
            raise ValueError(f'front_share must be at least 0 and below 1, got {front_share}')
        is_front = np.array(front, dtype=bool)
        if not is_front.size or is_front.all():
            raise ValueError('there must be a wheel on the rear axle')
        if front_share > 0 and not is_front.any():
            raise ValueError('front_share must be 0 without a wheel on the front axle')
        self.full_torque = reference_torque * ratio * efficiency
        rear = ~is_front / (~is_front).sum()
        both = (1.0 - front_share) * rear
        if is_front.any():
            both = both + front_share * is_front / is_front.sum()
        self._shares = (rear, both)

    def shares(self, front_engaged: bool) -> Array:
        """Share of every wheel in the total torque, dimensionless, shape (n,).

        Parameters
        ----------
        front_engaged : bool
            True if the front axle is driven.

        Returns
        -------
        ndarray, shape (n,)
            Their sum is 1.
        """
        return np.array(self._shares[front_engaged])

    def wheel_torques(self, engine: float, front_engaged: bool) -> Array:
        """Torque of every wheel at a torque of the engine.

        Parameters
        ----------
        engine : float
            Engine torque as a share of reference torque, dimensionless.
        front_engaged : bool
            True if the front axle is driven.

        Returns
        -------
        ndarray, shape (n,)
            N·m.
        """
        return np.asarray(engine * self.full_torque * self._shares[front_engaged])

    def engine_share(self, torques: ArrayLike, front_engaged: bool) -> float:
        """Largest engine torque at which no wheel exceeds its limit.

        Parameters
        ----------
        torques : array_like, shape (n,)
            Torque limit of every wheel, N·m; limits of undriven wheels do not count.
        front_engaged : bool
            True if the front axle is driven.

        Returns
        -------
        float
            Share of reference torque, dimensionless.

        Raises
        ------
        ValueError
            If the number of torques is wrong or one is not finite.
        """
        shares = self._shares[front_engaged]
        most = np.asarray(torques, dtype=float)
        if most.shape != shares.shape:
            raise ValueError(f'expected {shares.size} wheel torques, got {most.size}')
        if not np.all(np.isfinite(most)):
            raise ValueError(f'wheel torques must be finite, got {most.tolist()}')
        driven = shares > 0
        return float(np.min(most[driven] / shares[driven])) / self.full_torque
