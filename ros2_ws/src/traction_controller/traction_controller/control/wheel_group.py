"""Wheel group: wheels that are controlled as one, and the torque that one control law gives them.

The torque of a group is that of one of its wheels, the reference. It is counted along the request:
positive drives the way the request points, so that forward and backward are the same task. The
share of a wheel is its torque per torque of the reference.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from traction_controller.control.exit_reason import ExitReason, LimitStatus
from traction_controller.control.laws.law import SlipLaw, WheelState
from traction_controller.control.slip_state import SlipState
from traction_controller.control.wheel_outcome import NO_GAINS, Degraded, WheelOutcome
from traction_model.slip import slip as slip_of

# Slip stiffness before one is known, in static loads: firm soil, on which gains are low.
_FIRST_STIFFNESS = 5.0


@dataclass(slots=True, eq=False)
class DrivenWheel:
    """Data of one wheel that its control needs, and its measurements of the present step.

    Attributes
    ----------
    index : int
        Place in `Vehicle.wheel_names`.
    radius : float
        m.
    load : float
        Static load, N.
    friction : float
        Friction torque of the bearings over rim speed, N*s.
    hold_torque : float
        Largest torque in mode HOLD, N·m.
    torque_rate : float
        Fastest change of torque, N·m/s.
    law : SlipLaw
        Law in force.
    stiffness : float
        Slip stiffness known last, N.
    expected_torque : float
        Shaft torque expected from the commands, N·m, forward positive.
    shaft_torque : float
        Shaft torque, measured or else expected, N·m, forward positive.
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
        """Set torques to 0 and the slip stiffness to its first value; the law is kept."""
        self.stiffness = _FIRST_STIFFNESS * self.load
        self.expected_torque = 0.0
        self.shaft_torque = 0.0
        self.outcome = WheelOutcome()

    def measure(self, shaft_torque: float, speed_measured: bool, arriving: float) -> None:
        """Take over the shaft torque; where it is missing, use what was sent, after the lag.

        Parameters
        ----------
        shaft_torque : float
            Measured, N·m, forward positive; NaN where it is missing.
        speed_measured : bool
            Whether a sensor measures the speed over ground.
        arriving : float
            Share of a change of command that arrives at the shaft within the step, 0 to 1.
        """
        outcome = self.outcome
        self.expected_torque += arriving * (outcome.torque - self.expected_torque)
        outcome.degraded = Degraded.NONE if speed_measured else Degraded.RADAR
        if math.isnan(shaft_torque):
            shaft_torque = self.expected_torque
            outcome.degraded |= Degraded.SHAFT_TORQUE
        self.shaft_torque = shaft_torque


class WheelGroup:
    """Wheels that are controlled as one.

    Parameters
    ----------
    wheels : sequence of DrivenWheel
        The wheels, at least one.
    lag : float
        Time constant from commanded to shaft torque, s, above 0.
    min_speed : float
        Speed below which slip is not acted on, m/s, above 0.
    locked : bool
        Whether a locked differential makes the wheels turn alike.

    Attributes
    ----------
    wheels : tuple of DrivenWheel
        The wheels.
    locked : bool
        As given; may change.
    released : float
        How far the torque has gone back to the request since the group left control, 0 to 1.
    """

    # Time in which a group that left control goes back to its request, and in which torques that
    # another grouping left give way to the new one's, s.
    _RELEASE_TIME = 0.5
    # Shaft torque is too low if it is below the expected one by a tenth of it and this share of
    # the torque that lifts the static load at the radius. It counts after some lags.
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
        # Of the present step: 1 forward, -1 backward, 0 where requests contradict each other.
        self._direction = 1.0
        self._reference = self.wheels[0]
        self._shares: Sequence[float] = (1.0,) * len(self.wheels)
        self.reset()

    def reset(self) -> None:
        """Begin anew: no torque sent, no law acting, no fault."""
        # Torque of the reference that was really sent, N·m, forward positive.
        self._sent = 0.0
        # Wheel whose law acted in the last step; the law keeps its memory while it stays.
        self._acting: DrivenWheel | None = None
        self.released = 1.0
        # For how long the shafts have had less torque than expected, s.
        self._short = 0.0
        self._faulty = False
        # Part of the torques of the former groups that is still to fade, of each wheel, N·m.
        self._taking_over = False
        self._leftover: list[float] = []
        self._leftover_share = 0.0

    def join(self, released: float) -> None:
        """Start the next step from the torques that the wheels had in other groups.

        Parameters
        ----------
        released : float
            How far these had gone back to their requests, 0 to 1.
        """
        self.released = released
        self._taking_over = True

    def restart_law(self) -> None:
        """Let the law begin anew at the next step: it is another one than before."""
        self._acting = None

    def step(
        self,
        dt: float,
        state: SlipState,
        request: Sequence[float] | None,
        target: float,
        hold: bool,
    ) -> None:
        """Find the torque of every wheel and write it to the wheel's `outcome`.

        Parameters
        ----------
        dt : float
            Time since the last step, s, at least 0.
        state : SlipState
            Slip of all wheels of the vehicle, SI units.
        request : sequence of float or None
            Requested torque of all wheels of the vehicle, N·m, forward positive; None: there is
            none.
        target : float
            Slip to limit or hold, 0.01 to 0.9.
        hold : bool
            Whether slip is held, not limited.
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
                # The drive delivers no more than this.
                wanted = min(wanted, sent)
            gains = law.gains
            self.released = 0.0
            if not math.isfinite(wanted):
                # The law is at fault until a reset.
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
                # Without slip and speed, spinning wheels would not be seen.
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
        """Find direction, reference and shares of the present step."""
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
        # The reference has at least half of the largest request: the acting wheel if it has,
        # otherwise the one that carries most.
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
        """Go on from the torques that the wheels had in other groups.

        The group sends to all wheels what the one with the least had; what others had more fades.
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
        """Find what the law is told, as if the reference alone were driven; why not, otherwise.

        A wheel with another radius or share counts by the force that its rim would have at the
        reference. With an open differential the wheel that slips most counts, with a locked one
        the mean of all.
        """
        reading, direction = self._reading, self._direction
        slips, valid, rim_speeds, speed = state.slip, state.valid, state.rim_speed, state.speed
        gross_tractions = state.gross_traction
        radius = self._reference.radius
        common = self.locked and len(self.wheels) > 1
        slow = True
        found = 0
        # Sums over the wheels that count; weight: how many references they are.
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
        """Torque that a law in velocity form continues from.

        It is the torque sent, or less where the shafts have had too little for some time.
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
        """Torque of a group that is not under control: it goes to the request step by step."""
        self.released = min(1.0, self.released + dt / self._RELEASE_TIME)
        if request <= sent:
            return request
        return sent + self.released * (request - sent)

    def _within_rate(self, dt: float, sent: float, torque: float, max_torque: float) -> float:
        """Torque of the reference that no wheel changes faster for than it may."""
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
    """Say by what a torque is limited: by the request, at 0, or by slip."""
    if reason is ExitReason.FUNCTION_FAULT:
        return LimitStatus.NON_RECOVERABLE_FAULT
    if reason is not ExitReason.ALL_CLEAR:
        return LimitStatus.NOT_AVAILABLE
    if wanted > torque:
        return LimitStatus.OPERATOR_LIMITED
    if wanted < torque:
        return LimitStatus.LIMITED_LOW
    return LimitStatus.LIMITED_HIGH
