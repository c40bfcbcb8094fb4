"""Sweeps: many drives with soil, vehicle and torque drawn from distributions (Monte Carlo).

A definition in YAML has the nominal drive and the varied quantities. Draws depend only on
definition and seed, not on the processes that simulate them.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, Field, model_validator
from scipy.stats import qmc

from traction_model.definition import Definition, DefinitionError, build, read_yaml
from traction_model.distribution import Distribution
from traction_model.simulation.drawbar import Drawbar, drawbar_force
from traction_model.simulation.simulate import Trajectory, simulate
from traction_model.slip import MIN_SPEED
from traction_model.soil.soil import Soil, load_soil
from traction_model.soil.terrain import STEEPEST, Terrain
from traction_model.vehicle.vehicle import Vehicle, load_vehicle
from traction_node.closest import closest

Array = NDArray[np.float64]
Row = dict[str, Any]
Loaded = TypeVar('Loaded')

IMMOBILE_SPEED = 0.1
"""Speed below which a vehicle with turning wheels counts as immobilised, m/s."""

IMMOBILE_TIME = 1.0
"""Time at the end of a drive for this condition, s."""

STEEPEST_DEG = math.degrees(STEEPEST)
"""Steepest grade, degrees."""

UNITS = {
    'cohesive_modulus': 'N/m^(n+1)',
    'frictional_modulus': 'N/m^(n+2)',
    'sinkage_exponent': '1',
    'cohesion': 'Pa',
    'friction_angle_deg': 'deg',
    'shear_deformation_modulus': 'm',
    'unit_weight': 'N/m^3',
    'residual_ratio': '1',
    'damping': 'Pa·s/m',
    'elastic_modulus': 'Pa/m',
    'shear_memory': '1',
    'chassis_mass': 'kg',
    'chassis_cg_x': 'm',
    'chassis_cg_height': 'm',
    'hitch_height': 'm',
    'track_width': 'm',
    'drag_area': 'm^2',
    'x': 'm',
    'radius': 'm',
    'width': 'm',
    'inertia': 'kg·m^2',
    'grouser_height': 'm',
    'viscous_friction': 'N·m·s/rad',
    'mass': 'kg',
    'pull': 'N',
    'pull_per_speed': 'N·s/m',
    'ramp': 's',
    'grade_deg': 'deg',
    'initial_speed': 'm/s',
    'torque': '1',
}
"""Units of quantities, by the last part of their names."""

LAW_UNITS = {
    'bernstein': {'frictional_modulus': 'N/m^2.5'},
    'reece': {'cohesive_modulus': '1', 'frictional_modulus': '1'},
}
"""Units of a soil's moduli for pressure-sinkage laws other than Bekker's."""


class Figure(NamedTuple):
    """Figure of a drive: its name, unit and meaning.

    Attributes
    ----------
    unit : str
        Its unit; '1' if dimensionless, '' if it is not a number.
    meaning : str
        Its meaning.
    """

    unit: str
    meaning: str


FIGURES = {
    'slip_mean': Figure('1', 'mean slip over all wheels, where slip is defined'),
    'slip_p95': Figure('1', '95th percentile of slip over all wheels, where slip is defined'),
    'slip_max': Figure('1', 'largest slip of any wheel, where slip is defined'),
    'final_speed': Figure('m/s', 'speed at the end'),
    'distance': Figure('m', 'distance over the whole drive'),
    'sinkage_max': Figure('m', 'deepest sinkage of any wheel'),
    'drawbar_work': Figure('J', 'work done on the implement'),
    'energy_in': Figure('J', 'work of all shafts on the wheels'),
    'tractive_efficiency': Figure('1', 'drawbar_work over energy_in'),
    'immobilised': Figure('', 'wheels turn but the vehicle stands at the end'),
}
"""Figures of a drive; all but final_speed and distance start at the settle time."""


def _several(value: Any) -> Any:
    """List of one for a single value."""
    return value if isinstance(value, list | tuple) else (value,)


Torques = Annotated[tuple[float, ...], BeforeValidator(_several)]
Names = Annotated[tuple[str, ...], BeforeValidator(_several), Field(min_length=1)]


class Ramp(Definition):
    """Torque that changes linearly and is then constant.

    Attributes
    ----------
    to : tuple of float
        Final torque, N·m, one per wheel or one for all.
    over : float
        Duration of the change, s, above 0.
    start : tuple of float
        Initial torque, N·m, one per wheel or one for all.
    """

    to: Torques
    over: float = Field(gt=0)
    start: Torques = (0.0,)


class Step(Definition):
    """Constant torque from a time on.

    Attributes
    ----------
    at : float
        s, at least 0.
    torque : tuple of float
        N·m, one per wheel or one for all.
    """

    at: float = Field(ge=0)
    torque: Torques


class TorqueProfile(Definition):
    """Torque of every wheel over time: exactly one of the attributes is given.

    Attributes
    ----------
    constant : tuple of float, optional
        N·m, forward positive, one per wheel or one for all.
    ramp : Ramp, optional
        Linear change of torque.
    steps : tuple of Step, optional
        Torque that is constant until the next step, the first at 0 s.
    """

    constant: Torques | None = None
    ramp: Ramp | None = None
    steps: tuple[Step, ...] | None = Field(default=None, min_length=1)

    @model_validator(mode='after')
    def _one_kind(self) -> 'TorqueProfile':
        if sum(kind is not None for kind in (self.constant, self.ramp, self.steps)) != 1:
            raise ValueError('give exactly one of constant, ramp, steps')
        if self.steps is not None:
            times = [step.at for step in self.steps]
            if times[0] != 0 or np.any(np.diff(times) <= 0):
                raise ValueError(f'steps: times must start at 0 and increase, got {times}')
        return self

    def samples(self, t: Array, wheels: int) -> Array:
        """Torque at times.

        Parameters
        ----------
        t : ndarray, shape (k,)
            Times, s.
        wheels : int
            Number of wheels.

        Returns
        -------
        ndarray, shape (k, wheels)
            N·m, forward positive.

        Raises
        ------
        ValueError
            If the number of torques does not match that of the wheels.
        """
        if self.constant is not None:
            return np.tile(_per_wheel('constant', self.constant, wheels), (len(t), 1))
        if self.ramp is not None:
            start = _per_wheel('ramp.start', self.ramp.start, wheels)
            rise = _per_wheel('ramp.to', self.ramp.to, wheels) - start
            return start + np.clip(t / self.ramp.over, 0.0, 1.0)[:, None] * rise
        steps = self.steps or ()
        torques = np.array(
            [_per_wheel(f'steps.{k}.torque', s.torque, wheels) for k, s in enumerate(steps)]
        )
        return torques[np.searchsorted([step.at for step in steps], t, side='right') - 1]


def _per_wheel(key: str, torques: tuple[float, ...], wheels: int) -> Array:
    if len(torques) not in (1, wheels):
        raise ValueError(
            f'{key}: expected one torque for all or one for each of the {wheels} wheels, '
            f'got {len(torques)}'
        )
    return np.array(torques if len(torques) == wheels else torques * wheels)


class Draft(Definition):
    """Draft of an implement, as in `traction_model.simulation.drawbar.Drawbar`.

    Attributes
    ----------
    pull : float
        N, at least 0.
    pull_per_speed : float
        N*s/m, at least 0.
    ramp : float
        Time of the rise from zero, s, at least 0.
    """

    pull: float = Field(default=0.0, ge=0)
    pull_per_speed: float = Field(default=0.0, ge=0)
    ramp: float = Field(default=0.0, ge=0)


class SimulatedDrive(Definition):
    """Drive with all quantities that a sweep can vary.

    Attributes
    ----------
    vehicle : Vehicle
        The vehicle, SI units.
    soil : tuple of Soil
        Soils along the path, SI units.
    drawbar : Draft
        Draft of the implement, SI units.
    grade_deg : float
        Slope of the path, degrees, uphill positive, -45 to 45; dimensionless otherwise.
    initial_speed : float
        m/s, forward positive; the wheels roll without slip.
    torque : float
        Torque over nominal torque, dimensionless.
    """

    vehicle: Vehicle
    soil: tuple[Soil, ...]
    drawbar: Draft
    grade_deg: float = Field(ge=-STEEPEST_DEG, le=STEEPEST_DEG)
    initial_speed: float
    torque: float = 1.0


class SweepDefinition(Definition):
    """Definition of a sweep in YAML.

    Attributes
    ----------
    vehicle : str
        Preset or YAML file.
    soil : tuple of str
        Soils along the path: presets or ``file.yaml:name``.
    soil_starts : tuple of float
        Start of each soil after the first, m along the path, increasing.
    drawbar : Draft
        Draft of the implement, SI units.
    grade_deg : float
        Slope in degrees, uphill positive, -45 to 45; dimensionless otherwise.
    initial_speed : float
        m/s, forward positive.
    torque : TorqueProfile
        Nominal torque of every wheel, N·m.
    duration : float
        Length of each drive, s, above 0.
    dt : float
        Time between samples, s, above 0 and at most 0.02.
    settle : float
        Start time of the figures, s, at least 0 and below `duration`.
    draws : int
        Number of drives, at least 1.
    seed : int
        Seed of the draws, at least 0.
    sampling : {'random', 'latin_hypercube', 'sobol'}
        Method for the points in the space of the varied quantities.
    vary : dict of str
        A `Distribution` for each varied quantity, by name.
    """

    vehicle: str
    soil: Names
    soil_starts: tuple[float, ...] = ()
    drawbar: Draft = Draft()
    grade_deg: float = Field(default=0.0, ge=-STEEPEST_DEG, le=STEEPEST_DEG)
    initial_speed: float = 0.0
    torque: TorqueProfile
    duration: float = Field(gt=0)
    dt: float = Field(default=0.01, gt=0, le=0.02)
    settle: float = Field(default=0.0, ge=0)
    draws: int = Field(ge=1)
    seed: int = Field(default=1, ge=0)
    sampling: Literal['random', 'latin_hypercube', 'sobol'] = 'random'
    vary: dict[str, Any] = Field(min_length=1)

    @model_validator(mode='after')
    def _times_and_draws(self) -> 'SweepDefinition':
        if not self.settle < self.duration:
            raise ValueError(
                f'settle: must be below duration, {self.duration:g} s, got {self.settle:g} s'
            )
        power = self.draws.bit_length() - 1
        if self.sampling == 'sobol' and self.draws != 2**power:
            raise ValueError(
                f'draws: sobol sampling needs a power of 2, such as {2**power} or '
                f'{2 ** (power + 1)}, got {self.draws}'
            )
        return self


@dataclass(frozen=True)
class Quantity:
    """Number or whole soil that can be varied.

    Attributes
    ----------
    name : str
        Name in a definition, such as ``soil.cohesion``.
    path : tuple of str and int
        Path in a `SimulatedDrive`.
    unit : str
        Unit of its values; '' for a whole soil, whose values are names.
    nominal : float or str
        Its nominal value in that unit.
    least, most : float
        Range of valid values in that unit; may be infinite.
    scale : float
        SI unit per unit: dimensionless, or rad per degree for angles.
    """

    name: str
    path: tuple[str | int, ...]
    unit: str
    nominal: float | str
    least: float = -math.inf
    most: float = math.inf
    scale: float = 1.0


@dataclass(frozen=True)
class SweepDraw:
    """Draw of a sweep: index and values.

    Attributes
    ----------
    number : int
        Index, from 0.
    values : dict
        Values of the varied quantities, by name, in their units.
    """

    number: int
    values: Mapping[str, float | str]


@dataclass(frozen=True)
class Sweep:
    """Checked sweep; it needs no files and can be sent to other machines.

    Attributes
    ----------
    definition : SweepDefinition
        Definition, SI units.
    nominal : SimulatedDrive
        The nominal drive, SI units.
    soils : dict of str to Soil
        All named soils, SI units.
    varied : dict of Quantity to Distribution
        Distributions of the varied quantities, in their units.
    """

    definition: SweepDefinition
    nominal: SimulatedDrive
    soils: Mapping[str, Soil]
    varied: Mapping[Quantity, Distribution]

    def draws(self) -> list[SweepDraw]:
        """All draws; they depend on the definition alone.

        Returns
        -------
        list of SweepDraw
            One per drive.
        """
        definition = self.definition
        points = _points(definition.sampling, definition.draws, len(self.varied), definition.seed)
        shares = dict(zip(self.varied, points.T, strict=True))
        columns: dict[str, NDArray[Any]] = {}
        # Whole soils first, since other quantities of a soil are relative to them.
        for quantity in sorted(self.varied, key=lambda quantity: quantity.unit != ''):
            columns[quantity.name] = self.varied[quantity].values(
                shares[quantity], self._nominal(quantity, columns), quantity.least, quantity.most
            )
        listed = {quantity.name: columns[quantity.name].tolist() for quantity in self.varied}
        return [
            SweepDraw(k, {name: values[k] for name, values in listed.items()})
            for k in range(definition.draws)
        ]

    def _nominal(self, quantity: Quantity, columns: Mapping[str, NDArray[Any]]) -> Any:
        """Nominal value of a quantity; with drawn soils one per draw."""
        if not quantity.unit:
            return math.nan
        for other in self.varied:
            if not other.unit and other.path == quantity.path[:2]:
                of_soil = {
                    name: getattr(soil, str(quantity.path[2])) / quantity.scale
                    for name, soil in self.soils.items()
                }
                return np.array([of_soil[name] for name in columns[other.name].tolist()])
        return quantity.nominal

    def scenario(self, draw: SweepDraw) -> SimulatedDrive:
        """Drive of a draw.

        Parameters
        ----------
        draw : SweepDraw
            One of `draws`.

        Returns
        -------
        SimulatedDrive
            SI units.

        Raises
        ------
        DefinitionError
            If the values contradict each other; the text has one of them.
        """
        content = self.nominal.model_dump(mode='json')
        for quantity in sorted(self.varied, key=lambda quantity: len(quantity.path)):
            value: Any = draw.values[quantity.name]
            place: Any = content
            for key in quantity.path[:-1]:
                place = place[key]
            if quantity.unit:
                place[quantity.path[-1]] = value * quantity.scale
            else:
                place[quantity.path[-1]] = self.soils[value].model_dump(mode='json')
        return build(SimulatedDrive, content, '')


def read_sweep(path: str | Path, *, draws: int | None = None, seed: int | None = None) -> Sweep:
    """Read the definition of a sweep.

    Parameters
    ----------
    path : str or Path
        YAML file; paths of vehicles and soils are relative to it.
    draws, seed : int, optional
        Values that override those in the file.

    Returns
    -------
    Sweep
        Sweep, SI units.

    Raises
    ------
    DefinitionError
        If it is invalid; the text has file and key.
    """
    path = Path(path)
    content = read_yaml(path)
    for key, value in (('draws', draws), ('seed', seed)):
        if value is not None:
            content[key] = value
    definition = build(SweepDefinition, content, str(path))
    vehicle = _named(load_vehicle, definition.vehicle, path, 'vehicle')
    soils = {name: _named(load_soil, name, path, 'soil') for name in definition.soil}
    nominal = build(
        SimulatedDrive,
        {
            'vehicle': vehicle,
            'soil': tuple(soils[name] for name in definition.soil),
            'drawbar': definition.drawbar,
            'grade_deg': definition.grade_deg,
            'initial_speed': definition.initial_speed,
        },
        str(path),
    )
    _check_nominal(definition, nominal, path)
    known = quantities(nominal, definition.soil)
    varied = {}
    for name, entry in definition.vary.items():
        key = f'vary.{name}'
        if name not in known:
            raise DefinitionError(f'{path}: {key}: {_unknown(name, known)}')
        quantity = known[name]
        if not isinstance(entry, dict):
            raise DefinitionError(
                f'{path}: {key}: expected a distribution such as {{relative: 0.2}}, got {entry!r}'
            )
        distribution = build(Distribution, entry, f'{path}: {key}')
        if not quantity.unit:
            if distribution.choice is None:
                raise DefinitionError(f'{path}: {key}: a whole soil needs choice')
            for soil in distribution.choice:
                soils[str(soil)] = _named(load_soil, str(soil), path, f'{key}.choice')
        varied[quantity] = distribution
    sweep = Sweep(definition, nominal, soils, varied)
    _check_values(sweep, path)
    return sweep


def _check_nominal(definition: SweepDefinition, nominal: SimulatedDrive, path: Path) -> None:
    """Check the numbers of soils and torques."""
    try:
        Terrain(nominal.soil, definition.soil_starts)
    except ValueError as error:
        raise DefinitionError(f'{path}: soil_starts: {error}') from error
    try:
        definition.torque.samples(np.zeros(1), len(nominal.vehicle.wheels))
    except ValueError as error:
        raise DefinitionError(f'{path}: torque.{error}') from error


def _check_values(sweep: Sweep, path: Path) -> None:
    """Check the validity of all possible values, one by one."""
    columns: dict[str, NDArray[Any]] = {}
    for quantity, distribution in sweep.varied.items():
        if not quantity.unit:
            columns[quantity.name] = np.array(distribution.choice, dtype=str)
    for quantity, distribution in sweep.varied.items():
        if quantity.unit:
            nominal = sweep._nominal(quantity, columns)
            try:
                distribution.support(nominal, quantity.least, quantity.most)
            except ValueError as error:
                raise DefinitionError(f'{path}: vary.{quantity.name}: {error}') from error


def _named(load: Callable[[str, Path], Loaded], name: str, path: Path, key: str) -> Loaded:
    """Vehicle or soil by name; paths are relative to the definition."""
    try:
        return load(name, path.parent)
    except DefinitionError as error:
        raise DefinitionError(f'{path}: {key}: {error}') from error


def _unknown(name: str, known: Iterable[str]) -> str:
    """Hint for an unknown name."""
    names = list(known)
    # A name without an index, although there are several.
    numbered = [
        other
        for other in names
        if '.'.join(part for part in other.split('.') if not part.isdigit()) == name
    ]
    if numbered:
        return f'there are several; name one of {", ".join(numbered)}'
    if f'{name}_deg' in names:
        return f"give it in degrees, as '{name}_deg'"
    first, *rest = name.split('.')
    if first == 'soil' and rest and rest[-1] in Soil.model_fields:
        return 'the soil has no such number, so nothing that could vary'
    return f'there is no such quantity{closest(name, names)}'


def quantities(nominal: SimulatedDrive, soil_names: Sequence[str]) -> dict[str, Quantity]:
    """Quantities of a drive that can be varied.

    Entries of a list have indices from 0 if there is more than one, as in
    ``vehicle.axles.1.wheel.radius``.

    Parameters
    ----------
    nominal : SimulatedDrive
        The nominal drive, SI units.
    soil_names : sequence of str
        Names of its soils.

    Returns
    -------
    dict of str to Quantity
        Quantities by name.
    """
    found = list(_leaves(nominal, '', ()))
    for k, name in enumerate(soil_names):
        found.append(
            Quantity('soil' if len(soil_names) == 1 else f'soil.{k}', ('soil', k), '', name)
        )
    return {quantity.name: quantity for quantity in found}


def _leaves(thing: BaseModel, prefix: str, path: tuple[str | int, ...]) -> Iterator[Quantity]:
    units = UNITS | LAW_UNITS.get(getattr(thing, 'pressure_law', ''), {})
    for key, field in type(thing).model_fields.items():
        if key == 'traction_curve':
            # For the empirical form, which sweeps do not use.
            continue
        value = getattr(thing, key)
        inside = (*path, key)
        if isinstance(value, BaseModel):
            yield from _leaves(value, f'{prefix}{key}.', inside)
        elif isinstance(value, tuple):
            for k, entry in enumerate(value):
                if isinstance(entry, BaseModel):
                    number = f'.{k}' if len(value) > 1 else ''
                    yield from _leaves(entry, f'{prefix}{key}{number}.', (*inside, k))
        elif isinstance(value, float):
            # Angles are in rad internally, in degrees in files.
            degrees = key.endswith('_angle')
            name, scale = (f'{key}_deg', math.radians(1.0)) if degrees else (key, 1.0)
            limits = {
                bound: getattr(limit, bound) / scale
                for limit in field.metadata
                for bound in ('ge', 'gt', 'le', 'lt')
                if hasattr(limit, bound)
            }
            yield Quantity(
                f'{prefix}{name}',
                inside,
                units.get(name, '?'),
                value / scale,
                limits.get('ge', limits.get('gt', -math.inf)),
                limits.get('le', limits.get('lt', math.inf)),
                scale,
            )


def _points(sampling: str, draws: int, dimensions: int, seed: int) -> Array:
    """Points in the unit cube, shape (draws, dimensions)."""
    generator = np.random.default_rng(seed)
    if sampling == 'random':
        # By rows, so that a larger number of draws keeps the first ones.
        return generator.random((draws, dimensions))
    if sampling == 'latin_hypercube':
        return np.asarray(qmc.LatinHypercube(dimensions, rng=generator).random(draws))
    return np.asarray(qmc.Sobol(dimensions, rng=generator).random(draws))


def simulate_draws(sweep: Sweep, draws: Sequence[SweepDraw]) -> list[Row]:
    """Simulate some draws of a sweep (one piece of work of a process).

    Parameters
    ----------
    sweep : Sweep
        The sweep.
    draws : sequence of SweepDraw
        Some of its draws.

    Returns
    -------
    list of dict
        One row per draw: index ``draw``, varied quantities and `FIGURES` in their units, and
        ``error``, '' without failure; figures of a failed drive are None.
    """
    rows = []
    for draw in draws:
        row: Row = {'draw': draw.number, **draw.values}
        try:
            row |= _drive(sweep, draw)
            row['error'] = ''
        except ValueError as error:
            row |= dict.fromkeys(FIGURES) | {'error': str(error)}
        except Exception as error:
            # One failed draw must not end the sweep.
            row |= dict.fromkeys(FIGURES) | {'error': f'{type(error).__name__}: {error}'}
        rows.append(row)
    return rows


def _drive(sweep: Sweep, draw: SweepDraw) -> Row:
    """Simulate one draw."""
    definition = sweep.definition
    scenario = sweep.scenario(draw)
    steps = max(1, math.ceil(definition.duration / definition.dt - 1e-9))
    t = definition.dt * np.arange(steps + 1.0)
    torque = scenario.torque * definition.torque.samples(t, len(scenario.vehicle.wheels))
    trajectory = simulate(
        scenario.vehicle,
        Terrain(scenario.soil, definition.soil_starts, math.radians(scenario.grade_deg)),
        torque,
        definition.dt,
        drawbar=Drawbar(**scenario.drawbar.model_dump()),
        v0=scenario.initial_speed,
    )
    return figures(trajectory, torque, scenario, definition.settle)


def figures(trajectory: Trajectory, torque: Array, scenario: SimulatedDrive, settle: float) -> Row:
    """Figures of one drive.

    Parameters
    ----------
    trajectory : Trajectory
        Its motion, SI units.
    torque : ndarray, shape (k, n)
        Torque on every wheel at every sample, N·m.
    scenario : SimulatedDrive
        The drive, SI units.
    settle : float
        Start time of the figures, s.

    Returns
    -------
    dict
        A value for each of `FIGURES`, in its unit. Slip is None if it is never valid (see
        `traction_model.slip`), tractive efficiency without input energy.

    Raises
    ------
    ArithmeticError
        If the motion is not finite.
    """
    t, v = trajectory.t, trajectory.v
    if not (np.all(np.isfinite(v)) and np.all(np.isfinite(trajectory.omega))):
        raise ArithmeticError('the motion is not finite')
    # Tolerance of half a step, since times are sums.
    first = int(np.searchsorted(t, settle - (t[1] - t[0]) / 2))
    judged = slice(min(first, len(t) - 2), None)
    radii = np.array([wheel.radius for wheel in scenario.vehicle.wheels])
    rim = np.abs(radii * trajectory.omega)
    valid = np.maximum(np.abs(v)[:, None], rim) >= MIN_SPEED
    slip = trajectory.slip[judged][valid[judged]]

    draft = scenario.drawbar
    of_draft = (draft.pull, draft.pull_per_speed, draft.ramp)
    pull = np.array([drawbar_force(*now, *of_draft) for now in zip(t, v, strict=True)])
    work = float(np.trapezoid((pull * v)[judged], t[judged]))
    power = (torque * trajectory.omega).sum(axis=1)
    energy = float(np.trapezoid(power[judged], t[judged]))
    end = t >= t[-1] - IMMOBILE_TIME
    stuck = (v < IMMOBILE_SPEED) & (rim.max(axis=1) > MIN_SPEED)
    return {
        'slip_mean': float(slip.mean()) if slip.size else None,
        'slip_p95': float(np.percentile(slip, 95)) if slip.size else None,
        'slip_max': float(slip.max()) if slip.size else None,
        'final_speed': float(v[-1]),
        'distance': float(trajectory.x[-1] - trajectory.x[0]),
        'sinkage_max': float(trajectory.sinkage[judged].max()),
        'drawbar_work': work,
        'energy_in': energy,
        'tractive_efficiency': work / energy if energy > 0 else None,
        'immobilised': bool(stuck[end].all()),
    }
