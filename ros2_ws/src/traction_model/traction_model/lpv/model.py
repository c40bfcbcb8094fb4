"""LPV models of traction: matrices scheduled by what soil, slip and speed make of them.

`LpvModel` has the vehicle's equations of motion (`traction_model.simulation.vehicle_dynamics`),
sinkage given, as a linear model whose matrices depend on a scheduling vector rho and on nothing
else:

    x' = A(rho)*x + B(rho)*u + B_uc(rho)*u_uc,   y = C*x + D*u

It is exact: with rho, x and u_uc taken at a state (`LpvModel.at`), x' is what the nonlinear
equations give. Derivation, units and what the paper printed: ``docs/theory.md``, "The paper's
state space" and "Slip as a state". Source: Agriculture 2024, 14(3), 499 (*the paper*),
equations (16) to (31).

`slip_dynamics` is the model of one wheel that the gains of slip control are scheduled with.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_model.contact.contact import (
    EVERYWHERE,
    FREE,
    MIN_TRANSIT_SPEED,
    UNTOUCHED,
    Form,
    check_form,
    forces_at,
    slip_along_path,
)
from traction_model.lpv.scheduling import Parameter, Schedule
from traction_model.slip import slip
from traction_model.soil.soil import COHESION, N_EXP, SHEAR_MODULUS, TAN_PHI, Soil
from traction_model.vehicle.coupling import Coupling, constraint_matrix
from traction_model.vehicle.vehicle import GRAVITY, Vehicle
from traction_model.vehicle.wheel import Wheel
from traction_node.closest import closest

if TYPE_CHECKING:
    import control

Array = NDArray[np.float64]

State = Literal['speed', 'slip', 'inverse_slip']
"""What stands for the wheels in x: their speeds, their slips, or 1/slip."""

MIN_SINKAGE = 1e-5
"""Sinkage that a wheel in contact has at least, m: it bounds 1/A."""

LARGEST_INVERSE_SLIP = {'speed': 1e4, 'slip': 1e4, 'inverse_slip': 100.0}
"""Bound of |1/i|, dimensionless, by `State`.

