"""Control law of one wheel: its interface, and the functions that laws share.

A law acts on one wheel, or on a group of wheels as if it were one. All it is told is counted
along the request: slip above 0 goes with the request, and so does torque. It starts
from the torque that was really sent, after all limits. So its integral cannot wind up, and another
law continues from where it stops.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from traction_model.vehicle.wheel import Wheel


@dataclass(slots=True)
class WheelState:
    """State of a wheel as its law is told it; one and the same object at every step.

    Attributes
    ----------
    slip : float
        Slip along the request, -1 to 1.
    rim_speed : float
        r*omega, m/s; its magnitude counts.
    speed : float
        Speed over ground, m/s; its magnitude counts.
    stiffness : float
        Slip stiffness, N: slope of gross traction over slip, at least 0.
    gross_traction : float
        Gross traction, N, along the request.
    shaft_torque : float
        Shaft torque, N·m, along the request.
    """

    slip: float = 0.0
    rim_speed: float = 0.0
    speed: float = 0.0
    stiffness: float = 0.0
    gross_traction: float = 0.0
    shaft_torque: float = 0.0


class SlipLaw(ABC):
    """Law that brings the slip of a wheel to a target.

    Attributes
    ----------
    gains : tuple of float
        Gains of the last step: on slip (N·m), on shaft torque (1), on the integral of the slip
        error (N·m/s), and what else the law has; for the state message.
    velocity_form : bool
        Whether each step adds to the torque sent, so that torque which is not delivered must come
        off it. Other laws compute the whole torque from the state of the wheel.
    """

    velocity_form: ClassVar[bool]
    gains: tuple[float, ...] = (0.0, 0.0, 0.0)

    @abstractmethod
    def reset(self) -> None:
        """Forget the past: the next step is the first."""

    @abstractmethod
    def torque(self, state: WheelState, target: float, sent: float, dt: float) -> float:
        """Find the torque of one step.

        Parameters
        ----------
        state : WheelState
            The wheel as it is, SI units.
        target : float
            Slip to reach, 0.01 to 0.9.
        sent : float
            Torque that was really sent at the last step, after all limits, N·m.
        dt : float
            Time since the last step, s, at least 0.

        Returns
        -------
        float
            Torque wanted, N·m, before limits.
        """


class Takeover:
    """Bumpless takeover: the torque that was sent before gives way to the one of a law.

    At the first step the law's torque is raised by an offset to the torque sent; the offset then
    decays, ``offset(t) = offset(0)*exp(-t/time)``.

    Parameters
    ----------
    time : float
        Time constant, s, above 0.

    Raises
    ------
    ValueError
        If the time is out of range.
    """

    def __init__(self, time: float) -> None:
        self._time = checked('takeover_time', time)
        self.reset()

    def reset(self) -> None:
        """Forget the offset: the next step takes over whatever torque was sent."""
        self._offset: float | None = None

    def torque(self, wanted: float, sent: float, dt: float) -> float:
        """Add what is left of the offset.

        Parameters
        ----------
        wanted : float
            Torque that the law wants by itself, N·m.
        sent : float
            Torque that was really sent at the last step, N·m.
        dt : float
            Time since the last step, s, at least 0.

        Returns
        -------
        float
            Torque to send, N·m.
        """
        if self._offset is None:
            self._offset = sent - wanted
        self._offset *= math.exp(-dt / self._time)
        return wanted + self._offset


def soil_moment(wheel: Wheel, state: WheelState) -> float:
    """Torque that balances soil and bearings of a wheel in steady motion.

    Parameters
    ----------
    wheel : Wheel
        The wheel.
    state : WheelState
        Its state, SI units.

    Returns
    -------
    float
        M, N·m: ``r*F + b_f*omega``, F the gross traction.
    """
    omega = abs(state.rim_speed) / wheel.radius
    return wheel.radius * state.gross_traction + wheel.viscous_friction * omega


def checked(name: str, value: float) -> float:
    """Refuse an argument that is not a number above 0.

    Parameters
    ----------
    name : str
        Its name, for the error.
    value : float
        Its value, any unit.

    Returns
    -------
    float
        The value, in its unit.

    Raises
    ------
    ValueError
        If it is not finite or not above 0.
    """
    if not (math.isfinite(value) and value > 0):
        raise ValueError(f'{name} must be above 0, got {value}')
    return value
