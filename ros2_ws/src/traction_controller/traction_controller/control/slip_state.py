"""Slip state: input of slip control at one instant."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(slots=True)
class SlipState:
    """Slip of all wheels with related values, at one instant.

    Wheels are in the order of `Vehicle.wheel_names`. Values are plain numbers in sequences, since
    access to a single element of an array is slower.

    Attributes
    ----------
    slip : sequence of float
        Slip of every wheel, -1 to 1.
    valid : sequence of bool
        True if a slip can be used.
    rim_speed : sequence of float
        r*omega of every wheel, m/s, forward positive.
    speed : float
        Speed over ground, m/s, forward positive.
    slip_stiffness : sequence of float or None
        Slope of gross traction over slip of every wheel, N, at least 0; None: unknown; the
        last known one is used.
    gross_traction : sequence of float or None
        Gross traction of every wheel, N, forward positive; None: that of steady motion under the
        shaft torque.
    speed_measured : bool
        True if a sensor measures the speed over ground. Otherwise control reduces its target by
        the deviation of slip, at most to half.
    slip_deviation : sequence of float or None
        Standard deviation of every slip, at least 0; None: unknown, which counts as large.
        Used only while the speed is not measured.
    """

    slip: Sequence[float]
    valid: Sequence[bool]
    rim_speed: Sequence[float]
    speed: float
    slip_stiffness: Sequence[float] | None = None
    gross_traction: Sequence[float] | None = None
    speed_measured: bool = True
    slip_deviation: Sequence[float] | None = None
