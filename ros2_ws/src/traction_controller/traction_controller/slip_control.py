"""Slip control: limits or holds the slip of every wheel through its drive torque.

The control law is the scheduled LQI in velocity form: every step adds

    du = -k_i*(change of slip) - k_T*(change of shaft torque) + k_z*(target - slip)*dt

to the torque last sent. So gains may change from step to step and modes may switch without
a bump, and no integrator can wind up: what was not sent is not remembered. A wheel that leaves
control (too slow, slip not valid) goes back to its request within half a second.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from traction_controller.gain_schedule import ControlWeights, GainSchedule
from traction_model.slip import LEAST_SPEED
from traction_model.vehicle import GRAVITY, Vehicle


class Mode(IntEnum):
    """What the controller does, numbered as in the ControllerState message."""

    LIMIT = 0
    HOLD = 1


class LimitStatus(IntEnum):
    """Limit status of a wheel's torque, numbered as in ISO 11783-7."""

    NOT_LIMITED = 0
    OPERATOR_LIMITED = 1
    LIMITED_HIGH = 2
    LIMITED_LOW = 3
    NOT_AVAILABLE = 7


class ExitReason(IntEnum):
    """Why a wheel is not under slip control, numbered as in the ControllerState message."""

    NONE = 0
    SPEED_TOO_LOW = 1
    SLIP_NOT_AVAILABLE = 2
    NO_REQUEST = 3


@dataclass
class WheelOutcome:
    """What the controller did with one wheel in the last step.

    Attributes
    ----------
    torque : float
        Commanded torque, N*m, forward positive.
    limit_status : LimitStatus
        Whether and by what the torque is limited.
    exit_reason : ExitReason
        Why the wheel is not under slip control; NONE when it is.
    gains : tuple of float
        Scheduled gains on slip (N*m), shaft torque (1) and integral (N*m/s).
    """

    torque: float = 0.0
    limit_status: LimitStatus = LimitStatus.NOT_AVAILABLE
    exit_reason: ExitReason = ExitReason.NO_REQUEST
    gains: tuple[float, float, float] = (0.0, 0.0, 0.0)


