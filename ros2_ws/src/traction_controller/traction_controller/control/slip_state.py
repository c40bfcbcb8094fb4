"""Slip state: what slip control is told of a vehicle at one instant."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(slots=True)
class SlipState:
    """Slip of all wheels and what belongs to it, at one instant.

    Wheels come in the order of `Vehicle.wheel_names`. The values are plain numbers in plain
    sequences: a step of control reads each once, and indexing an array takes longer.

    Attributes
    ----------
    slip : sequence of float
        Slip of every wheel, -1 to 1.
    valid : sequence of bool
        Whether each slip means anything.
    rim_speed : sequence of float
        r*omega of every wheel, m/s, forward positive.
    speed : float
        Speed over ground, m/s, forward positive.
    slip_stiffness : sequence of float or None
        Slope of gross traction over slip of every wheel, N, at least 0; None: not known, and the
        one known last stands.
    gross_traction : sequence of float or None
        Gross traction of every wheel, N, forward positive; None: that of steady motion under the
        shaft torque.
    speed_measured : bool
        Whether a sensor measures the speed over ground. If not, control lowers its target by the
        deviation of slip, by a half at most.
    slip_deviation : sequence of float or None
        Standard deviation of every slip, at least 0; None: not known, which counts as large.
        Read only while the speed is not measured.
    """

    slip: Sequence[float]
    valid: Sequence[bool]
    rim_speed: Sequence[float]
    speed: float
    slip_stiffness: Sequence[float] | None = None
    gross_traction: Sequence[float] | None = None
    speed_measured: bool = True
    slip_deviation: Sequence[float] | None = None
