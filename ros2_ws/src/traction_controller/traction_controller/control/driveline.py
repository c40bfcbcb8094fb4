"""Driveline: which wheels are driven, which of them are controlled as one, and how they turn.

Wheels that one torque drives form a group: every wheel by itself where each has its own motor,
the wheels of an axle behind a differential, or all of them behind one engine. In a group

- torque is split as the request splits it;
- with *open* differentials wheels turn as the soil lets them, and what one wheel can bear bounds
  the torque of all: the slip that counts is the largest along the request;
- with *locked* differentials wheels turn alike: the slip that counts is that of their common
  (mean) rim speed.
"""

from collections.abc import Sequence
from enum import IntEnum

from traction_model.vehicle.vehicle import Vehicle


class Grouping(IntEnum):
    """Wheels that are controlled as one, numbered as in the ControllerState message."""

    WHEEL = 0
    AXLE = 1
    VEHICLE = 2


class Differential(IntEnum):
    """Differential between the wheels of a group, numbered as in the ControllerState message."""

    OPEN = 0
    LOCKED = 1


DRIVEN_AXLES = ('all', 'front', 'rear')
"""Choices of driven axles: all, the first, or all behind the first."""


def driven_axles(vehicle: Vehicle, which: str) -> tuple[int, ...]:
    """Find the driven axles of a vehicle.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle.
    which : str
        One of `DRIVEN_AXLES`.

    Returns
    -------
    tuple of int
        Indices of the driven axles, from the front.

    Raises
    ------
    ValueError
        If there is no such choice, or the vehicle has no axle of that kind.
    """
    if which not in DRIVEN_AXLES:
        raise ValueError(f"driven axles must be {', '.join(DRIVEN_AXLES)}, got '{which}'")
    every = tuple(range(len(vehicle.axles)))
    driven = {'all': every, 'front': every[:1], 'rear': every[1:]}[which]
    if not driven:
        raise ValueError('a vehicle with one axle has no rear axle to drive: drive all')
    return driven


def wheel_groups(
    vehicle: Vehicle, grouping: Grouping, driven: Sequence[int]
) -> list[tuple[int, ...]]:
    """Group the driven wheels of a vehicle.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle.
    grouping : Grouping
        Which wheels are controlled as one.
    driven : sequence of int
        Indices of the driven axles.

    Returns
    -------
    list of tuple of int
        Indices of the wheels of each group, in the order of `Vehicle.wheel_names`.
    """
    axles, first = [], 0
    for number, axle in enumerate(vehicle.axles):
        wheels = tuple(range(first, first + len(axle.wheel_names)))
        first += len(wheels)
        if number in driven:
            axles.append(wheels)
    if grouping is Grouping.AXLE:
        return axles
    wheels = tuple(wheel for axle in axles for wheel in axle)
    return [wheels] if grouping is Grouping.VEHICLE else [(wheel,) for wheel in wheels]