class SlipControl:
    """Limits or holds the slip of every wheel of a vehicle.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle, SI units.
    slip_target : float
        Slip to limit or hold, 0.01 to 0.9.
    mode : Mode
        LIMIT only ever reduces the magnitude of the requested torque; HOLD regulates slip to
        the target with torques from 0 to `hold_torque` in the direction of the request; a
        request of 0 is no torque in either mode.
    lag : float
        Time constant from commanded to shaft torque, s, above 0.
    dt : float
        Nominal sampling period, s, above 0.
    weights : ControlWeights
        What the regulator weighs against each other.
    hold_torque : float or sequence of float
        Largest torque in HOLD of every wheel, or of each, N*m, above 0: what the gate lets
        through, as control cannot know of torque that is cut further on.
    least_speed : float
        Speed below which slip is not acted on, m/s, above 0.

    Attributes
    ----------
    outcomes : list of WheelOutcome
        What was done with each wheel in the last step.
    """

    LEAST_TARGET = 0.01
    MOST_TARGET = 0.9
    # Time in which a wheel that left control goes back to its request, s.
    _RELEASE_TIME = 0.5

    def __init__(
        self,
        vehicle: Vehicle,
        slip_target: float,
        mode: Mode = Mode.LIMIT,
        lag: float = 0.1,
        dt: float = 0.01,
        weights: ControlWeights = ControlWeights(),
        hold_torque: float | Sequence[float] = 10000.0,
        least_speed: float = LEAST_SPEED,
    ) -> None:
        n = len(vehicle.wheels)
        each = [hold_torque] if isinstance(hold_torque, int | float) else list(hold_torque)
        if len(each) == 1:
            each *= n
        if len(each) != n:
            raise ValueError(f'hold_torque has {len(each)} entries for {n} wheels')
        for name, value in (
            *(('hold_torque', value) for value in each),
            ('least_speed', least_speed),
        ):
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f'{name} must be above 0, got {value}')
        self.vehicle = vehicle
        self.mode = mode
        self.hold_torque = each
        self.least_speed = least_speed
        self.set_target(slip_target)
        # Like wheels under like load share a schedule.
        schedules: dict[tuple[object, float], GainSchedule] = {}
        self.schedules = []
        for wheel, load in zip(vehicle.wheels, vehicle.static_loads(), strict=True):
            key = (wheel, round(float(load), 6))
            if key not in schedules:
                schedules[key] = GainSchedule(
                    wheel, float(load), slip_target, lag, dt, weights, GRAVITY
                )
            self.schedules.append(schedules[key])
        self.reset()

    @property
    def n_wheels(self) -> int:
        """Number of wheels, dimensionless."""
        return len(self.schedules)

    def reset(self) -> None:
        """Forget the past: no torque sent, no slip seen."""
        n = self.n_wheels
        self.outcomes = [WheelOutcome() for _ in range(n)]
        self._last_slip: list[float | None] = [None] * n
        self._last_torque = [0.0] * n
        # How far a wheel that left control has gone back to its request, 0 to 1.
        self._released = [1.0] * n

    def set_target(self, slip_target: float) -> None:
        """Change the target; the gains stay those of the target they were computed for.

        Parameters
        ----------
        slip_target : float
            0.01 to 0.9.

        Raises
        ------
        ValueError
            If the target is out of range.
        """
        if not self.LEAST_TARGET <= slip_target <= self.MOST_TARGET:
            raise ValueError(
                f'slip target must be {self.LEAST_TARGET} to {self.MOST_TARGET}, got {slip_target}'
            )
        self.slip_target = slip_target

    def step(
        self,
        dt: float,
        slips: Sequence[float],
        valid: Sequence[bool],
        rim_speeds: Sequence[float],
        speed: float,
        stiffnesses: Sequence[float],
        shaft_torques: Sequence[float],
        requests: Sequence[float] | None,
    ) -> list[WheelOutcome]:
        """Find the torque of every wheel from a new slip estimate.

        Parameters
        ----------
        dt : float
            Time since the last step, s, at least 0.
        slips : sequence of float
            Slip of every wheel, -1 to 1.
        valid : sequence of bool
            Whether each slip means anything.
        rim_speeds : sequence of float
            r*omega, m/s, forward positive.
        speed : float
            Speed over ground, m/s, forward positive.
        stiffnesses : sequence of float
            Slip stiffness of every wheel, N, at least 0.
        shaft_torques : sequence of float
            Measured shaft torque, N*m, forward positive.
        requests : sequence of float or None
            Requested torque of every wheel, N*m, forward positive; None before the first.

        Returns
        -------
        list of WheelOutcome
            `outcomes`; the same objects every time.
        """
        for j, outcome in enumerate(self.outcomes):
            # Backward torque is the same task mirrored: seen along the request, slip that
            # goes with it is positive.
            request = 0.0 if requests is None else requests[j]
            along = -1.0 if request < 0.0 else 1.0
            rim = rim_speeds[j]
            fastest = speed if abs(speed) > abs(rim) else rim
            slip = along * slips[j] if fastest >= 0.0 else -along * slips[j]
            shaft = along * shaft_torques[j]
            outcome.gains = self.schedules[j].at(rim, stiffnesses[j])
            most = abs(request)
            if self.mode is Mode.HOLD and request != 0.0:
                most = self.hold_torque[j]
            sent = along * outcome.torque
            if requests is None:
                outcome.exit_reason = ExitReason.NO_REQUEST
                torque = 0.0
            elif abs(fastest) < self.least_speed:
                outcome.exit_reason = ExitReason.SPEED_TOO_LOW
                torque = self._release(j, dt, sent, abs(request))
            elif not valid[j]:
                outcome.exit_reason = ExitReason.SLIP_NOT_AVAILABLE
                torque = self._release(j, dt, sent, abs(request))
            else:
                outcome.exit_reason = ExitReason.NONE
                slip_gain, torque_gain, integral_gain = outcome.gains
                torque = sent
                torque += integral_gain * (self.slip_target - slip) * dt
                last = self._last_slip[j]
                if last is not None:
                    torque -= slip_gain * (slip - last)
                    torque -= torque_gain * (shaft - self._last_torque[j])
            controlled = outcome.exit_reason is ExitReason.NONE
            self._last_slip[j] = slip if controlled else None
            if controlled:
                self._released[j] = 0.0
            self._last_torque[j] = shaft
            limited = min(max(torque, 0.0), most)
            outcome.limit_status = self._status(outcome.exit_reason, torque, limited)
            outcome.torque = along * limited
        return self.outcomes

    def _release(self, j: int, dt: float, sent: float, request: float) -> float:
        """Torque of a wheel that is not under control: the request, at first step by step."""
        self._released[j] = min(1.0, self._released[j] + dt / self._RELEASE_TIME)
        if request <= sent:
            return request
        return sent + self._released[j] * (request - sent)

    def _status(self, reason: ExitReason, wanted: float, sent: float) -> LimitStatus:
        if reason is not ExitReason.NONE:
            return LimitStatus.NOT_AVAILABLE
        if wanted > sent:
            return LimitStatus.OPERATOR_LIMITED
        if wanted < sent:
            return LimitStatus.LIMITED_LOW
        return LimitStatus.LIMITED_HIGH
