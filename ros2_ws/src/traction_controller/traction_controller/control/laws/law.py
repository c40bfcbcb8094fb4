"""Control law of one wheel: its interface, and the functions that laws share.

A law acts on one wheel, or on a group of wheels as if it were one. Slip and torque are positive in
the direction of the request. A step starts from the torque that was sent, after all limits. So the
integral cannot wind up, and another law can take over without a jump.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from traction_model.vehicle.wheel import Wheel
from traction_node.positive import check_positive


@dataclass(slots=True)
class WheelState:
    """State of a wheel for its law; the same object at every step.

    Attributes
    ----------
    slip : float
        Slip in the direction of the request, -1 to 1.
    rim_speed : float
        r*omega, m/s; only its magnitude matters.
    speed : float
        Speed over ground, m/s; only its magnitude matters.
    stiffness : float
        Slip stiffness, N: slope of gross traction over slip, at least 0.
    gross_traction : float
        Gross traction, N, in the direction of the request.
    shaft_torque : float
        Shaft torque, N·m, in the direction of the request.
    """

    slip: float = 0.0
    rim_speed: float = 0.0
    speed: float = 0.0
    stiffness: float = 0.0
    gross_traction: float = 0.0
    shaft_torque: float = 0.0


class SlipLaw(ABC):
    """Control law of the slip of a wheel.

    Attributes
    ----------
    gains : tuple of float
        Gains of the last step: on slip (N·m), on shaft torque (1), on the integral of the slip
        error (N·m/s), and others of the law; for the state message.
    velocity_form : bool
        True if each step adds an increment to the torque sent, so that it needs anti-windup.
        Other laws compute the whole torque from the state of the wheel.
    """

    velocity_form: ClassVar[bool]
    gains: tuple[float, ...] = (0.0, 0.0, 0.0)

    @abstractmethod
    def reset(self) -> None:
        """Reset to the initial state."""

    @abstractmethod
    def torque(self, state: WheelState, target: float, sent: float, dt: float) -> float:
        """Compute the torque of one step.

        Parameters
        ----------
        state : WheelState
            State of the wheel, SI units.
        target : float
            Slip target, 0.01 to 0.9.
        sent : float
            Torque sent at the last step, after all limits, N·m.
        dt : float
            Time since the last step, s, at least 0.

        Returns
        -------
        float
            Torque before limits, N·m.
        """


class Takeover:
    """Bumpless transfer from the torque sent before to that of a law.

    The offset between them at the first step is added to the torque of the law and decays,
    ``offset(t) = offset(0)*exp(-t/time)``.

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
        check_positive(takeover_time=time)
        self._time = time
        self.reset()

    def reset(self) -> None:
        """Reset the offset: the next step starts from the torque sent."""
        self._offset: float | None = None

    def torque(self, wanted: float, sent: float, dt: float) -> float:
        """Add the decayed offset.

        Parameters
        ----------
        wanted : float
            Torque of the law, N·m.
        sent : float
            Torque sent at the last step, N·m.
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
    """Torque against soil and bearings of a wheel in steady motion.

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
