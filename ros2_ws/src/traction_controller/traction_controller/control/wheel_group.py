"""Wheel group: wheels with one control law.

The torque of a group is that of one of its wheels, the reference. It is positive in the direction
of the request, so forward and backward are the same task. The share of a wheel is its torque over
that of the reference.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from traction_controller.control.exit_reason import ExitReason, LimitStatus
from traction_controller.control.laws.law import SlipLaw, WheelState
from traction_controller.control.slip_state import SlipState
from traction_controller.control.wheel_outcome import NO_GAINS, Degraded, WheelOutcome
from traction_model.slip import slip as slip_of

# Initial slip stiffness over static load: firm soil, where gains are low.
_FIRST_STIFFNESS = 5.0


@dataclass(slots=True, eq=False)
class DrivenWheel:
    """Data of one wheel for its control, with the measurements of the present step.

    Attributes
    ----------
    index : int
        Index in `Vehicle.wheel_names`.
    radius : float
        Rolling radius, m.
    load : float
        Static load, N.
    friction : float
        Friction torque of the bearings over rim speed, N*s.
    hold_torque : float
        Largest torque in mode HOLD, N·m.
    torque_rate : float
        Limit of the rate of torque, N·m/s.
    law : SlipLaw
        Law in force.
    stiffness : float
        Last known slip stiffness, N.
    expected_torque : float
        Shaft torque expected from the commands, N·m, forward positive.
    shaft_torque : float
        Shaft torque, measured, or expected if missing, N·m, forward positive.
    outcome : WheelOutcome
        Result of the last step.
    """

    index: int
    radius: float
    load: float
    friction: float
    hold_torque: float
    torque_rate: float
    law: SlipLaw
    stiffness: float = 0.0
    expected_torque: float = 0.0
    shaft_torque: float = 0.0
    outcome: WheelOutcome = field(default_factory=WheelOutcome)

    def reset(self) -> None:
        """Reset torques to 0 and the slip stiffness to its initial value; the law is kept."""
        self.stiffness = _FIRST_STIFFNESS * self.load
        self.expected_torque = 0.0
        self.shaft_torque = 0.0
        self.outcome = WheelOutcome()

    def measure(self, shaft_torque: float, speed_measured: bool, arriving: float) -> None:
        """Set the shaft torque; if it is missing, use the sent torque after the lag.

        Parameters
        ----------
        shaft_torque : float
            Measured torque, N·m, forward positive; NaN if missing.
        speed_measured : bool
            True if a sensor measures the speed over ground.
        arriving : float
            Share of a change of command that reaches the shaft within the step, 0 to 1.
        """
        outcome = self.outcome
        self.expected_torque += arriving * (outcome.torque - self.expected_torque)
        outcome.degraded = Degraded.NONE if speed_measured else Degraded.RADAR
        if math.isnan(shaft_torque):
            shaft_torque = self.expected_torque
            outcome.degraded |= Degraded.SHAFT_TORQUE
        self.shaft_torque = shaft_torque


class WheelGroup:
    """Wheels with one control law.

    Parameters
    ----------
    wheels : sequence of DrivenWheel
        The wheels, at least one.
    lag : float
        Time constant from commanded to shaft torque, s, above 0.
    min_speed : float
        Speed below which slip is not controlled, m/s, above 0.
    locked : bool
        True for a locked differential: equal wheel speeds.

    Attributes
    ----------
    wheels : tuple of DrivenWheel
        The wheels.
    locked : bool
        As given; may change.
    released : float
        Progress of the return of torque to the request since the group left control, 0 to 1.
    """

    # Time for the return to the request after control ends, and for the change of torques after a
    # change of grouping, s.
    _RELEASE_TIME = 0.5
    # Shaft torque is too low if it is below the expected one by more than a tenth of it, plus this
    # share of static load times radius, for some lags.
    _SHORT_OF_EXPECTED = 0.1
    _SHORT_OF_LOAD = 0.02
    _SHORT_LAGS = 3.0

    def __init__(
        self, wheels: Sequence[DrivenWheel], lag: float, min_speed: float, *, locked: bool
    ) -> None:
        self.wheels = tuple(wheels)
        self.locked = locked
        self._lag, self._min_speed = lag, min_speed
        self._short_time = self._SHORT_LAGS * lag
        self._reading = WheelState()
        # Direction of the present step: 1 forward, -1 backward, 0 if requests contradict each
        # other.
        self._direction = 1.0
        self._reference = self.wheels[0]
        self._shares: Sequence[float] = (1.0,) * len(self.wheels)
        self.reset()

    def reset(self) -> None:
        """Reset to the initial state: no torque sent, no law in action, no fault."""
        # Torque of the reference as sent, N·m, forward positive.
        self._sent = 0.0
        # Wheel whose law acted in the last step; the law keeps its state while the wheel is the
        # same.
        self._acting: DrivenWheel | None = None
        self.released = 1.0
        # Time for which shaft torque has been too low, s.
        self._short = 0.0
        self._faulty = False
        # Remaining difference to the torques of the former groups, for each wheel, N·m.
        self._taking_over = False
        self._leftover: list[float] = []
        self._leftover_share = 0.0

    def join(self, released: float) -> None:
        """Start the next step from the torques that the wheels had in other groups.

        Parameters
        ----------
        released : float
            Progress of their return to the requests, 0 to 1.
        """
        self.released = released
        self._taking_over = True

    def restart_law(self) -> None:
        """Reset the law at the next step, after a change of law."""
        self._acting = None

    def step(
        self,
        dt: float,
        state: SlipState,
        request: Sequence[float] | None,
        target: float,
        hold: bool,
    ) -> None:
        """Compute the torque of every wheel and write it to its `outcome`.

        Parameters
        ----------
        dt : float
            Time since the last step, s, at least 0.
        state : SlipState
            Slip of all wheels of the vehicle, SI units.
        request : sequence of float or None
            Requested torque of all wheels of the vehicle, N·m, forward positive; None: no request.
        target : float
            Slip to limit or hold, 0.01 to 0.9.
        hold : bool
            True to hold slip, false to limit it.
        """
        self._split(request)
        direction, shares = self._direction, self._shares
        max_torque = self._max_torque(request, hold)
        if self._taking_over:
            self._take_over()
        sent = direction * self._sent
        reason = self._read(state)
        if request is None:
            reason = ExitReason.REMOTE_COMMAND_TIMEOUT
        elif direction == 0.0:
            reason = ExitReason.REMOTE_COMMAND_INVALID
        elif self._faulty:
            reason = ExitReason.FUNCTION_FAULT
        gains = NO_GAINS
        wanted = 0.0
        if reason is ExitReason.ALL_CLEAR:
            law = self._reference.law
            if self._acting is not self._reference:
                law.reset()
            self._acting = self._reference
            if law.velocity_form:
                sent = self._delivered(dt, sent)
            wanted = law.torque(self._reading, target, sent, dt)
            if law.velocity_form and self._short >= self._short_time:
                # The drive does not deliver more.
                wanted = min(wanted, sent)
            gains = law.gains
            self.released = 0.0
            if not math.isfinite(wanted):
                # The fault of the law lasts until a reset.
                self._faulty = True
                reason, wanted = ExitReason.FUNCTION_FAULT, 0.0
        if reason is not ExitReason.ALL_CLEAR:
            self._acting = None
            self._short = 0.0
            if request is not None and reason in (
                ExitReason.VEHICLE_SPEED_TOO_LOW,
                ExitReason.SLIP_NOT_AVAILABLE,
            ):
                wanted = self._release(dt, sent, abs(request[self._reference.index]))
            if reason is ExitReason.SLIP_NOT_AVAILABLE and not state.speed_measured:
                # Without slip and speed, spinning wheels cannot be detected.
                wanted = min(wanted, sent)
        torque = min(max(wanted, 0.0), max_torque)
        status = _limit_status(reason, wanted, torque)
        torque = self._within_rate(dt, sent, torque, max_torque)
        self._sent = direction * torque
        if self._leftover:
            self._leftover_share -= dt / self._RELEASE_TIME
            if self._leftover_share <= 0.0:
                self._leftover = []
        for place, (wheel, share) in enumerate(zip(self.wheels, shares, strict=True)):
            outcome = wheel.outcome
            own = torque * share
            if self._leftover:
                bound = wheel.hold_torque
                if not hold or max_torque == 0.0:
                    bound = abs(request[wheel.index]) if request is not None else 0.0
                own = min(own + self._leftover[place] * self._leftover_share, bound)
            outcome.torque = direction * own
            outcome.limit_status = status
            outcome.exit_reason = reason
            outcome.slip_target = target
            outcome.gains = gains

    def _split(self, request: Sequence[float] | None) -> None:
        """Set direction, reference and shares of the present step."""
        wheels = self.wheels
        self._direction = 1.0
        if request is not None:
            forward = backward = False
            for wheel in wheels:
                forward = forward or request[wheel.index] > 0.0
                backward = backward or request[wheel.index] < 0.0
            if backward:
                self._direction = 0.0 if forward else -1.0
        if len(wheels) == 1:
            return
        largest = 0.0
        if request is not None and self._direction != 0.0:
            largest = max(abs(request[wheel.index]) for wheel in wheels)
        if request is None or largest == 0.0:
            self._reference = max(wheels, key=_load_of)
            self._shares = (1.0,) * len(wheels)
            return
        # Reference: the wheel whose law acts if it has at least half of the largest request,
        # otherwise the one of those with the largest load.
        asked = [wheel for wheel in wheels if abs(request[wheel.index]) >= 0.5 * largest]
        if self._acting in asked:
            self._reference = self._acting
        else:
            self._reference = max(asked, key=_load_of)
        per_torque = request[self._reference.index]
        self._shares = [request[wheel.index] / per_torque for wheel in wheels]

    def _max_torque(self, request: Sequence[float] | None, hold: bool) -> float:
        """Largest torque of the reference, N·m."""
        if request is None:
            return 0.0
        max_torque = abs(request[self._reference.index])
        if hold and max_torque > 0.0:
            max_torque = math.inf
            for wheel, share in zip(self.wheels, self._shares, strict=True):
                if share > 0.0:
                    max_torque = min(max_torque, wheel.hold_torque / share)
        return max_torque

    def _take_over(self) -> None:
        """Continue from the torques that the wheels had in other groups.

        The group starts from the smallest torque; the excess of the others decays.
        """
        self._taking_over = False
        torques = [self._direction * wheel.outcome.torque for wheel in self.wheels]
        common = math.inf
        for torque, share in zip(torques, self._shares, strict=True):
            if share > 0.0:
                common = min(common, max(torque, 0.0) / share)
        if common == math.inf:
            common = 0.0
        self._sent = self._direction * common
        leftover = [
            max(torque - common * share, 0.0)
            for torque, share in zip(torques, self._shares, strict=True)
        ]
        self._leftover = leftover if any(leftover) else []
        self._leftover_share = 1.0

    def _read(self, state: SlipState) -> ExitReason:
        """Set the input of the law, as if only the reference were driven; returns the exit reason.

        Wheels with another radius or share are scaled to the rim force of the reference. With an
        open differential the wheel with the largest slip is used, with a locked one the mean.
        """
        reading, direction = self._reading, self._direction
        slips, valid, rim_speeds, speed = state.slip, state.valid, state.rim_speed, state.speed
        gross_tractions = state.gross_traction
        radius = self._reference.radius
        common = self.locked and len(self.wheels) > 1
        slow = True
        found = 0
        # Sums over the wheels in use; weight: their number of references.
        rim_speed = stiffness = traction = weight = 0.0
        largest_slip = -math.inf
        shaft = shaft_weight = 0.0
        for wheel, share in zip(self.wheels, self._shares, strict=True):
            if share <= 0.0:
                continue
            j = wheel.index
            rim = rim_speeds[j]
            per_reference = share * radius / wheel.radius
            shaft += direction * wheel.shaft_torque * radius / wheel.radius
            shaft_weight += per_reference
            fastest = speed if abs(speed) > abs(rim) else rim
            if abs(fastest) < self._min_speed:
                continue
            slow = False
            if not valid[j]:
                wheel.outcome.degraded |= Degraded.TACHOMETER
                continue
            found += 1
            if gross_tractions is None:
                # Steady motion: T = r*F + b_f*omega.
                own = direction * wheel.shaft_torque - wheel.friction * abs(rim)
                own /= wheel.radius
            else:
                own = direction * gross_tractions[j]
            if common:
                rim_speed += rim
                stiffness += wheel.stiffness
                traction += own
                weight += per_reference
                continue
            slip = direction * slips[j] if fastest >= 0.0 else -direction * slips[j]
            if slip > largest_slip:
                largest_slip, rim_speed, traction = slip, rim, own
                stiffness, weight = wheel.stiffness, per_reference
        reading.shaft_torque = shaft / shaft_weight if shaft_weight else 0.0
        if not found:
            if slow:
                return ExitReason.VEHICLE_SPEED_TOO_LOW
            return ExitReason.SLIP_NOT_AVAILABLE
        if common:
            rim_speed /= found
            fastest = speed if abs(speed) > abs(rim_speed) else rim_speed
            largest_slip = float(slip_of(speed, rim_speed))
            largest_slip *= direction if fastest >= 0.0 else -direction
        reading.slip = largest_slip
        reading.rim_speed = rim_speed
        reading.speed = speed
        reading.stiffness = stiffness / weight
        reading.gross_traction = traction / weight
        return ExitReason.ALL_CLEAR

    def _delivered(self, dt: float, sent: float) -> float:
        """Torque from which a law in velocity form continues.

        The sent torque, or less after shaft torque has been too low for some time.
        """
        radius = self._reference.radius
        expected = weight = 0.0
        for wheel, share in zip(self.wheels, self._shares, strict=True):
            if share > 0.0:
                expected += self._direction * wheel.expected_torque * radius / wheel.radius
                weight += share * radius / wheel.radius
        expected /= weight
        allowed = self._SHORT_OF_EXPECTED * expected
        allowed += self._SHORT_OF_LOAD * self._reference.load * radius
        missing = expected - self._reading.shaft_torque - allowed
        if missing <= 0.0:
            self._short = max(self._short - dt, 0.0)
            return sent
        self._short = min(self._short + dt, self._short_time)
        if self._short < self._short_time:
            return sent
        return sent - (1.0 - math.exp(-dt / self._lag)) * missing

    def _release(self, dt: float, sent: float, request: float) -> float:
        """Torque of a group that is not under control: gradual return to the request."""
        self.released = min(1.0, self.released + dt / self._RELEASE_TIME)
        if request <= sent:
            return request
        return sent + self.released * (request - sent)

    def _within_rate(self, dt: float, sent: float, torque: float, max_torque: float) -> float:
        """Torque of the reference within the rate limits of all wheels."""
        rate = math.inf
        for wheel, share in zip(self.wheels, self._shares, strict=True):
            if share > 0.0:
                rate = min(rate, wheel.torque_rate / share)
        change = torque - sent
        if abs(change) > rate * dt:
            return min(max(sent + math.copysign(rate * dt, change), 0.0), max_torque)
        return torque


def _load_of(wheel: DrivenWheel) -> float:
    return wheel.load


def _limit_status(reason: ExitReason, wanted: float, torque: float) -> LimitStatus:
    """Limit status of a torque: limited by the request, at 0, or by slip."""
    if reason is ExitReason.FUNCTION_FAULT:
        return LimitStatus.NON_RECOVERABLE_FAULT
    if reason is not ExitReason.ALL_CLEAR:
        return LimitStatus.NOT_AVAILABLE
    if wanted > torque:
        return LimitStatus.OPERATOR_LIMITED
    if wanted < torque:
        return LimitStatus.LIMITED_LOW
    return LimitStatus.LIMITED_HIGH
