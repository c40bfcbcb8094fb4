"""Slip control: limits or holds the slip of wheels through their drive torque.

A control law (`traction_controller.control.laws.law`) finds the torque of every wheel, or of every
group of wheels that one torque drives (`traction_controller.control.driveline`). Every law changes
the torque that was really sent. So gains may change from step to step, and modes, laws, groups and
targets may be switched without a bump, and nothing can wind up: what was not sent, or what the
shafts show not to have been delivered, is not remembered. A wheel that leaves control (too slow,
slip not valid) goes back to its request within half a second; where neither slip nor speed are
known, its torque may only fall.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import Any

from traction_controller.control.driveline import (
    Differential,
    Grouping,
    driven_axles,
    wheel_groups,
)
from traction_controller.control.exit_reason import OPERATOR_CONTROLLED, ExitReason, LimitStatus
from traction_controller.control.laws.law import SlipLaw, WheelState
from traction_controller.control.laws.registry import LAWS, make_law
from traction_controller.control.slip_state import SlipState
from traction_model.slip import MIN_SPEED
from traction_model.slip import slip as slip_of
from traction_model.vehicle.vehicle import Vehicle


class Mode(IntEnum):
    """What the controller does, numbered as in the ControllerState message."""

    LIMIT = 0
    HOLD = 1


class TargetSource(IntEnum):
    """Where the slip target comes from, numbered as in the ControllerState message."""

    PARAMETER = 0
    TOPIC = 1
    SET_POINT = 2

    @property
    def words(self) -> str:
        """The source as a text."""
        return self.name.lower().replace('_', ' ')


class Degraded(IntFlag):
    """What a wheel's control does without, numbered as in the ControllerState message."""

    NONE = 0
    RADAR = 1
    TACHOMETER = 2
    SHAFT_TORQUE = 4

    @property
    def words(self) -> str:
        """What is missing as a text."""
        missing = [str(flag.name).lower().replace('_', ' ') for flag in Degraded if flag & self]
        return f'without {", ".join(missing)}' if missing else 'nothing is missing'


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
        Why the wheel is not under slip control; ALL_CLEAR when it is.
    degraded : Degraded
        What its control does without.
    slip_target : float
        Slip target acted on, dimensionless: lower than the one given while speed is not measured.
    gains : tuple of float
        Gains on slip (N*m), shaft torque (1) and integral (N*m/s), and what else the law has.
    """

    torque: float = 0.0
    limit_status: LimitStatus = LimitStatus.NOT_AVAILABLE
    exit_reason: ExitReason = ExitReason.REMOTE_COMMAND_TIMEOUT
    degraded: Degraded = Degraded.NONE
    slip_target: float = 0.0
    gains: tuple[float, ...] = (0.0, 0.0, 0.0)


class _Group:
    """Wheels that are controlled as one, and what is remembered of them.

    Its torque is counted as that of one of its wheels, the reference; another wheel's share is
    its torque per torque of the reference.
    """

    def __init__(self, wheels: tuple[int, ...]) -> None:
        self.wheels = wheels
        self.reset()

    def reset(self) -> None:
        # Torque of the reference that was really sent, forward positive.
        self.sent = 0.0
        # The wheel whose law acts, -1 for none; the law remembers while the wheel stays.
        self.reference = -1
        # How far it has gone back to its request since it left control, 0 to 1.
        self.released = 1.0
        # For how long less torque has been delivered than sent, s.
        self.short = 0.0
        self.faulty = False
        # What is left of the torques taken over from other groups, of each wheel, N*m.
        self.left: list[float] | None = None
        self.left_share = 0.0


class SlipControl:
    """Limits or holds the slip of the wheels of a vehicle.

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
    law : str
        Name of the control law, one of `laws`.
    settings : mapping of str, optional
        Settings of laws: for each name of a law its arguments by name, in their own units; a
        mapping in place of an argument has that of every wheel, by the wheel's name.
    laws : mapping of str to class
        Classes of the laws to choose from, by name; an evaluation adds its baselines.
    hold_torque : float or sequence of float
        Largest torque in HOLD of every wheel, or of each, N*m, above 0: what the gate lets
        through.
    torque_rate : float or sequence of float
        Fastest change of torque of every wheel, or of each, N*m/s, above 0: what the gate lets
        through. A request that falls faster is followed at once.
    min_speed : float
        Speed below which slip is not acted on, m/s, above 0.
    grouping : Grouping
        Which wheels are controlled as one.
    differential : Differential
        Whether the wheels of a group turn alike.
    driven : str
        Which axles are driven, see `traction_controller.control.driveline.DRIVEN_AXLES`; the
        wheels of others get no torque.

    Attributes
    ----------
    outcomes : list of WheelOutcome
        What was done with each wheel in the last step.
    slip_target : float
        The target in force, dimensionless.
    target_source : TargetSource
        Where it comes from.
    law : str
        Name of the law in force.
    grouping : Grouping
        Which wheels are controlled as one.
    differential : Differential
        Whether the wheels of a group turn alike.
    driven : str
        Which axles are driven.
    changes : list of str
        What changed from the end of the last step but one to that of the last, and why, in the
        words of ISO 11783-7: mode, law, driveline, source of the target, and whether and why
        wheels are not, or not completely, under control.
    change_count : int
        Number of changes since the last reset, dimensionless.
    """

    MIN_TARGET = 0.01
    MAX_TARGET = 0.9
    # Slip stiffness before one is known, in static loads.
    _FIRST_STIFFNESS = 5.0
    # Time in which a wheel that left control goes back to its request, and in which torques that
    # another grouping left go over to the new one's, s.
    _RELEASE_TIME = 0.5
    # Torque counts as not delivered beyond a tenth of what was sent and a share of the torque
    # that lifts the static load at the radius, once that has lasted for some lags.
    _SHORT_OF_SENT = 0.1
    _SHORT_OF_LOAD = 0.02
    _SHORT_LAGS = 3.0

    def __init__(
        self,
        vehicle: Vehicle,
        slip_target: float,
        mode: Mode = Mode.LIMIT,
        *,
        lag: float = 0.1,
        dt: float = 0.01,
        law: str = 'lqi',
        settings: Mapping[str, Mapping[str, Any]] | None = None,
        laws: Mapping[str, Callable[..., SlipLaw]] = LAWS,
        hold_torque: float | Sequence[float] = 10000.0,
        torque_rate: float | Sequence[float] = math.inf,
        min_speed: float = MIN_SPEED,
        grouping: Grouping = Grouping.WHEEL,
        differential: Differential = Differential.OPEN,
        driven: str = 'all',
    ) -> None:
        self._n = len(vehicle.wheels)
        self.vehicle = vehicle
        self._names = vehicle.wheel_names
        self.hold_torque = self._each('hold_torque', hold_torque)
        self.torque_rate = self._each('torque_rate', torque_rate)
        for name, value in (('min_speed', min_speed), ('lag', lag), ('dt', dt)):
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f'{name} must be above 0, got {value}')
        self.min_speed = min_speed
        self._lag, self._dt = lag, dt
        self._loads = [float(load) for load in vehicle.static_loads()]
        self._radii = [wheel.radius for wheel in vehicle.wheels]
        self._friction = [wheel.viscous_friction / wheel.radius for wheel in vehicle.wheels]
        self._settings = dict(settings or {})
        self._mode = mode
        self._law_classes = dict(laws)
        self._reading = WheelState()
        self.outcomes = [WheelOutcome() for _ in range(self._n)]
        self._groups: list[_Group] = []
        self._made: dict[str, list[SlipLaw]] = {}
        self._untold: list[str] = []
        self.change_count = 0
        self.target_source = TargetSource.PARAMETER
        self.set_target(slip_target)
        self._made_for = slip_target
        self.law = ''
        self.set_law(law)
        self.grouping, self.differential, self.driven = grouping, differential, ''
        self.set_driveline(grouping, differential, driven)
        self.reset()

    def _each(self, name: str, given: float | Sequence[float]) -> list[float]:
        each = [float(given)] if isinstance(given, int | float) else list(given)
        if len(each) == 1:
            each *= self._n
        if len(each) != self._n:
            raise ValueError(f'{name} has {len(each)} entries for {self._n} wheels')
        for value in each:
            if not value > 0:
                raise ValueError(f'{name} must be above 0, got {value}')
        return each

    @property
    def n_wheels(self) -> int:
        """Number of wheels, dimensionless."""
        return self._n

    @property
    def laws(self) -> list[SlipLaw]:
        """The law in force of every wheel."""
        return self._made[self.law]

    @property
    def mode(self) -> Mode:
        """Whether slip is limited or held."""
        return self._mode

    @mode.setter
    def mode(self, mode: Mode) -> None:
        if mode is not self._mode:
            self._mode = mode
            self._changed(f'mode {mode.name.lower()}', OPERATOR_CONTROLLED)

    def reset(self) -> None:
        """Forget the past: no torque sent, no slip seen, no fault, no change."""
        self.outcomes[:] = [WheelOutcome() for _ in range(self._n)]
        for group in self._groups:
            group.reset()
        # Until it is known: soil stiff enough to be careful with.
        self._stiffness: Sequence[float] = [self._FIRST_STIFFNESS * load for load in self._loads]
        # What the shafts should have of what was sent.
        self._expected = [0.0] * self._n
        self._shaft = [0.0] * self._n
        self.changes: list[str] = []
        self._untold = []
        self.change_count = 0

    def _changed(self, what: str, reason: str) -> None:
        self._untold.append(f'{what}: {reason}')
        self.change_count += 1

    @classmethod
    def check_target(cls, slip_target: float) -> None:
        """Refuse what cannot be a slip target.

        Parameters
        ----------
        slip_target : float
            Slip.

        Raises
        ------
        ValueError
            If it is not within 0.01 to 0.9.
        """
        if not cls.MIN_TARGET <= slip_target <= cls.MAX_TARGET:
            raise ValueError(
                f'slip target must be {cls.MIN_TARGET} to {cls.MAX_TARGET}, got {slip_target}'
            )

    def set_target(
        self, slip_target: float, source: TargetSource = TargetSource.PARAMETER
    ) -> None:
        """Change the target; gains stay those of the target that the law was made for.

        Parameters
        ----------
        slip_target : float
            0.01 to 0.9.
        source : TargetSource
            Where it comes from.

        Raises
        ------
        ValueError
            If the target is out of range.
        """
        self.check_target(slip_target)
        self.slip_target = slip_target
        if source is not self.target_source:
            self.target_source = source
            self._changed(f'target from {source.words}', OPERATOR_CONTROLLED)

    def prepare(self, law: str) -> None:
        """Make a law, so that a later `set_law` takes no time.

        Parameters
        ----------
        law : str
            Its name.

        Raises
        ------
        ValueError
            If there is no such law, or it cannot be made with its settings.
        """
        if law not in self._made:
            self._made[law] = [
                make_law(
                    law, wheel, load, slip=self._made_for, lag=self._lag, dt=self._dt,
                    settings=self._settings_of(law, name), laws=self._law_classes,
                )
                for name, wheel, load in zip(
                    self._names, self.vehicle.wheels, self._loads, strict=True
                )
            ]  # fmt: skip

    def _settings_of(self, law: str, wheel: str) -> dict[str, Any]:
        """Settings of a law for a wheel."""
        found = {}
        for key, value in self._settings.get(law, {}).items():
            if isinstance(value, Mapping):
                if wheel not in value:
                    raise ValueError(
                        f"{key} of control law '{law}' has nothing for wheel '{wheel}', only for "
                        + ', '.join(value)
                    )
                value = value[wheel]
            found[key] = value
        return found

    def set_law(self, law: str) -> None:
        """Change the control law; the torque goes on from where it is.

        Parameters
        ----------
        law : str
            Its name.

        Raises
        ------
        ValueError
            As of `prepare`; the law stays what it was.
        """
        self.prepare(law)
        if law != self.law:
            self.law = law
            for group in self._groups:
                group.reference = -1
            self._changed(f'law {law}', OPERATOR_CONTROLLED)

    def set_driveline(self, grouping: Grouping, differential: Differential, driven: str) -> None:
        """Change which wheels are driven and controlled as one; torques go over step by step.

        Parameters
        ----------
        grouping : Grouping
            Which wheels are controlled as one.
        differential : Differential
            Whether the wheels of a group turn alike.
        driven : str
            Which axles are driven.

        Raises
        ------
        ValueError
            If the vehicle has no such axle; everything stays what it was.
        """
        groups = wheel_groups(self.vehicle, grouping, driven_axles(self.vehicle, driven))
        if (grouping, driven) != (self.grouping, self.driven):
            released = [1.0] * self._n
            for old in self._groups:
                for j in old.wheels:
                    released[j] = old.released
            self._groups = [_Group(wheels) for wheels in groups]
            for group in self._groups:
                group.released = min(released[j] for j in group.wheels)
                group.left = []
        elif differential is self.differential:
            return
        self.grouping, self.differential, self.driven = grouping, differential, driven
        said = f'{grouping.name.lower()}, {differential.name.lower()}, {driven} driven'
        self._changed(f'driveline {said}', OPERATOR_CONTROLLED)

    def step(
        self,
        dt: float,
        state: SlipState,
        shaft_torque: Sequence[float] | None,
        request: Sequence[float] | None,
    ) -> list[WheelOutcome]:
        """Find the torque of every wheel from a new slip state.

        Parameters
        ----------
        dt : float
            Time since the last step, s, at least 0.
        state : SlipState
            Slip of all wheels and what belongs to it, SI units.
        shaft_torque : sequence of float or None
            Measured shaft torque of every wheel, N*m, forward positive; NaN, or None for all
            wheels, where it is missing: then what was sent counts, after the lag.
        request : sequence of float or None
            Requested torque of every wheel, N*m, forward positive; None before the first.

        Returns
        -------
        list of WheelOutcome
            `outcomes`; the same objects at every step.
        """
        outcomes, n, requests = self.outcomes, self._n, request
        speed_measured, deviations = state.speed_measured, state.slip_deviation
        if state.slip_stiffness is not None:
            self._stiffness = state.slip_stiffness
        before = [(outcome.exit_reason, outcome.degraded) for outcome in outcomes]
        arriving = 1.0 - math.exp(-dt / self._lag)
        for j, outcome in enumerate(outcomes):
            self._expected[j] += arriving * (outcome.torque - self._expected[j])
            shaft = math.nan if shaft_torque is None else shaft_torque[j]
            outcome.degraded = Degraded.NONE if speed_measured else Degraded.RADAR
            if math.isnan(shaft):
                shaft = self._expected[j]
                outcome.degraded |= Degraded.SHAFT_TORQUE
            self._shaft[j] = shaft

        driven = 0
        for group in self._groups:
            driven += len(group.wheels)
            along = self._along(group, requests)
            reference, shares = self._split(group, along, requests)
            most = self._most(group, reference, shares, requests)
            if group.left is not None and not group.left:
                self._take_over(group, along, reference, shares)
            sent = along * group.sent
            reason = self._read(group, along, reference, shares, state)
            if requests is None:
                reason = ExitReason.REMOTE_COMMAND_TIMEOUT
            elif along == 0.0:
                reason = ExitReason.REMOTE_COMMAND_INVALID
            elif group.faulty:
                reason = ExitReason.FUNCTION_FAULT
            target = self.slip_target
            if not speed_measured:
                doubt = 0.5 * target
                if deviations is not None:
                    doubt = min(doubt, max(deviations[j] for j in group.wheels))
                target = max(target - doubt, self.MIN_TARGET)
            gains: tuple[float, ...] = (0.0, 0.0, 0.0)
            wanted = 0.0
            if reason is ExitReason.ALL_CLEAR:
                law = self._made[self.law][reference]
                if group.reference != reference:
                    law.reset()
                group.reference = reference
                if law.velocity_form:
                    sent = self._delivered(group, along, reference, shares, sent, dt)
                wanted = law.torque(self._reading, target, sent, dt)
                if law.velocity_form and group.short >= self._SHORT_LAGS * self._lag:
                    # More would not be delivered either.
                    wanted = min(wanted, sent)
                gains = law.gains
                group.released = 0.0
                if not math.isfinite(wanted):
                    # Not to be trusted again before all is begun anew.
                    group.faulty = True
                    reason, wanted = ExitReason.FUNCTION_FAULT, 0.0
            if reason is not ExitReason.ALL_CLEAR:
                group.reference = -1
                group.short = 0.0
                if reason in (ExitReason.VEHICLE_SPEED_TOO_LOW, ExitReason.SLIP_NOT_AVAILABLE):
                    wanted = self._release(group, dt, sent, abs(requests[reference]))  # type: ignore[index]
                if reason is ExitReason.SLIP_NOT_AVAILABLE and not speed_measured:
                    # Nothing would show that the wheels spin.
                    wanted = min(wanted, sent)
            limited = min(max(wanted, 0.0), most)
            status = self._status(reason, wanted, limited)
            rate = math.inf
            for j, share in zip(group.wheels, shares, strict=True):
                if share > 0.0:
                    rate = min(rate, self.torque_rate[j] / share)
            change = limited - sent
            if abs(change) > rate * dt:
                limited = min(max(sent + math.copysign(rate * dt, change), 0.0), most)
            group.sent = along * limited
            if group.left is not None:
                group.left_share -= dt / self._RELEASE_TIME
                if group.left_share <= 0.0:
                    group.left = None
            for place, (j, share) in enumerate(zip(group.wheels, shares, strict=True)):
                outcome = outcomes[j]
                torque = limited * share
                if group.left is not None:
                    bound = self.hold_torque[j]
                    if self._mode is Mode.LIMIT or most == 0.0:
                        bound = abs(requests[j]) if requests is not None else 0.0
                    torque = min(torque + group.left[place] * group.left_share, bound)
                outcome.torque = along * torque
                outcome.limit_status = status
                outcome.exit_reason = reason
                outcome.slip_target = target
                outcome.gains = gains
        if driven < n:
            self._idle(dt)
        for j, was in enumerate(before):
            if was != (outcomes[j].exit_reason, outcomes[j].degraded):
                self._tell_changes(before)
                break
        if self._untold or self.changes:
            self.changes, self._untold = self._untold, []
        return outcomes

    def _along(self, group: _Group, requests: Sequence[float] | None) -> float:
        """Direction of a group's request, 1 or -1; 0 where wheels contradict each other."""
        if requests is None:
            return 1.0
        forward = backward = False
        for j in group.wheels:
            request = requests[j]
            forward = forward or request > 0.0
            backward = backward or request < 0.0
        if forward and backward:
            return 0.0
        return -1.0 if backward else 1.0

    def _split(
        self, group: _Group, along: float, requests: Sequence[float] | None
    ) -> tuple[int, Sequence[float]]:
        """Reference of a group, and the torque of each wheel per torque of the reference."""
        wheels = group.wheels
        if len(wheels) == 1:
            return wheels[0], (1.0,)
        largest = 0.0
        if requests is not None and along != 0.0:
            largest = max(abs(requests[j]) for j in wheels)
        if requests is None or largest == 0.0:
            return max(wheels, key=self._loads.__getitem__), [1.0] * len(wheels)
        # Of those that are asked for much, the one that was it, or the one that carries most.
        asked = [j for j in wheels if abs(requests[j]) >= 0.5 * largest]
        reference = group.reference
        if reference not in asked:
            reference = max(asked, key=self._loads.__getitem__)
        return reference, [requests[j] / requests[reference] for j in wheels]

    def _most(
        self,
        group: _Group,
        reference: int,
        shares: Sequence[float],
        requests: Sequence[float] | None,
    ) -> float:
        """Most torque of the reference."""
        if requests is None:
            return 0.0
        most = abs(requests[reference])
        if self._mode is Mode.HOLD and most > 0.0:
            most = math.inf
            for j, share in zip(group.wheels, shares, strict=True):
                if share > 0.0:
                    most = min(most, self.hold_torque[j] / share)
        return most

    def _take_over(
        self, group: _Group, along: float, reference: int, shares: Sequence[float]
    ) -> None:
        """Go on from the torques that the wheels had in other groups."""
        torques = [along * self.outcomes[j].torque for j in group.wheels]
        # What the most careful of them had is sent to all; the rest goes step by step.
        least = min(
            (max(t, 0.0) / share for t, share in zip(torques, shares, strict=True) if share > 0.0),
            default=0.0,
        )
        group.sent = along * least
        group.left = [
            max(t - least * share, 0.0) for t, share in zip(torques, shares, strict=True)
        ]
        group.left_share = 1.0
        if not any(group.left):
            group.left = None

    def _read(
        self,
        group: _Group,
        along: float,
        reference: int,
        shares: Sequence[float],
        state: SlipState,
    ) -> ExitReason:
        """Put together what the law of a group is told; the reason why that cannot be done.

        All of it is told as if the reference alone were driven. A wheel with another radius or
        share counts by what its rim's force would be at the reference.
        """
        reading = self._reading
        slips, valid, rim_speeds, speed = state.slip, state.valid, state.rim_speed, state.speed
        stiffnesses, gross_tractions = self._stiffness, state.gross_traction
        radius = self._radii[reference]
        common = self.differential is Differential.LOCKED and len(group.wheels) > 1
        slow = True
        found = 0
        # Of the wheels told of: rim speed, stiffness, thrust, and how many references they are.
        rims = stiffness = thrust = weight = 0.0
        worst = -math.inf
        shaft = shaft_weight = 0.0
        for j, share in zip(group.wheels, shares, strict=True):
            if share <= 0.0:
                continue
            rim = rim_speeds[j]
            per_reference = share * radius / self._radii[j]
            shaft += along * self._shaft[j] * radius / self._radii[j]
            shaft_weight += per_reference
            fastest = speed if abs(speed) > abs(rim) else rim
            if abs(fastest) < self.min_speed:
                continue
            slow = False
            if not valid[j]:
                self.outcomes[j].degraded |= Degraded.TACHOMETER
                continue
            found += 1
            own = along * self._shaft[j] - self._friction[j] * abs(rim)
            own = own / self._radii[j] if gross_tractions is None else along * gross_tractions[j]
            if common:
                rims += rim
                stiffness += stiffnesses[j]
                thrust += own
                weight += per_reference
                continue
            slip = along * slips[j] if fastest >= 0.0 else -along * slips[j]
            if slip > worst:
                worst, rims, stiffness, thrust = slip, rim, stiffnesses[j], own
                weight = per_reference
        reading.shaft_torque = shaft / shaft_weight if shaft_weight else 0.0
        if not found:
            if slow:
                return ExitReason.VEHICLE_SPEED_TOO_LOW
            return ExitReason.SLIP_NOT_AVAILABLE
        if common:
            rims /= found
            fastest = speed if abs(speed) > abs(rims) else rims
            worst = float(slip_of(speed, rims))
            worst *= along if fastest >= 0.0 else -along
        reading.slip = worst
        reading.rim_speed = rims
        reading.speed = speed
        reading.stiffness = stiffness / weight
        reading.gross_traction = thrust / weight
        return ExitReason.ALL_CLEAR

    def _delivered(
        self,
        group: _Group,
        along: float,
        reference: int,
        shares: Sequence[float],
        sent: float,
        dt: float,
    ) -> float:
        """What counts as sent: less, where the shafts have had less for some time."""
        radius = self._radii[reference]
        expected = weight = 0.0
        for j, share in zip(group.wheels, shares, strict=True):
            if share > 0.0:
                expected += along * self._expected[j] * radius / self._radii[j]
                weight += share * radius / self._radii[j]
        expected /= weight
        allowed = self._SHORT_OF_SENT * expected
        allowed += self._SHORT_OF_LOAD * self._loads[reference] * radius
        missing = expected - self._reading.shaft_torque - allowed
        lasting = self._SHORT_LAGS * self._lag
        if missing <= 0.0:
            group.short = max(group.short - dt, 0.0)
            return sent
        group.short = min(group.short + dt, lasting)
        if group.short < lasting:
            return sent
        return sent - (1.0 - math.exp(-dt / self._lag)) * missing

    def _release(self, group: _Group, dt: float, sent: float, request: float) -> float:
        """Torque of a group that is not under control: the request, at first step by step."""
        group.released = min(1.0, group.released + dt / self._RELEASE_TIME)
        if request <= sent:
            return request
        return sent + group.released * (request - sent)

    def _idle(self, dt: float) -> None:
        """Take the torque off wheels that are not driven."""
        driven = {j for group in self._groups for j in group.wheels}
        for j, outcome in enumerate(self.outcomes):
            if j not in driven:
                fall = min(abs(outcome.torque), self.torque_rate[j] * dt) if dt > 0.0 else 0.0
                outcome.torque -= math.copysign(fall, outcome.torque)
                outcome.limit_status = LimitStatus.NOT_AVAILABLE
                outcome.exit_reason = ExitReason.NOT_DRIVEN
                outcome.degraded = Degraded.NONE
                outcome.slip_target = self.slip_target
                outcome.gains = (0.0, 0.0, 0.0)

    def _status(self, reason: ExitReason, wanted: float, sent: float) -> LimitStatus:
        if reason is ExitReason.FUNCTION_FAULT:
            return LimitStatus.NON_RECOVERABLE_FAULT
        if reason is not ExitReason.ALL_CLEAR:
            return LimitStatus.NOT_AVAILABLE
        if wanted > sent:
            return LimitStatus.OPERATOR_LIMITED
        if wanted < sent:
            return LimitStatus.LIMITED_LOW
        return LimitStatus.LIMITED_HIGH

    def _tell_changes(self, before: Sequence[tuple[ExitReason, Degraded]]) -> None:
        """Say which wheels came under control, left it, or do without something else."""
        wheels: dict[str, list[str]] = {}
        for name, outcome, (reason, degraded) in zip(
            self._names, self.outcomes, before, strict=True
        ):
            if outcome.exit_reason is not reason:
                wheels.setdefault(outcome.exit_reason.words, []).append(name)
            if outcome.degraded != degraded:
                wheels.setdefault(outcome.degraded.words, []).append(name)
        for reason_words, names in wheels.items():
            self._changed(' '.join(names), reason_words)
