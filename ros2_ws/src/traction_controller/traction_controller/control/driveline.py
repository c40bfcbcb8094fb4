"""Driveline: driven axles, groups of wheels with one drive torque, and differentials.

Wheels with one drive torque form a group: a single wheel with its own motor, the wheels of an axle
behind a differential, or all wheels behind one engine. In a group

- torque is divided in the ratio of the request;
- with *open* differentials wheel speeds differ, and the wheel with the least traction limits the
  torque of all: the slip of the group is the largest in the direction of the request;
- with *locked* differentials wheel speeds are equal: the slip of the group is that of the mean rim
  speed.
"""

from collections.abc import Sequence
from enum import IntEnum

from traction_model.vehicle.vehicle import Vehicle


class Grouping(IntEnum):
    """Wheels that form a control group, numbered as in the ControllerState message."""

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
    """Driven axles of a vehicle.

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
    """Control groups of the driven wheels of a vehicle.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle.
    grouping : Grouping
        Kind of group.
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
