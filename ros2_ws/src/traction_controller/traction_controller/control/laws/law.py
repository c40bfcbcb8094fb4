"""Control laws: what they are told of a wheel, what they answer, and how they are made by name.

A law acts on one wheel, or on a group of wheels as if it were one, and is told everything as
seen along the request: slip above 0 goes with it, and so does torque. It answers with the torque
it wants, as a change of the torque that was really sent. So it remembers nothing that was not
sent: it cannot wind up, and another law may go on where it stops.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from inspect import signature
from typing import Any, Protocol

from traction_model.vehicle.wheel import Wheel
from traction_node.closest import closest


@dataclass(slots=True)
class Reading:
    """What a law is told of its wheel; one and the same object at every step.

    Attributes
    ----------
    slip : float
        Slip along the request, -1 to 1.
    rim_speed : float
        r*omega, m/s; its magnitude counts.
    speed : float
        Speed over ground, m/s; its magnitude counts.
    stiffness : float
        Slip stiffness, N: slope of thrust over slip, at least 0.
    gross_traction : float
        Thrust, N, along the request.
    shaft_torque : float
        Shaft torque, N*m, along the request.
    """

    slip: float = 0.0
    rim_speed: float = 0.0
    speed: float = 0.0
    stiffness: float = 0.0
    gross_traction: float = 0.0
    shaft_torque: float = 0.0


class SlipLaw(Protocol):
    """Law that brings the slip of a wheel to a target.

    Attributes
    ----------
    gains : tuple of float
        Gains of the last step: on slip (N*m), on shaft torque (1), on the integral of the slip
        error (N*m/s), and what else the law has; for the state message.
    velocity_form : bool
        Whether the law goes on from the torque sent, so that what is not delivered must come off
        it; otherwise it asks at every step for what the wheel's state is worth.
    """

    gains: tuple[float, ...]
    velocity_form: bool

    def reset(self) -> None:
        """Forget the past: the next step is the first."""

    def torque(self, reading: Reading, target: float, sent: float, dt: float) -> float:
        """Find the torque of one step.

        Parameters
        ----------
        reading : Reading
            The wheel as it is, SI units.
        target : float
            Slip to reach, 0.01 to 0.9.
        sent : float
            Torque that was really sent at the last step, after all limits, N*m.
        dt : float
            Time since the last step, s, at least 0.

        Returns
        -------
        float
            Torque wanted, N*m, before limits.
        """


# Where each law is; not imported here, as the laws import this module.
_PLACES = {
    'pi': ('traction_controller.control.laws.pi', 'PiLaw'),
    'scheduled_pi': ('traction_controller.control.laws.pi', 'ScheduledPiLaw'),
    'sliding_mode': ('traction_evaluation.baselines.sliding_mode', 'SlidingModeLaw'),
    'lqi': ('traction_controller.control.laws.lqi', 'LqiLaw'),
    'lpv': ('traction_controller.control.laws.lpv', 'LpvLaw'),
}

# What every law is made from, besides wheel and load.
_COMMON = ('slip', 'lag', 'dt')

LAWS = tuple(_PLACES)
"""Names of all laws."""


def make_law(
    name: str,
    wheel: Wheel,
    load: float,
    *,
    slip: float = 0.2,
    lag: float = 0.1,
    dt: float = 0.01,
    settings: Mapping[str, Any] | None = None,
) -> SlipLaw:
    """Make a law for a wheel.

    Parameters
    ----------
    name : str
        One of `LAWS`.
    wheel : Wheel
        The wheel.
    load : float
        Its static load, N, above 0.
    slip : float
        Slip that it is made for, at least 0 and below 1.
    lag : float
        Time constant from commanded to shaft torque, s, above 0.
    dt : float
        Nominal sampling period, s, above 0.
    settings : mapping, optional
        Arguments of the law's own class by name, in its units; see there.

    Returns
    -------
    SlipLaw
        The law, its memory empty.

    Raises
    ------
    ValueError
        Naming the law or setting that there is not, or what is out of range.
    """
    if name not in LAWS:
        raise ValueError(f"unknown control law '{name}'{closest(name, LAWS)}")
    for what, value in (('load', load), ('lag', lag), ('dt', dt)):
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f'{what} must be above 0, got {value}')
    if not 0 <= slip < 1:
        raise ValueError(f'slip must be at least 0 and below 1, got {slip}')
    module, member = _PLACES[name]
    law = getattr(import_module(module), member)
    own = [key for key in signature(law).parameters if key not in ('wheel', 'load', *_COMMON)]
    for key in settings or {}:
        if key not in own:
            raise ValueError(f"control law '{name}' has no setting '{key}'{closest(key, own)}")
    made: SlipLaw = law(wheel, load, slip=slip, lag=lag, dt=dt, **(settings or {}))
    return made
