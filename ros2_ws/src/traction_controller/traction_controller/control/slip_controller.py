"""Slip controller: slip control with its inputs, set-point and parameters.

`SlipController` is the core of the node `slip_controller`. The replay, the closed loop of the
evaluation and the node use the same class.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from types import SimpleNamespace
from typing import Any

from traction_controller.control.driveline import Differential, Grouping, driven_axles
from traction_controller.control.laws.law import SlipLaw
from traction_controller.control.laws.registry import LAWS
from traction_controller.control.set_point import SetPoint
from traction_controller.control.slip_control import Mode, SlipControl, TargetSource
from traction_controller.control.slip_state import SlipState
from traction_controller.control.wheel_outcome import WheelOutcome
from traction_controller.synthesis.gain_schedule import ControlWeights
from traction_controller.synthesis.gain_table import find_gain_table, read_gain_table
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import load_vehicle

# Stamps are whole nanoseconds: rounded to 9 decimals, their differences are exact.
_DECIMALS = 9


class SlipController:
    """Slip control with its set-point, the torque request and the shaft torques.

    Inputs have times and come in any order; each slip estimate returns torques. Times are those of
    the messages' stamps, from any origin. The timeout of the request uses a second clock, which is
    never set, so that it also works when the first one stops or jumps.

    Parameters
    ----------
    control : SlipControl
        Computes the torques.
    set_point : SetPoint or None
        Computes the slip target; None: a given target is used.
    period : float
        Nominal time between two slip estimates, s, above 0.
    request_timeout : float
        Time without a request after which the request is none, s, above 0.
    torque_timeout : float
        Age relative to the slip estimate from which shaft torque is missing, s, above 0.

    Attributes
    ----------
    control : SlipControl
        Computes the torques; has the state of every wheel, mode, law and target.
    set_point : SetPoint or None
        Computes the slip target.
    request : sequence of float or None
        Request used in the last step, N·m, forward positive; None: missing or too old.
    request_timeout, torque_timeout : float
        As given, s.
    lpv_refused : str
        Reason why the law lpv cannot be used; empty if it can, or if there is no gain table.
    """

    SET_POINT_PERIOD = 1.0
    """Shortest time between two updates of the set-point, s; soil changes more slowly."""

    # Limit of a time step after a gap, in periods.
    _MAX_PERIODS = 5.0

    def __init__(
        self,
        control: SlipControl,
        set_point: SetPoint | None = None,
        *,
        period: float = 0.01,
        request_timeout: float = 0.5,
        torque_timeout: float = 0.1,
    ) -> None:
        self.control = control
        self.set_point = set_point
        self.request_timeout, self.torque_timeout = request_timeout, torque_timeout
        self.lpv_refused = ''
        self._period = period
        self._given = control.slip_target, control.target_source
        self.reset()

    @classmethod
    def from_parameters(
        cls,
        p: SimpleNamespace,
        laws: Mapping[str, Callable[..., SlipLaw]] = LAWS,
    ) -> 'SlipController':
        """Construct a controller from the parameters of the node `slip_controller`.

        Parameters
        ----------
        p : SimpleNamespace
            Value of every parameter by its name, in its unit.
        laws : mapping of str to class
            Classes of the laws to choose from, by name; an evaluation adds its baselines.

        Returns
        -------
        SlipController
            Controller in its initial state.

        Raises
        ------
        ValueError
            If a vehicle, soil or gain table cannot be loaded, or they contradict each other.
        """
        vehicle = load_vehicle(p.vehicle)
        period = 1.0 / p.rate
        pi = {'proportional': p.pi_proportional, 'integral': p.pi_integral}
        chosen: dict[str, Mapping[str, Any]] = {
            'pi': {
                'response_time': p.pi_response_time,
                **{name: value for name, value in pi.items() if value},
            },
            'lqi': {
                'weights': ControlWeights(p.weight_slip, p.weight_integral_time, p.weight_torque)
            },
        }
        lpv_refused = ''
        table = find_gain_table(p.gain_table, p.vehicle) if 'lpv' in laws else None
        if table is not None:
            try:
                chosen['lpv'] = {'gain_table': read_gain_table(table, vehicle, period)}
            except ValueError as error:
                if p.law == 'lpv' or p.gain_table:
                    raise
                lpv_refused = str(error)
        control = SlipControl(
            vehicle,
            p.slip_target,
            Mode[p.mode.upper()],
            lag=p.torque_time_constant,
            dt=period,
            law=p.law,
            settings=chosen,
            laws=laws,
            hold_torque=p.hold_torque,
            torque_rate=p.torque_rate,
            min_speed=p.min_speed,
            grouping=Grouping[p.grouping.upper()],
            differential=Differential[p.differential.upper()],
            driven=p.driven_axles,
        )
        # A change of law must be fast while the vehicle drives.
        for law in laws:
            if law != 'lpv' or law in chosen:
                control.prepare(law)
        set_point = None
        if p.set_point != 'none':
            set_point = SetPoint(
                vehicle,
                load_soil(p.soil),
                p.set_point_weight,
                p.set_point_low,
                p.set_point_high,
                p.set_point_rate,
                p.set_point_time_constant,
            )
        made = cls(
            control,
            set_point,
            period=period,
            request_timeout=p.request_timeout,
            torque_timeout=p.torque_timeout,
        )
        made.lpv_refused = lpv_refused
        return made

    @staticmethod
    def check_parameters(p: SimpleNamespace) -> None:
        """Check parameters without construction of a controller.

        Parameters
        ----------
        p : SimpleNamespace
            Value of every parameter by its name, in its unit.

        Raises
        ------
        ValueError
            If a file cannot be loaded, or parameters contradict each other.
        """
        vehicle = load_vehicle(p.vehicle)
        wheels = len(vehicle.wheels)
        for name in ('hold_torque', 'torque_rate'):
            entries = len(getattr(p, name))
            if entries not in (1, wheels):
                raise ValueError(f'{name} has {entries} entries for {wheels} wheels')
        driven_axles(vehicle, p.driven_axles)
        if find_gain_table(p.gain_table, p.vehicle) is None and p.law == 'lpv':
            raise ValueError(f'law lpv needs a gain_table: none is shipped for {p.vehicle}')
        if p.set_point != 'none':
            load_soil(p.soil)
            if p.set_point_low > p.set_point_high:
                raise ValueError(
                    f'set_point_low {p.set_point_low} is above set_point_high {p.set_point_high}'
                )

    def set_parameters(self, p: SimpleNamespace, names: Collection[str]) -> None:
        """Apply parameters that can change at run time; torques continue without a jump.

        Parameters
        ----------
        p : SimpleNamespace
            Value of every parameter by its name, in its unit.
        names : collection of str
            Parameters that were set. A target by topic stays in force until `slip_target` is set.

        Raises
        ------
        ValueError
            If law, axles or target are invalid.
        """
        control = self.control
        control.mode = Mode[p.mode.upper()]
        control.set_law(p.law)
        control.set_driveline(
            Grouping[p.grouping.upper()], Differential[p.differential.upper()], p.driven_axles
        )
        if 'slip_target' in names:
            self._give_target(p.slip_target, TargetSource.PARAMETER)
        if self.set_point is not None:
            self.set_point.set_weight(p.set_point_weight)
        self.request_timeout, self.torque_timeout = p.request_timeout, p.torque_timeout

    def reset(self) -> None:
        """Reset to the initial state: no request, no torque; the newest given target is kept."""
        self.control.set_target(*self._given)
        self.control.reset()
        if self.set_point is not None:
            self.set_point.reset()
        self.request: Sequence[float] | None = None
        self._newest_request: Sequence[float] | None = None
        self._request_time = 0.0
        self._shaft_torque: Sequence[float] | None = None
        self._shaft_time = 0.0
        self._terrain_time: float | None = None
        self._slip_time: float | None = None

    def wheel_states(self, t: float, torque: Sequence[float] | None) -> None:
        """Set measured shaft torques.

        Parameters
        ----------
        t : float
            Time of the reading, s.
        torque : sequence of float or None
            Shaft torque of every wheel, N·m, forward positive; None: not measured.
        """
        self._shaft_torque, self._shaft_time = torque, t

    def torque_request(self, steady_time: float, torque: Sequence[float]) -> None:
        """Set the torque request.

        Parameters
        ----------
        steady_time : float
            Time of the clock that is never set, s.
        torque : sequence of float
            Requested torque of every wheel, N·m, forward positive.
        """
        self._newest_request, self._request_time = torque, steady_time

    def slip_target(self, target: float) -> None:
        """Set the target by topic; with a set-point it is stored for later.

        Parameters
        ----------
        target : float
            Slip, 0.01 to 0.9.

        Raises
        ------
        ValueError
            If the target is out of range.
        """
        self._give_target(target, TargetSource.TOPIC)

    def _give_target(self, target: float, source: TargetSource) -> None:
        SlipControl.check_target(target)
        self._given = target, source
        if self.control.target_source is not TargetSource.SET_POINT:
            self.control.set_target(target, source)

    def terrain_estimate(
        self,
        t: float,
        max_shear_stress: Sequence[float],
        valid: Sequence[bool],
        shear_deformation_modulus: Sequence[float] | None = None,
    ) -> None:
        """Update the set-point with a terrain estimate, once per `SET_POINT_PERIOD`.

        Parameters
        ----------
        t : float
            Time of the estimate, s.
        max_shear_stress : sequence of float
            Maximum shear stress of every wheel, Pa.
        valid : sequence of bool
            True for valid values.
        shear_deformation_modulus : sequence of float or None
            K of every wheel, m; NaN or None: unknown.
        """
        if self.set_point is None:
            return
        dt = 0.0
        if self._terrain_time is not None:
            dt = round(t - self._terrain_time, _DECIMALS)
            if 0.0 <= dt < self.SET_POINT_PERIOD:
                return
        self._terrain_time = t
        # At most a few periods after a gap, and none if the clock was set back.
        dt = min(max(dt, 0.0), self._MAX_PERIODS * self.SET_POINT_PERIOD)
        target = self.set_point.update(
            dt, self.control.slip_target, max_shear_stress, valid, shear_deformation_modulus
        )
        if target is not None:
            self.control.set_target(target, TargetSource.SET_POINT)

    def slip_estimate(self, t: float, steady_time: float, state: SlipState) -> list[WheelOutcome]:
        """Compute the torque of every wheel for a new slip estimate.

        Parameters
        ----------
        t : float
            Time of the estimate, s.
        steady_time : float
            Time of the clock that is never set, s.
        state : SlipState
            Slip estimate, SI units.

        Returns
        -------
        list of WheelOutcome
            Result for each wheel; the same objects at every step.
        """
        dt = 0.0 if self._slip_time is None else round(t - self._slip_time, _DECIMALS)
        self._slip_time = t
        # Integral action over at most a few periods after a gap, and none if the clock was set
        # back.
        dt = min(max(dt, 0.0), self._MAX_PERIODS * self._period)
        silent = steady_time - self._request_time > self.request_timeout
        self.request = None if silent else self._newest_request
        shaft = self._shaft_torque
        if shaft is not None:
            age = round(abs(t - self._shaft_time), _DECIMALS)
            shaft = None if age > self.torque_timeout else shaft
        return self.control.step(dt, state, shaft, self.request)
