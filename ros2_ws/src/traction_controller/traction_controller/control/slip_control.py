"""Slip control: limits or holds the slip of wheels through their drive torque.

A control law (`traction_controller.control.laws`) computes the torque of every wheel, or of every
group of wheels with one drive torque (`traction_controller.control.wheel_group`). Every law starts
from the torque sent in the last step, after all limits. So changes of gains, modes, laws, groups
and targets cause no jump of torque, and limits cause no windup.

Anti-windup: if shaft torque stays below 90 % of the command for three lags, velocity-form laws
continue from the measured torque.

A wheel leaves control when it is too slow or its slip is not valid. Its torque then goes back to
its request within half a second. Where neither slip nor speed is known, its torque may only fall.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum
from typing import Any

from traction_controller.control.driveline import (
    Differential,
    Grouping,
    driven_axles,
    wheel_groups,
)
from traction_controller.control.exit_reason import OPERATOR_CONTROLLED, ExitReason, LimitStatus
from traction_controller.control.laws.law import SlipLaw
from traction_controller.control.laws.registry import LAWS, make_law
from traction_controller.control.slip_state import SlipState
from traction_controller.control.wheel_group import DrivenWheel, WheelGroup
from traction_controller.control.wheel_outcome import NO_GAINS, Degraded, WheelOutcome
from traction_model.slip import MIN_SPEED
from traction_model.vehicle.vehicle import Vehicle
from traction_node.positive import check_positive


class Mode(IntEnum):
    """Mode of slip control, numbered as in the ControllerState message."""

    LIMIT = 0
    HOLD = 1


class TargetSource(IntEnum):
    """Source of the slip target, numbered as in the ControllerState message."""

    PARAMETER = 0
    TOPIC = 1
    SET_POINT = 2

    @property
    def words(self) -> str:
        """The source as a text."""
        return self.name.lower().replace('_', ' ')


class SlipControl:
    """Limits or holds the slip of the wheels of a vehicle.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle, SI units.
    slip_target : float
        Slip to limit or hold, 0.01 to 0.9.
    mode : Mode
        LIMIT only reduces the magnitude of the requested torque; HOLD regulates slip to
        the target with torques from 0 to `hold_torque` in the direction of the request; a
        request of 0 is no torque in either mode.
    lag : float
        Time constant from commanded to shaft torque, s, above 0.
    dt : float
        Nominal sampling period, s, above 0.
    law : str
        Name of the control law, one of `laws`.
    settings : mapping of str, optional
        Settings of laws: for each law its arguments by name, in their units. A mapping in place
        of an argument has one value per wheel, by the wheel's name.
    laws : mapping of str to class
        Classes of the laws to choose from, by name; an evaluation adds its baselines.
    hold_torque : float or sequence of float
        Largest torque in HOLD, one for all wheels or one each, N·m, above 0; not above the limit
        of the gate.
    torque_rate : float or sequence of float
        Limit of the rate of torque, one for all wheels or one each, N·m/s, above 0; not above
        that of the gate. A falling request is followed without a limit.
    min_speed : float
        Speed below which slip is not controlled, m/s, above 0.
    grouping : Grouping
        Wheels that form a control group.
    differential : Differential
        Differential between the wheels of a group.
    driven : str
        Driven axles, one of `traction_controller.control.driveline.DRIVEN_AXLES`. The torque of
        other wheels is 0.

    Attributes
    ----------
    outcomes : list of WheelOutcome
        Result of the last step for each wheel.
    slip_target : float
        Target in force, dimensionless.
    target_source : TargetSource
        Source of the target.
    law : str
        Name of the law in force.
    grouping : Grouping
        Wheels that form a control group.
    differential : Differential
        Differential between the wheels of a group.
    driven : str
        Driven axles.
    changes : list of str
        Changes since the step before the last one, with reasons in the words of ISO 11783-7:
        mode, law, driveline, source of the target, wheels that enter or leave control, missing
        measurements.
    change_count : int
        Number of changes since the last reset, dimensionless.
    """

    MIN_TARGET = 0.01
    MAX_TARGET = 0.9

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
        check_positive(min_speed=min_speed, lag=lag, dt=dt)
        self.min_speed = min_speed
        self._lag, self._dt = lag, dt
        self._loads = [float(load) for load in vehicle.static_loads()]
        self._settings = dict(settings or {})
        self._mode = mode
        self._law_classes = dict(laws)
        self._groups: list[WheelGroup] = []
        self._made: dict[str, list[SlipLaw]] = {}
        self.target_source = TargetSource.PARAMETER
        self.set_target(slip_target)
        self._made_for = slip_target
        self.prepare(law)
        self.law = law
        self._wheels = [
            DrivenWheel(
                index,
                wheel.radius,
                self._loads[index],
                wheel.viscous_friction / wheel.radius,
                self.hold_torque[index],
                self.torque_rate[index],
                self._made[law][index],
            )
            for index, wheel in enumerate(vehicle.wheels)
        ]
        self.outcomes: list[WheelOutcome] = []
        self.changes: list[str] = []
        self._new_changes: list[str] = []
        self.change_count = 0
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
        """Law in force of every wheel."""
        return self._made[self.law]

    @property
    def mode(self) -> Mode:
        """Mode in force."""
        return self._mode

    @mode.setter
    def mode(self, mode: Mode) -> None:
        if mode is not self._mode:
            self._mode = mode
            self._changed(f'mode {mode.name.lower()}', OPERATOR_CONTROLLED)

    def reset(self) -> None:
        """Reset to the initial state: no torque sent, no fault, no change."""
        for wheel in self._wheels:
            wheel.reset()
        self.outcomes[:] = [wheel.outcome for wheel in self._wheels]
        for group in self._groups:
            group.reset()
        self.changes = []
        self._new_changes = []
        self.change_count = 0

    def _changed(self, what: str, reason: str) -> None:
        self._new_changes.append(f'{what}: {reason}')
        self.change_count += 1

    @classmethod
    def check_target(cls, slip_target: float) -> None:
        """Check a slip target.

        Parameters
        ----------
        slip_target : float
            Slip.

        Raises
        ------
        ValueError
            If it is outside 0.01 to 0.9.
        """
        if not cls.MIN_TARGET <= slip_target <= cls.MAX_TARGET:
            raise ValueError(
                f'slip target must be {cls.MIN_TARGET} to {cls.MAX_TARGET}, got {slip_target}'
            )

    def set_target(
        self, slip_target: float, source: TargetSource = TargetSource.PARAMETER
    ) -> None:
        """Set the target; the gains of the law are not changed.

        Parameters
        ----------
        slip_target : float
            0.01 to 0.9.
        source : TargetSource
            Source of the target.

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
        """Construct a law in advance, so that `set_law` is fast.

        Parameters
        ----------
        law : str
            Its name.

        Raises
        ------
        ValueError
            If there is no such law, or its settings are invalid.
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
        """Set the control law; the torque continues without a jump.

        Parameters
        ----------
        law : str
            Its name.

        Raises
        ------
        ValueError
            As for `prepare`; the law is then unchanged.
        """
        self.prepare(law)
        if law != self.law:
            self.law = law
            for wheel, made in zip(self._wheels, self._made[law], strict=True):
                wheel.law = made
            for group in self._groups:
                group.restart_law()
            self._changed(f'law {law}', OPERATOR_CONTROLLED)

    def set_driveline(self, grouping: Grouping, differential: Differential, driven: str) -> None:
        """Set driven axles and groups; torques change gradually.

        Parameters
        ----------
        grouping : Grouping
            Wheels that form a control group.
        differential : Differential
            Differential between the wheels of a group.
        driven : str
            Driven axles.

        Raises
        ------
        ValueError
            If the vehicle has no such axle. The driveline is then unchanged.
        """
        groups = wheel_groups(self.vehicle, grouping, driven_axles(self.vehicle, driven))
        if (grouping, driven) != (self.grouping, self.driven):
            released = {wheel: old.released for old in self._groups for wheel in old.wheels}
            self._groups = []
            for places in groups:
                wheels = [self._wheels[j] for j in places]
                group = WheelGroup(
                    wheels, self._lag, self.min_speed, locked=differential is Differential.LOCKED
                )
                group.join(min(released.get(wheel, 1.0) for wheel in wheels))
                self._groups.append(group)
        elif differential is self.differential:
            return
        else:
            for group in self._groups:
                group.locked = differential is Differential.LOCKED
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
        """Compute the torque of every wheel for a new slip state.

        Parameters
        ----------
        dt : float
            Time since the last step, s, at least 0.
        state : SlipState
            Slip of all wheels and what belongs to it, SI units.
        shaft_torque : sequence of float or None
            Measured shaft torque of every wheel, N·m, forward positive; NaN, or None for all
            wheels, where it is missing: then what was sent counts, after the lag.
        request : sequence of float or None
            Requested torque of every wheel, N·m, forward positive; None before the first.

        Returns
        -------
        list of WheelOutcome
            `outcomes`; the same objects at every step.
        """
        outcomes = self.outcomes
        before = [(outcome.exit_reason, outcome.degraded) for outcome in outcomes]
        arriving = 1.0 - math.exp(-dt / self._lag)
        speed_measured, stiffness = state.speed_measured, state.slip_stiffness
        for j, wheel in enumerate(self._wheels):
            shaft = math.nan if shaft_torque is None else shaft_torque[j]
            wheel.measure(shaft, speed_measured, arriving)
            if stiffness is not None:
                wheel.stiffness = stiffness[j]
        hold = self._mode is Mode.HOLD
        driven = 0
        for group in self._groups:
            driven += len(group.wheels)
            group.step(dt, state, request, self._safe_target(group, state), hold)
        if driven < self._n:
            self._idle(dt)
        for outcome, was in zip(outcomes, before, strict=True):
            if was != (outcome.exit_reason, outcome.degraded):
                self._record_changes(before)
                break
        if self._new_changes or self.changes:
            self.changes, self._new_changes = self._new_changes, []
        return outcomes

    def _safe_target(self, group: WheelGroup, state: SlipState) -> float:
        """Target of a group, reduced by the deviation of slip while speed is not measured."""
        target = self.slip_target
        if state.speed_measured:
            return target
        doubt = 0.5 * target
        deviations = state.slip_deviation
        if deviations is not None:
            doubt = min(doubt, max(deviations[wheel.index] for wheel in group.wheels))
        return max(target - doubt, self.MIN_TARGET)

    def _idle(self, dt: float) -> None:
        """Set the torque of undriven wheels to 0."""
        driven = {wheel for group in self._groups for wheel in group.wheels}
        for wheel in self._wheels:
            if wheel not in driven:
                outcome = wheel.outcome
                fall = min(abs(outcome.torque), wheel.torque_rate * dt) if dt > 0.0 else 0.0
                outcome.torque -= math.copysign(fall, outcome.torque)
                outcome.limit_status = LimitStatus.NOT_AVAILABLE
                outcome.exit_reason = ExitReason.NOT_DRIVEN
                outcome.degraded = Degraded.NONE
                outcome.slip_target = self.slip_target
                outcome.gains = NO_GAINS

    def _record_changes(self, before: Sequence[tuple[ExitReason, Degraded]]) -> None:
        """Record wheels that enter or leave control, or whose missing input changed."""
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