As a scheduling parameter of the form `PAPER` it may be large, as no thrust is left there; as a
state it would be lost in rounding and noise.
"""

LARGEST_LOAD = 20.0
"""Load of one wheel, in weights of the vehicle, that the ranges allow for (dimensionless)."""


class Matrices(NamedTuple):
    """A linear model at one scheduling vector; s states, n torques, k uncontrolled inputs.

    Attributes
    ----------
    A : ndarray, shape (s, s)
        State units per state unit and second.
    B : ndarray, shape (s, n)
        Torques: state units per N*m and second.
    B_uc : ndarray, shape (s, k)
        Inputs that cannot be controlled: state units per input unit and second.
    C : ndarray, shape (p, s)
        Outputs, in units of the states.
    D : ndarray, shape (p, n)
        Zero: no torque reaches an output at once; output units per N*m.
    """

    A: Array
    B: Array
    B_uc: Array
    C: Array
    D: Array

    def combined(self) -> tuple[Array, Array, Array, Array]:
        """Return the model with all inputs in one B, ``[u; u_uc]``, as Kalman filters take it.

        Returns
        -------
        A, B, C, D : ndarray
            Shapes (s, s), (s, n + k), (p, s), (p, n + k); units as in `Matrices`.
        """
        none = np.zeros((len(self.C), self.B_uc.shape[1]))
        return self.A, np.hstack([self.B, self.B_uc]), self.C, np.hstack([self.D, none])


class OperatingPoint(NamedTuple):
    """The LPV model's view of one state of motion.

    Attributes
    ----------
    rho : Schedule
        Scheduling vector, each entry in its parameter's unit.
    x : ndarray, shape (s,)
        State, in the units of `LpvModel.state_units`.
    u_uc : ndarray, shape (k,)
        Inputs that cannot be controlled, in the units of `LpvModel.uncontrolled_units`.
    """

    rho: Schedule
    x: Array
    u_uc: Array


class _Contact(NamedTuple):
    """What soil does to a wheel, N, m^2, N, N*m, N; or arrays of them."""

    load: Any
    area: Any
    shear: Any
    shear_moment: Any
    resistance: Any


class LpvModel:
    """LPV model of a vehicle of n wheels.

    With `state` 'speed' it is the paper's (29) and (31): x = [v, omega ...], u = T, u_uc =
    [tau_max, z of every wheel ..., D_x], with the units put right. Torque does not reach v in
    it. With 'slip' or 'inverse_slip' slips (or 1/slip) stand for wheel speeds, u_uc = [thrust
    and moment at zero of the wheel's state, z ..., D_x], and v can be controlled.

    The soil's force on a wheel is split in two, so that nothing but the scheduling vector
    enters a matrix:

    - shear, ``F = tau_max*A*mobilisation`` with ``mobilisation = +-(1 - kappa)``,
    - motion resistance, ``R = resistance_gradient*z``.

    In the closed forms R holds the vehicle back and the wheel's moment is r*F. In the form
    `CONTACT` stresses are per horizontal area: R acts as a moment r*R about the axle, the shear
    alone on the vehicle, and its moment has a mobilisation of its own. In the form `EMPIRICAL`
    the mean pressure N/A stands for tau_max, and mobilisation is the gross traction ratio.

    Parameters
    ----------
    vehicle : Vehicle
        What drives.
    form : Form
        Form of the contact model.
    state : {'speed', 'slip', 'inverse_slip'}
        What stands for the wheels in x.
    couplings : sequence of Coupling
        Locked differentials and coupled axles; they leave the independent wheels in x.
    ranges : mapping of str to pair, optional
        Narrower ranges of scheduling parameters: (low, high), each one number or one a wheel,
        in the parameter's unit.

    Attributes
    ----------
    parameters : dict of str to Parameter
        The scheduling parameters and their ranges, each in its own unit.
    state_names, input_names, uncontrolled_names, output_names : tuple of str
        Names of the entries of x, u, u_uc and y.
    state_units, uncontrolled_units : tuple of str
        Their units; u is in N*m, y in the units of its states.
    constraint : ndarray, shape (n, g)
        Speed of every wheel per speed of the independent ones, dimensionless.
    independent : tuple of int
        Indices of the independent wheels.

    Raises
    ------
    ValueError
        Naming what is unknown or out of range.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        form: Form = Form.CONTACT,
        *,
        state: State = 'speed',
        couplings: Sequence[Coupling] = (),
        ranges: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    ) -> None:
        if state not in get_args(State):
            raise ValueError(f'unknown state {state!r}{closest(str(state), get_args(State))}')
        self.vehicle = vehicle
        self.form = Form(form)
        self.state: State = state
        self.couplings = tuple(couplings)
        names = vehicle.wheel_names
        self.constraint, self.independent = constraint_matrix(names, self.couplings)
        wheels = vehicle.wheels
        self._radius = np.array([wheel.radius for wheel in wheels])
        self._friction = np.array([wheel.viscous_friction for wheel in wheels])
        P = self.constraint
        inertia = P.T @ np.diag([wheel.inertia for wheel in wheels]) @ P
        # Acceleration of the independent wheels per torque on every wheel, 1/(kg*m^2).
        self._per_torque = np.linalg.solve(inertia, P.T)
        self._on_wheel = self.form == Form.CONTACT

        free = [names[j] for j in self.independent]
        symbol, unit = ('omega', 'rad/s') if state == 'speed' else (state, '1')
        self.state_names = ('v', *(f'{symbol}_{name}' for name in free))
        self.state_units = ('m/s', *(unit for _ in free))
        self.input_names = tuple(f'torque_{name}' for name in names)
        if state == 'speed':
            stress = 'pressure' if self.form == Form.EMPIRICAL else 'tau_max'
            inputs: tuple[tuple[str, str], ...] = ((stress, 'Pa'), ('sinkage', 'm'))
            self.output_names = ('v', *(f'omega_{name}' for name in names))
        else:
            inputs = (('thrust', 'N'), ('moment', 'N*m'), ('sinkage', 'm'))
            self.output_names = self.state_names
        self.uncontrolled_names = (
            *(f'{symbol}_{name}' for name in names for symbol, _ in inputs), 'holding_force',
        )  # fmt: skip
        self.uncontrolled_units = (*(unit for _ in names for _, unit in inputs), 'N')
        self.parameters = self._valid_ranges()
        for name, pair in (ranges or {}).items():
            self.parameters[name] = self._narrowed(name, pair)

    @property
    def n_wheels(self) -> int:
        """Number of wheels, dimensionless."""
        return len(self._radius)

    def _valid_ranges(self) -> dict[str, Parameter]:
        """Ranges on which the model holds, whatever the soil."""
        n = self.n_wheels
        width = np.array([wheel.width for wheel in self.vehicle.wheels])
        min_length = np.sqrt(2 * self._radius * MIN_SINKAGE - MIN_SINKAGE**2)
        load = LARGEST_LOAD * self.vehicle.mass * GRAVITY
        # R <= N*sin(theta0), and sin(theta0)/z = cot(theta0/2)/r <= 2/l.
        gradient = 2 * load / min_length
        inverse = LARGEST_INVERSE_SLIP[self.state]

        def each(value: ArrayLike) -> Array:
            return np.array(np.broadcast_to(np.asarray(value, dtype=float), (n,)))

        def parameter(
            name: str, unit: str, low: ArrayLike, high: ArrayLike, reciprocal: bool = False
        ) -> Parameter:
            return Parameter(name, unit, each(low), each(high), reciprocal)

        if self.state != 'speed':
            slipping = (
                parameter('slip', '1', -0.99, 0.99)
                if self.state == 'slip'
                else parameter('inverse_slip', '1', -inverse, inverse, reciprocal=True)
            )
            # Of the order of load*l/K, and l/K <= r/0.1 mm.
            stiffness = load * self._radius / 1e-4
            found = [
                Parameter('speed', 'm/s', np.array([MIN_TRANSIT_SPEED]), np.array([100.0])),
                slipping,
                parameter('slip_stiffness', 'N', -stiffness, stiffness),
                parameter(
                    'moment_stiffness', 'N*m', -stiffness * self._radius,
                    stiffness * self._radius,
                ),
                parameter('resistance_gradient', 'N/m', -gradient, gradient),
            ]  # fmt: skip
            return {entry.name: entry for entry in found}
        area = parameter('area', 'm^2', width * min_length, 2 * width * self._radius)
        # The shear stress nowhere exceeds the strength, whose mean over the contact ahead of the
        # wheel's bottom is tau_max: 1, and more where contact reaches behind it too.
        mobilisation = parameter('mobilisation', '1', -3.0, 3.0)
        if self.form in (Form.CONTACT, Form.EMPIRICAL):
            found = [area, mobilisation]
            if self.form == Form.CONTACT:
                found.append(parameter('moment_mobilisation', '1', -3.0, 3.0))
            found.append(parameter('resistance_gradient', 'N/m', -gradient, gradient))
        else:
            found = [
                Parameter('heading', '1', np.array([-1.0]), np.array([1.0])),
                parameter('sinkage_exponent', '1', 0.0, 3.0),
                area,
                parameter('load', 'N', 0.0, load),
            ]
            if self.form == Form.PAPER:
                found += [
                    parameter('shear_deformation_modulus', 'm', 1e-4, 1.0),
                    parameter('inverse_slip', '1', -inverse, inverse, reciprocal=True),
                ]
            else:
                found.append(mobilisation)
        return {entry.name: entry for entry in found}

    def _narrowed(self, name: str, pair: tuple[ArrayLike, ArrayLike]) -> Parameter:
        """Parameter with a narrower range."""
        known = self._parameter(name)
        low, high = (self._entries(f'range of {name}', value, known) for value in pair)
        if np.any(low > high) or np.any(low < known.low) or np.any(high > known.high):
            raise ValueError(
                f'range of {name} must increase and lie within {known.low} to {known.high} '
                f'{known.unit}, got {pair}'
            )
        return Parameter(name, known.unit, low, high, known.reciprocal)

    def _parameter(self, name: str) -> Parameter:
        if name not in self.parameters:
            raise ValueError(
                f"unknown scheduling parameter '{name}'{closest(name, self.parameters)}"
            )
        return self.parameters[name]

    @staticmethod
    def _entries(name: str, value: ArrayLike, parameter: Parameter) -> Array:
        """Finite entries of a parameter; one number stands for all wheels."""
        entries = np.asarray(value, dtype=float)
        n = len(parameter.low)
        if entries.shape not in ((), (n,)):
            raise ValueError(f'{name} must be one number or {n}, got shape {entries.shape}')
        if not np.all(np.isfinite(entries)):
            raise ValueError(f'{name} must be finite, got {entries}')
        return np.array(np.broadcast_to(entries, (n,)))

    def schedule(self, **values: ArrayLike) -> Schedule:
        """Check a scheduling vector.

        Parameters
        ----------
        **values : float or array_like, shape (n,)
            Every parameter of `parameters` by name, in its unit: one number, or one a wheel.

        Returns
        -------
        Schedule
            The scheduling vector, in the parameters' units.

        Raises
        ------
        ValueError
            Naming the parameter that is unknown, missing, of the wrong length, not finite or
            out of range, and the wheel.
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
        """Draw scheduling vectors from the ranges, each parameter evenly (1/slip: even in slip).

        Parameters
        ----------
        count : int
            How many, at least 1.
        seed : int
            Of the random numbers.

        Returns
        -------
        list of Schedule
            The vectors, in the parameters' units.
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

    def narrowed(self, schedules: Iterable[Schedule]) -> 'LpvModel':
        """Return the same model with the ranges that some scheduling vectors span.

        Parameters
        ----------
        schedules : iterable of Schedule
            Vectors met in operation, in the parameters' units, at least one.

        Returns
        -------
        LpvModel
            The model; units as before.
        """
        met = list(schedules)
        if not met:
            raise ValueError('no schedules to span a range')
        ranges: dict[str, tuple[ArrayLike, ArrayLike]] = {}
        for name in self.parameters:
            values = np.array([entry[name] for entry in met])
            ranges[name] = (values.min(axis=0), values.max(axis=0))
        return LpvModel(
            self.vehicle, self.form, state=self.state, couplings=self.couplings, ranges=ranges
        )

    def _contact(
        self, j: int, v: float, omega: float, z: float, z_rate: float, soil: Array, imposed: float
    ) -> _Contact:
        """Ask the contact model, on fresh soil: the one place where it is called."""
        wheel = self.vehicle.wheels[j]
        load, thrust, resistance, moment, _ = forces_at(
            int(self.form), v, omega, z, z_rate, 0.0, soil.reshape(1, -1), EVERYWHERE,
            wheel.radius, wheel.width, -1, UNTOUCHED, imposed, 0.0,
        )  # fmt: skip
        depth = min(max(z, MIN_SINKAGE), wheel.radius)
        area = wheel.width * math.sqrt(2 * wheel.radius * depth - depth * depth)
        if self._on_wheel:
            thrust, moment = thrust - resistance, moment - wheel.radius * resistance
        return _Contact(load, area, thrust, moment, resistance)

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
            Speed, m/s, forward positive; at least 0.05 when slip is a state.
        omega : array_like, shape (n,)
            Wheel speeds, rad/s, forward positive, in keeping with the couplings.
        sinkage : array_like, shape (n,)
            m, downward positive; off the ground where not positive.
        soil : Soil or sequence of Soil
            Under all wheels, or under each.
        sinkage_rate : float or array_like, shape (n,)
            m/s, downward positive.
        load : array_like, shape (n,), optional
            Load that the soil under every wheel is known to carry, N, at least 0; what sinkage
            makes it carry when not given.
        holding_force : float
            D_x: drawbar, grade and air drag together, N, backward positive.

        Returns
        -------
        OperatingPoint
            Each entry in the unit that the model states.

        Raises
        ------
        ValueError
            Naming what is of the wrong length, not finite, out of range or against a coupling.
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
        """One finite number a wheel."""
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
        """As `at`, of arrays taken as they are: couplings need not hold, as on a grid.

        Parameters
        ----------
        v : float
            Speed, m/s, forward positive.
        omega : ndarray, shape (n,)
            Wheel speeds, rad/s, forward positive.
        z, z_rate : ndarray, shape (n,)
            Sinkage, m, and its rate, m/s, downward positive.
        soils : sequence of Soil
            Under each wheel.
        imposed : ndarray, shape (n,)
            Load that the soil carries, N, or `traction_model.contact.contact.FREE`.
        holding_force : float
            D_x, N, backward positive.

        Returns
        -------
        OperatingPoint
            Each entry in the unit that the model states.
        """
        check_form(self.form, soils)
        wheels = range(self.n_wheels)
        packed = np.array(
            [soil.packed(wheel) for soil, wheel in zip(soils, self.vehicle.wheels, strict=True)]
        )
        contacts = [
            self._contact(j, v, omega[j], z[j], z_rate[j], packed[j], imposed[j]) for j in wheels
        ]
        found = _Contact(*(np.array(column) for column in zip(*contacts, strict=True)))
        depth = np.where(z > 0, z, 1.0)
        gradient = np.where(z > 0, found.resistance / depth, 0.0)
        if self.state != 'speed':
            return self._at_slips(
                v, omega, z, z_rate, packed, imposed, found, gradient, holding_force
            )

        # Mohr and Coulomb's, under the mean pressure; a wheel off the ground finds none. A curve
        # takes thrust as a share of the load.
        pressure = found.load / found.area
        strength = packed[:, COHESION] + pressure * packed[:, TAN_PHI]
        if self.form == Form.EMPIRICAL:
            strength = pressure
        strength = np.where(z > 0, strength, 0.0)
        # Signed as the thrust is, which slip is not in reverse.
        rim = self._radius * omega
        slipping = [slip_along_path(v, rim[j]) for j in wheels]
        values: dict[str, ArrayLike] = {
            'heading': max(-1.0, min(1.0, v / MIN_TRANSIT_SPEED)),
            'sinkage_exponent': packed[:, N_EXP],
            'area': found.area,
            'load': found.load,
            'shear_deformation_modulus': packed[:, SHEAR_MODULUS],
            'inverse_slip': [self._inverse_slip(value) for value in slipping],
            'mobilisation': self._mobilisation(found.shear, strength * found.area),
            'moment_mobilisation': self._mobilisation(
                found.shear_moment / self._radius, strength * found.area
            ),
            'resistance_gradient': gradient,
        }
        rho = self.schedule(**{name: values[name] for name in self.parameters})
        x = np.array([v, *omega[list(self.independent)]])
        u_uc = np.append(np.column_stack([strength, z]).ravel(), holding_force)
        return OperatingPoint(rho, x, u_uc)

    def _inverse_slip(self, slipping: float) -> float:
        """1/slip, within its bound when it only schedules."""
        largest = LARGEST_INVERSE_SLIP[self.state]
        if self.state == 'speed' and abs(slipping) * largest < 1:
            return math.copysign(largest, slipping)
        return 1 / slipping if slipping else math.inf

    def _mobilisation(self, force: Array, strength: Array) -> Array:
        """Share of the strength, N, that a force takes."""
        bare = (strength == 0) & (np.abs(force) > 0)
        if np.any(bare):
            name = self.vehicle.wheel_names[int(np.flatnonzero(bare)[0])]
            raise ValueError(
                f"soil under wheel '{name}' has neither cohesion nor friction, which shear "
                'is scheduled by'
            )
        return np.asarray(np.divide(force, strength, out=np.zeros_like(force), where=strength > 0))

    def _at_slips(
        self, v: float, omega: Array, z: Array, z_rate: Array, packed: Array,
        imposed: Array, found: _Contact, gradient: Array, held: float,
    ) -> OperatingPoint:  # fmt: skip
        """`at_uncoupled` with slip or 1/slip as state."""
        n = self.n_wheels
        slipping = np.array([slip(v, self._radius[j] * omega[j]) for j in range(n)])
        # Slopes over wheel speed at constant v, the other state.
        shear_slope, moment_slope = np.empty(n), np.empty(n)
        for j in range(n):
            h = 1e-5 * max(abs(omega[j]), max(abs(v), MIN_TRANSIT_SPEED) / self._radius[j])
            below, above = (
                self._contact(j, v, speed, z[j], z_rate[j], packed[j], imposed[j])
                for speed in (omega[j] - h, omega[j] + h)
            )
            shear_slope[j] = (above.shear - below.shear) / (2 * h)
            moment_slope[j] = (above.shear_moment - below.shear_moment) / (2 * h)
        values: dict[str, ArrayLike] = {
            'speed': v,
            'slip': slipping,
            'inverse_slip': [self._inverse_slip(value) for value in slipping],
            'resistance_gradient': gradient,
        }
        # Where these divide by zero, speed or slip is out of range, as the check below tells.
        with np.errstate(divide='ignore', invalid='ignore'):
            per_speed = _slip_slopes(v, slipping)[1] * self._radius
            values['slip_stiffness'] = shear_slope / per_speed
            values['moment_stiffness'] = moment_slope / per_speed
        rho = self.schedule(**{name: values[name] for name in self.parameters})

        states = rho[self.state][list(self.independent)]
        turned = self._wheel_speed_per_state(v, slipping) @ states
        at_zero = [found.shear - shear_slope * turned, found.shear_moment - moment_slope * turned]
        u_uc = np.append(np.column_stack([*at_zero, z]).ravel(), held)
        return OperatingPoint(rho, np.array([v, *states]), u_uc)

    def _wheel_state_slopes(self, v: float, slipping: Array) -> tuple[Array, Array]:
        """Slopes of the independent wheels' states over v, s/m, and wheel speed, s/rad."""
        over_v, over_rim = _slip_slopes(v, slipping)
        own = list(self.independent)
        # (1/i)' = -i'/i^2.
        factor = -1 / slipping[own] ** 2 if self.state == 'inverse_slip' else 1.0
        return factor * over_v[own], factor * (over_rim * self._radius)[own]

    def _wheel_speed_per_state(self, v: float, slipping: Array) -> Array:
        """Slope of every wheel's speed over the independent wheels' states, rad/s, (n, g)."""
        return np.asarray(self.constraint / self._wheel_state_slopes(v, slipping)[1])

    def terms(self, rho: Schedule | Mapping[str, ArrayLike]) -> dict[str, Array]:
        """Return what rho amounts to in the matrices.

        With wheel speeds as states the matrices are affine in these terms.

        Parameters
        ----------
        rho : Schedule or mapping
            Scheduling vector, each entry in its parameter's unit.

        Returns
        -------
        dict of str to ndarray
            With wheel speeds as states ``thrust_area``, m^2, thrust per tau_max,
            ``resistance_gradient``, N/m, and, in the form `CONTACT`, ``moment_area``, m^2, the
            shear's moment per tau_max and radius. With slips ``speed``, m/s, ``slip``,
            ``slip_stiffness``, N, ``moment_stiffness``, N*m, and ``resistance_gradient``.

        Raises
        ------
        ValueError
            As `schedule`.
        """
        values = self.schedule(**(rho.values if isinstance(rho, Schedule) else rho)).values
        if self.state == 'slip':
            return dict(values)
        if self.state == 'inverse_slip':
            return {
                'slip' if name == 'inverse_slip' else name: (
                    1 / entries if name == 'inverse_slip' else entries
                )
                for name, entries in values.items()
            }
        area = values['area']
        if self.form == Form.CONTACT:
            return {
                'thrust_area': area * values['mobilisation'],
                'moment_area': area * values['moment_mobilisation'],
                'resistance_gradient': values['resistance_gradient'],
            }
        if self.form == Form.EMPIRICAL:
            return {
                'thrust_area': area * values['mobilisation'],
                'resistance_gradient': values['resistance_gradient'],
            }
        width = np.array([wheel.width for wheel in self.vehicle.wheels])
        if self.form == Form.PAPER:
            # A*(1 - kappa) with kappa = K/(|i|*l) and A = b*l; none where kappa exceeds 1.
            inverse = values['inverse_slip']
            lost = width * values['shear_deformation_modulus'] * np.abs(inverse)
            thrust_area = np.sign(inverse) * np.maximum(0.0, area - lost)
        else:
            thrust_area = area * values['mobilisation']
        gradient = width * values['load'] / ((values['sinkage_exponent'] + 1) * area)
        return {
            'thrust_area': thrust_area,
            'resistance_gradient': values['heading'] * gradient,
        }

    def matrices(self, rho: Schedule | Mapping[str, ArrayLike]) -> Matrices:
        """Return the matrices at a scheduling vector.

        Parameters
        ----------
        rho : Schedule or mapping
            Scheduling vector, each entry in its parameter's unit.

        Returns
        -------
        Matrices
            In the units of x, u and u_uc.

        Raises
        ------
        ValueError
            As `schedule`.
        """
        return self.assemble(self.terms(rho))

    def assemble(self, terms: Mapping[str, Array]) -> Matrices:
        """Return the matrices of terms, unchecked: what `matrices` and grids build on.

        Parameters
        ----------
        terms : mapping of str to ndarray
            As `terms` returns them, in its units.

        Returns
        -------
        Matrices
            In the units of x, u and u_uc.
        """
        n, g = self.constraint.shape
        mass = self.vehicle.mass
        # What each wheel's shear and moment at its axle do to the states (v, then wheels).
        force, torque = np.zeros((g + 1, 1)), np.zeros((g + 1, n))
        force[0] = 1 / mass
        A = np.zeros((g + 1, g + 1))
        friction = self._per_torque @ (self._friction[:, None] * self.constraint)
        if self.state == 'speed':
            torque[1:] = self._per_torque
            A[1:, 1:] = -friction
            lever = terms['moment_area' if self._on_wheel else 'thrust_area']
            per_wheel = [force * terms['thrust_area'] - torque * (self._radius * lever)]
            C = np.zeros((n + 1, g + 1))
            C[0, 0] = 1.0
            C[1:, 1:] = self.constraint
        else:
            v, slipping = float(terms['speed'][0]), terms['slip']
            over_v, over_speed = self._wheel_state_slopes(v, slipping)
            force[1:, 0] = over_v / mass
            torque[1:] = over_speed[:, None] * self._per_torque
            turned = self._wheel_speed_per_state(v, slipping)
            per_speed = (_slip_slopes(v, slipping)[1] * self._radius)[:, None]
            shear = terms['slip_stiffness'][:, None] * per_speed * turned
            moment = terms['moment_stiffness'][:, None] * per_speed * turned
            A[:, 1:] = force * shear.sum(axis=0) - torque @ moment
            # omega = (omega/v)*v: friction is linear in v at a given slip.
            own = list(self.independent)
            per_v = _rim_ratio(slipping[own]) / self._radius[own]
            A[1:, 0] = -over_speed * (friction @ per_v)
            per_wheel = [np.tile(force, n), -torque]
            C = np.eye(g + 1)
        if self._on_wheel:
            per_wheel.append(-torque * (self._radius * terms['resistance_gradient']))
        else:
            per_wheel.append(-force * terms['resistance_gradient'])
        # Inputs wheel by wheel, then D_x.
        B_uc = np.hstack([np.stack(per_wheel, axis=2).reshape(g + 1, -1), -force])
        return Matrices(A, torque, B_uc, C, np.zeros((len(C), n)))

    def controllability_rank(
        self, rho: Schedule | Mapping[str, ArrayLike], tolerance: float = 1e-9
    ) -> int:
        """Number of states that torque controls at a scheduling vector.

        Parameters
        ----------
        rho : Schedule or mapping
            Scheduling vector, each entry in its parameter's unit.
        tolerance : float
            As in `controllability_rank`, relative, dimensionless.

        Returns
        -------
        int
            Rank of the controllability matrix; all states are controlled when it is their
            number.
        """
        found = self.matrices(rho)
        return controllability_rank(found.A, found.B, tolerance)

    def to_control(
        self, rho: Schedule | Mapping[str, ArrayLike], *, combined: bool = False
    ) -> 'control.StateSpace':
        """Return the model at a scheduling vector as a system of python-control.

        Parameters
        ----------
        rho : Schedule or mapping
            Scheduling vector, each entry in its parameter's unit.
        combined : bool
            Whether the uncontrolled inputs follow the torques as inputs.

        Returns
        -------
        control.StateSpace
            With the model's names of states, inputs and outputs, in its units.

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


def wheel_speed(v: float, slip: ArrayLike, radius: ArrayLike) -> Array:
    """Wheel speed at a slip, going forward.

    Parameters
    ----------
    v : float
        Speed, m/s, at least 0.
    slip : array_like
        Slip, -1 to below 1.
    radius : array_like
        Radius of the wheel, m, above 0.

    Returns
    -------
    ndarray
        omega, rad/s.
    """
    return np.asarray(v * _rim_ratio(np.asarray(slip, dtype=float)) / np.asarray(radius))


def _rim_ratio(slipping: Array) -> Array:
    """Rim speed over speed at a slip, going forward."""
    return np.where(slipping >= 0, 1 / (1 - slipping), 1 + slipping)


def _slip_slopes(v: float, slipping: Array) -> tuple[Array, Array]:
    """Slopes of slip over speed and over rim speed, s/m, going forward.

    Driving, i = 1 - v/(r*omega): -1/(r*omega) and v/(r*omega)^2. Braking, i = r*omega/v - 1:
    -r*omega/v^2 and 1/v.
    """
    ratio = _rim_ratio(slipping)
    driving = slipping >= 0
    over_v = -np.where(driving, 1 / ratio, ratio) / v
    over_rim = np.where(driving, 1 / ratio**2, 1.0) / v
    return over_v, over_rim


def controllability_rank(A: Array, B: Array, tolerance: float = 1e-9) -> int:
    """Rank of the controllability matrix [B, A*B, ...], whatever the units.

    Rows and columns are scaled to a largest entry of 1 in turn, which changes no rank; zero
    rows stay zero, so that a state no input reaches is never counted.

    Parameters
    ----------
    A : ndarray, shape (s, s)
        State matrix, state units per state unit and second.
    B : ndarray, shape (s, m)
        Input matrix, state units per input unit and second.
    tolerance : float
        Singular values below this share of the largest count as zero, dimensionless.

    Returns
    -------
    int
        The rank, 0 to s.
    """
    blocks = [_scaled(B, 0)]
    for _ in range(len(A) - 1):
        # Scaled block by block, as powers of fast and slow rates soon differ by more than
        # numbers hold.
        blocks.append(_scaled(A @ blocks[-1], 0))
    reach = np.hstack(blocks)
    for _ in range(3):
        reach = _scaled(_scaled(reach, 1), 0)
    singular = np.linalg.svd(reach, compute_uv=False)
    return int(np.sum(singular > tolerance * max(singular[0], np.finfo(float).tiny)))


def _scaled(matrix: Array, axis: int) -> Array:
    """Matrix with the largest entry of every column (0) or row (1) made 1; zeros stay."""
    largest = np.abs(matrix).max(axis=axis, keepdims=True)
    return np.asarray(matrix / np.where(largest > 0, largest, 1.0))


def slip_dynamics(
    wheel: Wheel, mass: float, rim_speed: float, slip_stiffness: float, slip: float
) -> tuple[float, float]:
    """Linear model of slip under torque at one operating point.

    From ``i = 1 - v/(r*omega)`` and the equations of motion,

        i' = [-(F - R - D)/m + (1 - i)*r*(T - b_f*omega - M)/J] / (r*omega)

    and, with ``M = r*F`` and the slip stiffness ``C = dF/di``, for small changes

        i' = a*i + b*T,   a = -C*(1/m + (1 - i)*r^2/J)/(r*omega),   b = (1 - i)/(J*omega)

    so that rho = (r*omega, C) schedules both: b changes tenfold with speed.

    Parameters
    ----------
    wheel : Wheel
        The wheel.
    mass : float
        Mass that it propels, kg, above 0.
    rim_speed : float
        r*omega, m/s, above 0.
    slip_stiffness : float
        C = dF/di, N, at least 0.
    slip : float
        Slip at the operating point when driving, at least 0 and below 1.

    Returns
    -------
    a, b : float
        1/s and 1/(N*m*s): ``i' = a*i + b*T`` for changes from the operating point.

    Raises
    ------
    ValueError
        Naming the argument that is out of range.
    """
    for name, value, allowed in (
        ('mass', mass, mass > 0),
        ('rim_speed', rim_speed, rim_speed > 0),
        ('slip_stiffness', slip_stiffness, slip_stiffness >= 0),
        ('slip', slip, 0 <= slip < 1),
    ):
        if not (math.isfinite(value) and allowed):
            raise ValueError(f'{name} is out of range: {value}')
    r = wheel.radius
    a = -slip_stiffness * (1 / mass + (1 - slip) * r * r / wheel.inertia) / rim_speed
    b = (1 - slip) * r / (wheel.inertia * rim_speed)
    return a, b


def sampled(
    a: NDArray[np.float64], b: NDArray[np.float64], dt: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sample a linear model exactly, its input held over the period.

    Parameters
    ----------
    a : ndarray, shape (n, n)
        State matrix, 1/s.
    b : ndarray, shape (n, m)
        Input matrix, state units per input unit and second.
    dt : float
        Sampling period, s, above 0.

    Returns
    -------
    a_d : ndarray, shape (n, n)
        State matrix of the sampled model, dimensionless up to state units.
    b_d : ndarray, shape (n, m)
        Input matrix of the sampled model, state units per input unit.
    """
    # Costly to import, and of no use to those who only simulate.
    from scipy.linalg import expm

    n, m = b.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n] = a
    block[:n, n:] = b
    transition = expm(block * dt)
    return transition[:n, :n], transition[:n, n:]
