"""LPV models of a vehicle: common part of the models with wheel speeds and with slips as states.

An LPV model has the equations of motion of the vehicle
(`traction_model.simulation.vehicle_dynamics`) with given sinkage, as a linear model whose matrices
depend only on a scheduling vector rho:

    x' = A(rho)*x + B(rho)*u + B_uc(rho)*u_uc,   y = C*x + D*u

It is exact: with rho, x and u_uc at a state of motion (`LpvModel.at`), x' equals that of the
nonlinear equations, the paper's (21). There is one class for each kind of state:

- `traction_model.lpv.speed_model.SpeedLpvModel`: wheel speeds, as in the paper's (29) and (31);
- `traction_model.lpv.slip_model.SlipLpvModel`: slips;
- `traction_model.lpv.inverse_slip_model.InverseSlipLpvModel`: 1/slip.

Derivation, units and the printed equations of the paper: ``docs/theory.md``, "The paper's state
space" and "Slip as a state". Source: Agriculture 2024, 14(3), 499 (*the paper*), equations (16) to
(31).
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_model.contact.contact import (
    EVERYWHERE,
    FREE,
    UNTOUCHED,
    Form,
    check_form,
    forces_at,
)
from traction_model.lpv.controllability import controllability_rank
from traction_model.lpv.matrices import Matrices
from traction_model.lpv.scheduling import Schedule, SchedulingParameter
from traction_model.soil.soil import Soil
from traction_model.vehicle.coupling import Coupling, constraint_matrix
from traction_model.vehicle.vehicle import GRAVITY, Vehicle
from traction_node.closest import closest

if TYPE_CHECKING:
    import control

Array = NDArray[np.float64]

MIN_SINKAGE = 1e-5
"""Smallest sinkage of a wheel in contact, m; it bounds 1/A."""

LARGEST_LOAD = 20.0
"""Largest load of one wheel in the ranges, over the weight of the vehicle, dimensionless."""


class OperatingPoint(NamedTuple):
    """Scheduling vector, state and uncontrolled inputs of a state of motion.

    Attributes
    ----------
    rho : Schedule
        Scheduling vector, each entry in its parameter's unit.
    x : ndarray, shape (s,)
        State, in the units of `LpvModel.state_units`.
    u_uc : ndarray, shape (k,)
        Uncontrolled inputs, in the units of `LpvModel.uncontrolled_units`.
    """

    rho: Schedule
    x: Array
    u_uc: Array


class SoilReaction(NamedTuple):
    """Forces of the soil on wheels, with shear and motion resistance separated.

    Attributes
    ----------
    load : float or ndarray, shape (n,)
        Upward force, N.
    area : float or ndarray, shape (n,)
        Contact area, m^2.
    shear : float or ndarray, shape (n,)
        Force of the shear stress on the vehicle, N, forward positive.
    shear_moment : float or ndarray, shape (n,)
        Its moment about the centre, N·m, positive if it resists forward rotation.
    resistance : float or ndarray, shape (n,)
        Motion resistance R, N.
    """

    load: Any
    area: Any
    shear: Any
    shear_moment: Any
    resistance: Any


class WheelMotion(NamedTuple):
    """State of motion of n wheels with the forces of the soil; SI units.

    Attributes
    ----------
    v : float
        Speed, m/s, forward positive.
    omega : ndarray, shape (n,)
        Wheel speeds, rad/s, forward positive.
    z, z_rate : ndarray, shape (n,)
        Sinkage, m, and its rate, m/s, downward positive.
    soils : ndarray, shape (n, 17)
        Packed soils.
    imposed : ndarray, shape (n,)
        Load that the soil carries, N, or `traction_model.contact.contact.FREE`.
    reaction : SoilReaction
        Forces on every wheel.
    resistance_gradient : ndarray, shape (n,)
        R/z, N/m; 0 off the ground.
    """

    v: float
    omega: Array
    z: Array
    z_rate: Array
    soils: Array
    imposed: Array
    reaction: SoilReaction
    resistance_gradient: Array


class LpvModel(ABC):
    """LPV model of a vehicle of n wheels; base class for all kinds of state.

    The force of the soil on a wheel has two parts, so that matrices depend on the scheduling
    vector only: shear, and motion resistance ``R = resistance_gradient*z``. In the closed forms R
    acts on the vehicle and the moment of the wheel is r*F. In the form `CONTACT` stresses are per
    horizontal area: R acts as a moment r*R about the axle, and only the shear acts on the vehicle,
    with its own moment.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle.
    form : Form
        Form of the contact model.
    couplings : sequence of Coupling
        Locked differentials and coupled axles; x has only the independent wheels.
    ranges : mapping of str to pair, optional
        Narrower ranges of scheduling parameters: (low, high), each one number or one per wheel, in
        the parameter's unit.

    Attributes
    ----------
    parameters : dict of str to SchedulingParameter
        Scheduling parameters with their ranges, each in its own unit.
    state_names, input_names, uncontrolled_names, output_names : tuple of str
        Names of the entries of x, u, u_uc and y.
    state_units, uncontrolled_units : tuple of str
        Their units; u is in N·m, y in the units of its states.
    constraint : ndarray, shape (n, g)
        Speed of every wheel per speed of the independent ones, dimensionless.
    independent : tuple of int
        Indices of the independent wheels.

    Raises
    ------
    ValueError
        If an argument is unknown or out of range.
    """

    state_names: tuple[str, ...]
    state_units: tuple[str, ...]
    output_names: tuple[str, ...]

    def __init__(
        self,
        vehicle: Vehicle,
        form: Form = Form.CONTACT,
        *,
        couplings: Sequence[Coupling] = (),
        ranges: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    ) -> None:
        self.vehicle = vehicle
        self.form = Form(form)
        self.couplings = tuple(couplings)
        names = vehicle.wheel_names
        self.constraint, self.independent = constraint_matrix(names, self.couplings)
        wheels = vehicle.wheels
        self._radius = np.array([wheel.radius for wheel in wheels])
        # Viscous friction T_f = b_f*omega, the paper's (20).
        self._friction = np.array([wheel.viscous_friction for wheel in wheels])
        P = self.constraint
        inertia = P.T @ np.diag([wheel.inertia for wheel in wheels]) @ P
        # Acceleration of the independent wheels per torque on every wheel, 1/(kg*m^2).
        self._per_torque = np.linalg.solve(inertia, P.T)
        self._resists_rotation = self.form == Form.CONTACT
        self.input_names = tuple(f'torque_{name}' for name in names)
        inputs = self._wheel_inputs()
        self.uncontrolled_names = (
            *(f'{symbol}_{name}' for name in names for symbol, _ in inputs), 'holding_force',
        )  # fmt: skip
        self.uncontrolled_units = (*(unit for _ in names for _, unit in inputs), 'N')
        self._name_states([names[j] for j in self.independent])
        self.parameters = {entry.name: entry for entry in self._valid_ranges()}
        for name, pair in (ranges or {}).items():
            self.parameters[name] = self._narrowed(name, pair)

    @abstractmethod
    def _wheel_inputs(self) -> tuple[tuple[str, str], ...]:
        """Name and unit of every uncontrolled input of one wheel."""

    @abstractmethod
    def _name_states(self, free: Sequence[str]) -> None:
        """Set the names and units of states and outputs; `free` names the independent wheels."""

    @abstractmethod
    def _valid_ranges(self) -> list[SchedulingParameter]:
        """Ranges of validity of the model, for any soil."""

    @abstractmethod
    def _operating_point(self, motion: WheelMotion, holding_force: float) -> OperatingPoint:
        """Scheduling vector, state and uncontrolled inputs of a motion."""

    @abstractmethod
    def terms(self, rho: Schedule | Mapping[str, ArrayLike]) -> dict[str, Array]:
        """Terms of the matrices at a scheduling vector.

        Parameters
        ----------
        rho : Schedule or mapping
            Scheduling vector, each entry in its parameter's unit.

        Returns
        -------
        dict of str to ndarray
            Terms, in the units given by the class.

        Raises
        ------
        ValueError
            As `schedule`.
        """

    @abstractmethod
    def assemble(self, terms: Mapping[str, Array]) -> Matrices:
        """Matrices from terms, without checks, for `matrices` and grids.

        Parameters
        ----------
        terms : mapping of str to ndarray
            As from `terms`, in its units.

        Returns
        -------
        Matrices
            Matrices, in the units of x, u and u_uc.
        """

    @property
    def n_wheels(self) -> int:
        """Number of wheels, dimensionless."""
        return len(self._radius)

    def _resistance_input(self, force: Array, torque: Array, gradient: Array) -> Array:
        """Columns of B_uc for sinkage: R = gradient*z resists rotation, or the vehicle."""
        if self._resists_rotation:
            return np.asarray(-torque * (self._radius * gradient))
        return np.asarray(-force * gradient)

    def _each(self, value: ArrayLike) -> Array:
        """Array with one entry per wheel."""
        return np.array(np.broadcast_to(np.asarray(value, dtype=float), (self.n_wheels,)))

    def _range(
        self, name: str, unit: str, low: ArrayLike, high: ArrayLike, reciprocal: bool = False
    ) -> SchedulingParameter:
        """Scheduling parameter with one entry for every wheel."""
        return SchedulingParameter(name, unit, self._each(low), self._each(high), reciprocal)

    @property
    def _largest_load(self) -> float:
        """Largest load of a wheel, N."""
        return LARGEST_LOAD * self.vehicle.mass * GRAVITY

    @property
    def _min_length(self) -> Array:
        """Contact length at the smallest sinkage, m."""
        return np.asarray(np.sqrt(2 * self._radius * MIN_SINKAGE - MIN_SINKAGE**2))

    def _gradient_range(self) -> SchedulingParameter:
        """Range of the resistance gradient."""
        # R <= N*sin(theta0), and sin(theta0)/z = cot(theta0/2)/r <= 2/l.
        gradient = 2 * self._largest_load / self._min_length
        return self._range('resistance_gradient', 'N/m', -gradient, gradient)

    def _narrowed(self, name: str, pair: tuple[ArrayLike, ArrayLike]) -> SchedulingParameter:
        """Parameter with a narrower range."""
        known = self._parameter(name)
        low, high = (self._entries(f'range of {name}', value, known) for value in pair)
        if np.any(low > high) or np.any(low < known.low) or np.any(high > known.high):
            raise ValueError(
                f'range of {name} must increase and lie within {known.low} to {known.high} '
                f'{known.unit}, got {pair}'
            )
        return SchedulingParameter(name, known.unit, low, high, known.reciprocal)

    def _parameter(self, name: str) -> SchedulingParameter:
        if name not in self.parameters:
            raise ValueError(
                f"unknown scheduling parameter '{name}'{closest(name, self.parameters)}"
            )
        return self.parameters[name]

    @staticmethod
    def _entries(name: str, value: ArrayLike, parameter: SchedulingParameter) -> Array:
        """Finite entries of a parameter; one number applies to all wheels."""
        entries = np.asarray(value, dtype=float)
        n = len(parameter.low)
        if entries.shape not in ((), (n,)):
            raise ValueError(f'{name} must be one number or {n}, got shape {entries.shape}')
        if not np.all(np.isfinite(entries)):
            raise ValueError(f'{name} must be finite, got {entries}')
        return np.array(np.broadcast_to(entries, (n,)))

    def schedule(self, **values: ArrayLike) -> Schedule:
        """Checked scheduling vector.

        Parameters
        ----------
        **values : float or array_like, shape (n,)
            Every parameter of `parameters` by name, in its unit: one number, or one per wheel.

        Returns
        -------
        Schedule
            The scheduling vector, in the parameters' units.

        Raises
        ------
        ValueError
            If a parameter is unknown, missing, of the wrong length, not finite or out of range.
        """
        for name in values:
            self._parameter(name)
        checked = {}
        for name, parameter in self.parameters.items():
            if name not in values:
                raise ValueError(f"scheduling parameter '{name}' ({parameter.unit}) is missing")
            entries = self._entries(name, values[name], parameter)
            wrong = (entries < parameter.low) | (entries > parameter.high)
            if parameter.reciprocal:
                wrong |= np.abs(entries) < 1
            if np.any(wrong):
                j = int(np.flatnonzero(wrong)[0])
                whose = f" of wheel '{self.vehicle.wheel_names[j]}'" if len(entries) > 1 else ''
                unit = '' if parameter.unit == '1' else f' {parameter.unit}'
                gap = ' without -1 to 1' if parameter.reciprocal else ''
                raise ValueError(
                    f'{name}{whose} is {entries[j]:g}{unit}, out of its range '
                    f'{parameter.low[j]:g} to {parameter.high[j]:g}{gap}'
                )
            checked[name] = entries
        return Schedule(checked)

    def sample(self, count: int, seed: int = 0) -> list[Schedule]:
        """Random scheduling vectors, uniform over the ranges (1/slip: uniform in slip).

        Parameters
        ----------
        count : int
            Number of vectors, at least 1.
        seed : int
            Seed of the random numbers.

        Returns
        -------
        list of Schedule
            Vectors, in the parameters' units.
        """
        random = np.random.default_rng(seed)
        return [
            Schedule(
                {
                    name: parameter.sample(random.random(len(parameter.low)))
                    for name, parameter in self.parameters.items()
                }
            )
            for _ in range(count)
        ]

    def narrowed(self, schedules: Iterable[Schedule]) -> Self:
        """Same model with the ranges spanned by some scheduling vectors.

        Parameters
        ----------
        schedules : iterable of Schedule
            Vectors of operation, in the parameters' units, at least one.

        Returns
        -------
        LpvModel
            Model with the same units.
        """
        met = list(schedules)
        if not met:
            raise ValueError('no schedules to span a range')
        ranges: dict[str, tuple[ArrayLike, ArrayLike]] = {}
        for name in self.parameters:
            values = np.array([entry[name] for entry in met])
            ranges[name] = (values.min(axis=0), values.max(axis=0))
        return type(self)(self.vehicle, self.form, couplings=self.couplings, ranges=ranges)

    def _soil_reaction(
        self, j: int, v: float, omega: float, z: float, z_rate: float, soil: Array, imposed: float
    ) -> SoilReaction:
        """Forces on a wheel by the contact model, on undisturbed soil."""
        wheel = self.vehicle.wheels[j]
        load, thrust, resistance, moment, _ = forces_at(
            int(self.form), v, omega, z, z_rate, 0.0, soil.reshape(1, -1), EVERYWHERE,
            wheel.radius, wheel.width, -1, UNTOUCHED, imposed, 0.0,
        )  # fmt: skip
        depth = min(max(z, MIN_SINKAGE), wheel.radius)
        area = wheel.width * math.sqrt(2 * wheel.radius * depth - depth * depth)
        if self._resists_rotation:
            thrust, moment = thrust - resistance, moment - wheel.radius * resistance
        return SoilReaction(load, area, thrust, moment, resistance)

    def at(
        self,
        v: float,
        omega: ArrayLike,
        sinkage: ArrayLike,
        soil: Soil | Sequence[Soil],
        *,
        sinkage_rate: ArrayLike = 0.0,
        load: ArrayLike | None = None,
        holding_force: float = 0.0,
    ) -> OperatingPoint:
        """Scheduling vector, state and uncontrolled inputs at a state of motion.

        Parameters
        ----------
        v : float
            Speed, m/s, forward positive; at least 0.05 with slips as states.
        omega : array_like, shape (n,)
            Wheel speeds, rad/s, forward positive, consistent with the couplings.
        sinkage : array_like, shape (n,)
            m, downward positive; off the ground if not positive.
        soil : Soil or sequence of Soil
            Soil under all wheels, or under each.
        sinkage_rate : float or array_like, shape (n,)
            m/s, downward positive.
        load : array_like, shape (n,), optional
            Known load of every wheel, N, at least 0; default: load from sinkage.
        holding_force : float
            D_x: drawbar, grade and air drag together, N, backward positive.

        Returns
        -------
        OperatingPoint
            Entries in the units of the model.

        Raises
        ------
        ValueError
            If a value has the wrong shape, is not finite, out of range or against a coupling.
        """
        n = self.n_wheels
        omega, z, z_rate = (
            self._series(name, value)
            for name, value in (
                ('omega', omega), ('sinkage', sinkage), ('sinkage_rate', sinkage_rate),
            )
        )  # fmt: skip
        imposed = np.full(n, FREE) if load is None else self._series('load', load)
        if load is not None and np.any(imposed < 0):
            raise ValueError(f'load must be at least 0 N, got {imposed}')
        for name, value in (('v', v), ('holding_force', holding_force)):
            if not math.isfinite(value):
                raise ValueError(f'{name} must be finite, got {value}')
        soils = [soil] * n if isinstance(soil, Soil) else list(soil)
        if len(soils) != n:
            raise ValueError(f'soil must be one or {n}, got {len(soils)}')
        turning = self.constraint @ omega[list(self.independent)]
        if not np.allclose(turning, omega, rtol=1e-9, atol=1e-9):
            j = int(np.argmax(np.abs(turning - omega)))
            raise ValueError(
                f"omega of wheel '{self.vehicle.wheel_names[j]}' is {omega[j]:g} rad/s, the "
                f'couplings make it {turning[j]:g}'
            )
        if np.any(z > self._radius):
            j = int(np.argmax(z - self._radius))
            raise ValueError(
                f"sinkage of wheel '{self.vehicle.wheel_names[j]}' is {z[j]:g} m, "
                f'above its radius {self._radius[j]:g} m'
            )
        return self.at_uncoupled(v, omega, z, z_rate, soils, imposed, holding_force)

    def _series(self, name: str, value: ArrayLike) -> Array:
        """Array of one finite number per wheel."""
        entries = np.asarray(value, dtype=float)
        n = self.n_wheels
        if entries.shape != (n,) and not (name == 'sinkage_rate' and entries.shape == ()):
            raise ValueError(f'{name} must have shape ({n},), got {entries.shape}')
        if not np.all(np.isfinite(entries)):
            raise ValueError(f'{name} must be finite, got {entries}')
        return np.array(np.broadcast_to(entries, (n,)))

    def at_uncoupled(
        self, v: float, omega: Array, z: Array, z_rate: Array, soils: Sequence[Soil],
        imposed: Array, holding_force: float = 0.0,
    ) -> OperatingPoint:  # fmt: skip
        """As `at`, with unchecked arrays; couplings need not hold, as on a grid.

        Parameters
        ----------
        v : float
            Speed, m/s, forward positive.
        omega : ndarray, shape (n,)
            Wheel speeds, rad/s, forward positive.
        z, z_rate : ndarray, shape (n,)
            Sinkage, m, and its rate, m/s, downward positive.
        soils : sequence of Soil
            Soil under each wheel.
        imposed : ndarray, shape (n,)
            Load that the soil carries, N, or `traction_model.contact.contact.FREE`.
        holding_force : float
            D_x, N, backward positive.

        Returns
        -------
        OperatingPoint
            Entries in the units of the model.
        """
        check_form(self.form, soils)
        packed = np.array(
            [soil.packed(wheel) for soil, wheel in zip(soils, self.vehicle.wheels, strict=True)]
        )
        reactions = [
            self._soil_reaction(j, v, omega[j], z[j], z_rate[j], packed[j], imposed[j])
            for j in range(self.n_wheels)
        ]
        found = SoilReaction(*(np.array(column) for column in zip(*reactions, strict=True)))
        gradient = np.where(z > 0, found.resistance / np.where(z > 0, z, 1.0), 0.0)
        motion = WheelMotion(v, omega, z, z_rate, packed, imposed, found, gradient)
        return self._operating_point(motion, holding_force)

    def matrices(self, rho: Schedule | Mapping[str, ArrayLike]) -> Matrices:
        """Matrices at a scheduling vector.

        Parameters
        ----------
        rho : Schedule or mapping
            Scheduling vector, each entry in its parameter's unit.

        Returns
        -------
        Matrices
            Matrices, in the units of x, u and u_uc.

        Raises
        ------
        ValueError
            As `schedule`.
        """
        return self.assemble(self.terms(rho))

    def controllability_rank(
        self, rho: Schedule | Mapping[str, ArrayLike], tolerance: float = 1e-9
    ) -> int:
        """Number of states that torque controls at a scheduling vector.

        Parameters
        ----------
        rho : Schedule or mapping
            Scheduling vector, each entry in its parameter's unit.
        tolerance : float
            As for `controllability_rank`, relative, dimensionless.

        Returns
        -------
        int
            Rank of the controllability matrix; all states are controllable if it equals their
            number.
        """
        found = self.matrices(rho)
        return controllability_rank(found.A, found.B, tolerance)

    def to_control(
        self, rho: Schedule | Mapping[str, ArrayLike], *, combined: bool = False
    ) -> 'control.StateSpace':
        """Model at a scheduling vector as a system of python-control.

        Parameters
        ----------
        rho : Schedule or mapping
            Scheduling vector, each entry in its parameter's unit.
        combined : bool
            True to append the uncontrolled inputs to the torques.

        Returns
        -------
        control.StateSpace
            System with the names and units of the model.

        Raises
        ------
        ImportError
            If python-control is not installed.
        ValueError
            As `schedule`.
        """
        try:
            import control
        except ImportError as error:
            raise ImportError(
                'to_control needs the package python-control: '
                "pip install 'traction_model[control]', or pip install control"
            ) from error
        found = self.matrices(rho)
        A, B, C, D = found.combined() if combined else (found.A, found.B, found.C, found.D)
        return control.ss(
            A, B, C, D,
            states=list(self.state_names),
            inputs=[*self.input_names, *(self.uncontrolled_names if combined else ())],
            outputs=[f'y_{name}' for name in self.output_names],
            name='lpv',
        )  # fmt: skip
