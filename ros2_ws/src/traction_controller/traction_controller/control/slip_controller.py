"""Slip controller: slip control and all it is told, from the node's parameters to its torques.

`SlipController` is what the node `slip_controller` does without its messages. The replay, the
closed loop and the node run this same object.
"""

from collections.abc import Callable, Mapping, Sequence
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

# Stamps are whole nanoseconds: to 9 decimals the time between two of them is exact.
_DECIMALS = 9


class SlipController:
    """Slip control with its set-point, the torque request and the shaft torques.

    Inputs come with their time and in any order; every slip estimate is answered with torques.
    Times of one clock, that of the messages' stamps, are counted from any one instant. The request
    is watched by another clock, one that is never set: whoever asks for torque must be heard.

    Parameters
    ----------
    control : SlipControl
        Finds the torques.
    set_point : SetPoint or None
        Seeks the slip target; None: the target is given.
    period : float
        Nominal time between two slip estimates, s, above 0.
    request_timeout : float
        Silence after which a request counts as none, s, above 0.
    torque_timeout : float
        Age against the slip estimate from which shaft torque is missing, s, above 0.

    Attributes
    ----------
    control : SlipControl
        Finds the torques; has the state of every wheel, mode, law and target.
    set_point : SetPoint or None
        Seeks the slip target.
    request : sequence of float or None
        Request acted on in the last step, N·m, forward positive; None: there was none in time.
    request_timeout, torque_timeout : float
        As given, s.
    lpv_refused : str
        Why the law lpv cannot be chosen; empty where it can, or has no gain table.
    """

    SET_POINT_PERIOD = 1.0
    """Least time between two updates of the set-point, s: soil changes no faster."""

    # After a gap, periods that count at once.
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
        settings: Mapping[str, Mapping[str, Any]] | None = None,
    ) -> 'SlipController':
        """Build a controller from the parameters of the node `slip_controller`.

        Parameters
        ----------
        p : SimpleNamespace
            Value of every parameter by its name, in its unit.
        laws : mapping of str to class
            Classes of the laws to choose from, by name; an evaluation adds its baselines.
        settings : mapping of str, optional
            Settings of those laws that have no parameters: by name of the law, the arguments of
            its class by name.

        Returns
        -------
        SlipController
            Its memory empty.

        Raises
        ------
        ValueError
            If a vehicle, soil or gain table cannot be loaded, or does not fit the others.
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
        chosen.update(settings or {})
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
        # Changing to another law must not take time while the vehicle drives.
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
        """Refuse parameters that do not fit one another, before anything is built.

        Parameters
        ----------
        p : SimpleNamespace
            Value of every parameter by its name, in its unit.

        Raises
        ------
        ValueError
            Naming what cannot be loaded or does not fit.
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

    def set_parameters(self, p: SimpleNamespace, names: Sequence[str]) -> None:
        """Change what may change at run time; the torques go on from where they are.

        Parameters
        ----------
        p : SimpleNamespace
            Value of every parameter by its name, in its unit.
        names : sequence of str
            Parameters that were set: a target that came by topic stands until its parameter is.

        Raises
        ------
        ValueError
            If the law, axles or target cannot be chosen.
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
        """Begin anew: no request, no torque, no slip; the target is the one given last."""
        self.control.set_target(*self._given)
        self.control.reset()
        if self.set_point is not None:
            self.set_point.reset()
        self.request: Sequence[float] | None = None
        self._asked: Sequence[float] | None = None
        self._asked_at = 0.0
        self._shaft_torque: Sequence[float] | None = None
        self._shaft_time = 0.0
        self._terrain_time: float | None = None
        self._slip_time: float | None = None

    def wheel_states(self, t: float, torque: Sequence[float] | None) -> None:
        """Take in measured shaft torques.

        Parameters
        ----------
        t : float
            Time of the reading, s.
        torque : sequence of float or None
            Shaft torque of every wheel, N·m, forward positive; None: not measured.
        """
        self._shaft_torque, self._shaft_time = torque, t

    def torque_request(self, steady_time: float, torque: Sequence[float]) -> None:
        """Take in a torque request.

        Parameters
        ----------
        steady_time : float
            Time of the clock that is never set, s.
        torque : sequence of float
            Requested torque of every wheel, N·m, forward positive.
        """
        self._asked, self._asked_at = torque, steady_time

    def slip_target(self, target: float) -> None:
        """Take in a target by topic; while one is sought, it is kept for later.

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
        """Take in a terrain estimate: it moves the set-point, once a `SET_POINT_PERIOD`.

        Parameters
        ----------
        t : float
            Time of the estimate, s.
        max_shear_stress : sequence of float
            Of every wheel, Pa.
        valid : sequence of bool
            Whether each means anything.
        shear_deformation_modulus : sequence of float or None
            K of every wheel, m; NaN or None: not known.
        """
        if self.set_point is None:
            return
        dt = 0.0
        if self._terrain_time is not None:
            dt = round(t - self._terrain_time, _DECIMALS)
            if 0.0 <= dt < self.SET_POINT_PERIOD:
                return
        self._terrain_time = t
        # After a gap no more than a few periods at once, and none where the clock was set back.
        dt = min(max(dt, 0.0), self._MAX_PERIODS * self.SET_POINT_PERIOD)
        target = self.set_point.update(
            dt, self.control.slip_target, max_shear_stress, valid, shear_deformation_modulus
        )
        if target is not None:
            self.control.set_target(target, TargetSource.SET_POINT)

    def slip_estimate(self, t: float, steady_time: float, state: SlipState) -> list[WheelOutcome]:
        """Find the torque of every wheel for a new slip estimate.

        Parameters
        ----------
        t : float
            Time of the estimate, s.
        steady_time : float
            Time of the clock that is never set, s.
        state : SlipState
            The estimate, SI units.

        Returns
        -------
        list of WheelOutcome
            What was done with each wheel; the same objects at every step.
        """
        dt = 0.0 if self._slip_time is None else round(t - self._slip_time, _DECIMALS)
        self._slip_time = t
        # After a gap no more than a few periods of integral action at once, and none where the
        # clock was set back.
        dt = min(max(dt, 0.0), self._MAX_PERIODS * self._period)
        silent = steady_time - self._asked_at > self.request_timeout
        self.request = None if silent else self._asked
        shaft = self._shaft_torque
        if shaft is not None:
            age = round(abs(t - self._shaft_time), _DECIMALS)
            shaft = None if age > self.torque_timeout else shaft
        return self.control.step(dt, state, shaft, self.request)
