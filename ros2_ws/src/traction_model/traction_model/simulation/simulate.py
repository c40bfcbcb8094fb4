"""Motion of an n-wheel vehicle on soft soil, integrated with Runge-Kutta 4.

Per wheel and for the vehicle (Agriculture 2024, 14(3), 499, equations (29) and (31), made
dimensionally consistent):

    m*v'      = sum_j (F_j - R_j) - drawbar - m*g*sin(grade) - air drag
    J*omega'  = T - b_f*omega - M
    m_j*z''   = W_j - N_j

with m_j the mass that the wheel carries at rest and W_j its load after longitudinal load
transfer.
"""

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_model.contact.contact import (
    FREE,
    MIN_TRANSIT_SPEED,
    UNTOUCHED,
    Form,
    check_form,
    forces_at,
    sinkage_at,
)
from traction_model.kernel import inlined, lean_kernel
from traction_model.slip import MIN_SPEED, is_valid, slip, slips
from traction_model.soil.empirical import curve_ratios
from traction_model.soil.rut import Ruts, fresh_ruts, press_rut
from traction_model.soil.soil import (
    COHESION,
    CURVE,
    DAMPING,
    HUMP,
    RESIDUAL,
    SHEAR_LAW,
    SHEAR_MODULUS,
    TAN_PHI,
    Soil,
)
from traction_model.soil.terrain import Terrain, soil_row
from traction_model.vehicle.vehicle import AIR_DENSITY, GRAVITY, Vehicle
from traction_model.vehicle.wheel import (
    FRICTION,
    INERTIA,
    POSITION,
    RADIUS,
    STATIC_LOAD,
    TRACK,
    WIDTH,
)

Array = NDArray[np.float64]

# How sinkage is found, as the kernels are told.
SINKAGE_MODES = {'dynamic': 0, 'equilibrium': 1, 'given': 2}

SMOOTHED = 0.05
"""Over which time given sinkage is differentiated, s."""

# The state: speed, distance, then wheel speed, sinkage and sinkage rate of every wheel.
SPEED, DISTANCE, FIRST_WHEEL = range(3)


@dataclass(frozen=True)
class Drawbar:
    """Draft of an implement: resists motion, grows with speed.

    Attributes
    ----------
    pull : float
        N, at least 0.
    pull_per_speed : float
        N*s/m, at least 0.
    ramp : float
        Time over which it builds up from zero, s, at least 0.
    """

    pull: float = 0.0
    pull_per_speed: float = 0.0
    ramp: float = 0.0

    def __post_init__(self) -> None:
        for name in ('pull', 'pull_per_speed', 'ramp'):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f'drawbar {name} must be finite and at least 0, got {value}')


class Model(NamedTuple):
    """All that stays constant over a run, packed for the kernels; n wheels, k soils.

    Attributes
    ----------
    form : int
        A `Form`.
    mode : int
        An entry of `SINKAGE_MODES`.
    wheels : ndarray, shape (n, 7)
        Packed wheels, SI units.
    spread : ndarray, shape (n, 2)
        Load of a wheel, N, per N of total load and per N*m of its moment.
    soils : ndarray, shape (n, k, 17)
        Packed soils as each wheel meets them, SI units.
    starts : ndarray, shape (k,)
        Where each soil begins, m, the first minus infinity.
    grades : ndarray, shape (k,)
        Slope from there on, rad, uphill positive.
    mass, cg_x, cg_height, hitch_height : float
        kg, m, m, m.
    drag : float
        Air drag per square of speed, N*s^2/m^2.
    pull, pull_per_speed, pull_ramp : float
        The drawbar's, N, N*s/m, s.
    shear_step : float
        See `traction_model.contact.contact.one_way`, s.
    """

    form: int
    mode: int
    wheels: Array
    spread: Array
    soils: Array
    starts: Array
    grades: Array
    mass: float
    cg_x: float
    cg_height: float
    hitch_height: float
    drag: float
    pull: float
    pull_per_speed: float
    pull_ramp: float
    shear_step: float


@inlined
def drawbar_force(t, v, pull, pull_per_speed, ramp):
    """Draft at a time and speed.

    Parameters
    ----------
    t : float
        Time since the start, s.
    v : float
        Speed, m/s.
    pull, pull_per_speed, ramp : float
        Those of a `Drawbar`, N, N*s/m, s.

    Returns
    -------
    float
        N, backward positive; fades out at standstill, as an implement does not push.
    """
    share = min(1.0, t / ramp) if ramp > 0.0 else 1.0
    direction = max(-1.0, min(1.0, v / MIN_TRANSIT_SPEED))
    return direction * share * (pull + pull_per_speed * abs(v))


@inlined
def derivative(t, y, torque, given, row, share, model, ruts, forces, slope, n, form, mode):
    """Rate of change of the state, and the forces that cause it.

    Parameters
    ----------
    t : float
        Time, s.
    y : ndarray, shape (2 + 3n,)
        Speed m/s, distance m, wheel speeds rad/s, sinkages m, sinkage rates m/s.
    torque : ndarray, shape (k, n)
        Samples of drive torque, N*m, forward positive.
    given : ndarray, shape (k, 3, n)
        Samples of sinkage, m, its rate, m/s, and its acceleration, m/s^2, downward positive;
        read in mode 'given' only, and used where the sinkage is positive.
    row : int
        The sample before `t`, at most k - 2.
    share : float
        How far `t` is on the way to the next sample, 0 to 1, dimensionless.
    model : Model
        What does not change, SI units.
    ruts : Ruts
        What wheels have left so far.
    forces : ndarray, shape (n, 7)
        In: the loads, N, in column 0, as a first guess, and sinkages, m, in column 4. Out: load
        on the wheel W, thrust F, resistance R, moment M, N*m, sinkage z, m, the soil's upward
        force N, N, and the shear displacement of the soil as it is left, m.
    slope : ndarray, shape (2 + 3n,)
        Out: rate of change of `y` in SI units per second.
    n, form, mode : int
        Number of wheels, `Form`, and entry of `SINKAGE_MODES`: the model's, on their own so that
        they may be known when a run is compiled.
    """
    mass = model.mass
    wheels = model.wheels
    v = y[SPEED]
    pull = drawbar_force(t, v, model.pull, model.pull_per_speed, model.pull_ramp)
    drag = model.drag * v * abs(v)
    grade = model.grades[soil_row(y[DISTANCE], model.starts)]
    weight = mass * GRAVITY
    climb = 0.0
    if grade != 0.0:
        climb = weight * math.sin(grade)
        weight *= math.cos(grade)
    # Where sinkage follows from load, or load is imposed, load transfer and contact are found
    # in turn; the transfer is a small part of the load, so each turn gains more than a digit.
    for _ in range(1 if mode == 0 else 4):
        net = 0.0
        transfer = 0.0
        for j in range(n):
            omega = y[FIRST_WHEEL + j]
            radius, width = wheels[j, RADIUS], wheels[j, WIDTH]
            x = y[DISTANCE] + wheels[j, POSITION]
            track = int(wheels[j, TRACK])
            z_rate = 0.0
            imposed = FREE
            if mode == 0:
                z = y[FIRST_WHEEL + n + j]
                z_rate = y[FIRST_WHEEL + 2 * n + j]
            else:
                z = 0.0
                if mode == 2:
                    z = given[row, 0, j] + share * (given[row + 1, 0, j] - given[row, 0, j])
                if z > 0.0:
                    z_rate = given[row, 1, j] + share * (given[row + 1, 1, j] - given[row, 1, j])
                    rising = given[row, 2, j] + share * (given[row + 1, 2, j] - given[row, 2, j])
                    carried = wheels[j, STATIC_LOAD] / GRAVITY
                    imposed = max(0.0, forces[j, 0] - carried * rising)
                else:
                    z = sinkage_at(
                        form, v, omega, forces[j, 0], x, model.soils[j], model.starts, radius,
                        width, track, ruts, forces[j, 4],
                    )  # fmt: skip
            load, thrust, resistance, moment, sheared = forces_at(
                form, v, omega, z, z_rate, x, model.soils[j], model.starts, radius, width, track,
                ruts, imposed, model.shear_step,
            )  # fmt: skip
            forces[j, 1] = thrust
            forces[j, 2] = resistance
            forces[j, 3] = moment
            forces[j, 4] = z
            forces[j, 5] = load
            forces[j, 6] = sheared
            drive = torque[row, j] + share * (torque[row + 1, j] - torque[row, j])
            drive -= wheels[j, FRICTION] * omega
            slope[FIRST_WHEEL + j] = (drive - moment) / wheels[j, INERTIA]
            net += thrust - resistance
            transfer += drive - radius * (thrust - resistance)
        acceleration = (net - pull - climb - drag) / mass
        # Moment of the loads about the rear axle's ground contact, nose-up positive.
        turn = model.cg_x * weight - model.hitch_height * pull - transfer
        turn -= model.cg_height * (mass * acceleration + climb + drag)
        moved = 0.0
        for j in range(n):
            load = max(0.0, model.spread[j, 0] * weight + model.spread[j, 1] * turn)
            moved = max(moved, abs(load - forces[j, 0]))
            forces[j, 0] = load
        if moved < 1e-9 * weight:
            break
    slope[SPEED] = acceleration
    slope[DISTANCE] = v
    for j in range(n):
        rise = 0.0
        if mode == 0:
            rise = (forces[j, 0] - forces[j, 5]) * GRAVITY / wheels[j, STATIC_LOAD]
        slope[FIRST_WHEEL + n + j] = y[FIRST_WHEEL + 2 * n + j] if mode == 0 else 0.0
        slope[FIRST_WHEEL + 2 * n + j] = rise


@inlined
def steps_for(dt, y, model, forces, n, form, mode):
    """Steps of Runge-Kutta 4 that a time takes: near standstill forces answer very quickly.

    The fastest rate is that of slip, ``C*(1/m + r^2/J)/(r*omega)`` (see
    `traction_model.lpv.model`), with the slip stiffness C at most ``(c*A + N*tan(phi))*l/K``, more
    with a hump; or that of sinkage, which soil resists by its damping D and, in the arc, by the
    contact that it gains behind the wheel.

    Parameters
    ----------
    dt : float
        Time to advance, s.
    y : ndarray, shape (2 + 3n,)
        State in SI units, see `derivative`.
    model : Model
        What does not change, SI units.
    forces : ndarray, shape (n, 7)
        Sinkages, m, and upward forces, N, in columns 4 and 5, see `derivative`.
    n, form, mode : int
        See `derivative`; number of wheels.

    Returns
    -------
    int
        Number of steps, at least 1.
    """
    wheels = model.wheels
    v = y[SPEED]
    shared = 0.0
    fastest = 0.0
    for j in range(n):
        soil = model.soils[j, soil_row(y[DISTANCE] + wheels[j, POSITION], model.starts)]
        radius = wheels[j, RADIUS]
        length = math.sqrt(2.0 * radius * min(max(forces[j, 4], 0.0), radius))
        strength = soil[COHESION] * wheels[j, WIDTH] * length + forces[j, 5] * soil[TAN_PHI]
        speed = max(abs(v), radius * abs(y[FIRST_WHEEL + j]), MIN_TRANSIT_SPEED)
        stiffness = strength * length / (soil[SHEAR_MODULUS] * speed)
        # Laws with a hump rise more steeply than Janosi and Hanamoto's, of slope 1.
        if soil[SHEAR_LAW] > 0.0:
            steepness = math.e if soil[SHEAR_LAW] == 1.0 else 1.0
            stiffness *= max(1.0, soil[RESIDUAL] * (1.0 + soil[HUMP] * steepness))
        elif form == 1:
            # The mean of 1 - exp(-j/K) over the contact rises by a half of j/K at most.
            stiffness /= 2.0
        if form == 3:
            rise = curve_ratios(soil[CURVE:], 1e-3)[0] - curve_ratios(soil[CURVE:], 0.0)[0]
            stiffness = forces[j, 5] * rise / 1e-3 / speed
        shared += stiffness / model.mass
        fastest = max(fastest, stiffness * radius * radius / wheels[j, INERTIA])
        if mode == 0:
            damping = soil[DAMPING] * wheels[j, WIDTH] * length
            if form == 2 and length > 0.0:
                transit = max(abs(v), MIN_TRANSIT_SPEED)
                damping += forces[j, 5] / (transit * length / radius)
            fastest = max(fastest, damping * GRAVITY / wheels[j, STATIC_LOAD])
    # Stable up to 2.8; C is mostly half of its bound.
    if dt * (fastest + shared) <= 2.5:
        return 1
    return int(math.ceil(dt * (fastest + shared) / 2.5))  # noqa: RUF046


@inlined
def advance(t, dt, y, torque, given, row, model, ruts, forces, work, n, form, mode):
    """Advance the state from one sample to the next by Runge-Kutta 4, and leave ruts.

    Parameters
    ----------
    t, dt : float
        Time at the start and how far to advance, s.
    y : ndarray, shape (2 + 3n,)
        State in SI units, see `derivative`; changed in place.
    torque, given, row, model, forces
        See `derivative`; SI units. Torque and given sinkage are linear between samples.
    ruts : Ruts
        What wheels have left so far; changed in place.
    work : ndarray, shape (3, 2 + 3n)
        In: the derivative at the start in its first row, SI units per second.
    n, form, mode : int
        See `derivative`; number of wheels.
    """
    slope, total, trial = work[0], work[1], work[2]
    wheels = model.wheels
    steps = steps_for(dt, y, model, forces, n, form, mode)
    h, per_step = dt, 1.0
    if steps > 1:
        h, per_step = dt / steps, 1.0 / steps
    for k in range(steps):
        x = y[DISTANCE]
        for stage in range(4):
            ahead = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
            if stage == 0:
                for i in range(2 + 3 * n):
                    trial[i] = y[i]
            if k > 0 or stage > 0:
                derivative(
                    t + (k + ahead) * h, trial, torque, given, row, (k + ahead) * per_step, model,
                    ruts, forces, slope, n, form, mode,
                )  # fmt: skip
            if stage == 0:
                for i in range(2 + 3 * n):
                    total[i] = slope[i]
                    trial[i] = y[i] + 0.5 * h * slope[i]
            elif stage < 3:
                # To the middle once more, then to the end.
                reach = 0.5 * h if stage == 1 else h
                for i in range(2 + 3 * n):
                    total[i] += 2.0 * slope[i]
                    trial[i] = y[i] + reach * slope[i]
        for i in range(2 + 3 * n):
            y[i] += h / 6.0 * (total[i] + slope[i])
        # The other forms take all soil for fresh.
        for j in range(n if form == 2 else 0):
            place = wheels[j, POSITION]
            press_rut(
                x + place, y[DISTANCE] + place, forces[j, 4], forces[j, 6], wheels[j, WIDTH],
                int(wheels[j, TRACK]), ruts,
            )  # fmt: skip


@inlined
def integrate(
    t0, dt, y, torque, given, model, ruts, forces, work, every, states, logged, n, form, mode
):
    """Integrate a run through all samples of torque.

    Parameters
    ----------
    t0, dt : float
        Time of the first sample and between samples, s.
    y : ndarray, shape (2 + 3n,)
        State at the start in SI units, see `derivative`; changed in place to that at the end.
    torque, given, model, ruts, forces
        See `derivative`; SI units.
    work : ndarray, shape (3, 2 + 3n)
        Room to work in, SI units.
    every : int
        Of how many samples one is kept, at least 1.
    states : ndarray, shape (m, 2 + 3n)
        Out: states at the samples kept, SI units.
    logged : ndarray, shape (m, n, 7)
        Out: forces at the samples kept, SI units.
    n, form, mode : int
        See `derivative`; number of wheels.
    """
    last = torque.shape[0] - 1
    for k in range(last + 1):
        row = min(k, last - 1)
        derivative(
            t0 + k * dt, y, torque, given, row, float(k - row), model, ruts, forces, work[0], n,
            form, mode,
        )  # fmt: skip
        if k % every == 0:
            kept = k // every
            for i in range(2 + 3 * n):
                states[kept, i] = y[i]
            for j in range(n):
                for i in range(7):
                    logged[kept, j, i] = forces[j, i]
        if k < last:
            advance(
                t0 + k * dt, dt, y, torque, given, row, model, ruts, forces, work, n, form, mode
            )


@lean_kernel
def _run(t0, dt, y, torque, given, model, ruts, forces, work, states, logged):
    n, form, mode = model.wheels.shape[0], model.form, model.mode
    if n == 1 and form == 1 and mode == 0:
        # What is known when it is compiled leaves loops and branches out: a fifth of the time.
        integrate(t0, dt, y, torque, given, model, ruts, forces, work, 1, states, logged, 1, 1, 0)
    else:
        integrate(
            t0, dt, y, torque, given, model, ruts, forces, work, 1, states, logged, n, form, mode
        )


@lean_kernel
def _begin(y, torque, given, model, ruts, forces, work):
    derivative(
        0.0, y, torque, given, 0, 0.0, model, ruts, forces, work[0], model.wheels.shape[0],
        model.form, model.mode,
    )  # fmt: skip


@lean_kernel
def _drive(
    t, dt, steps, y, command, shaft, keep, max_power, torque, given, model, ruts, forces, work
):
    """Advance a plant by steps of a duration, its torque lagging and limited in power."""
    n = command.size
    for k in range(steps):
        power = 0.0
        for j in range(n):
            power += max(0.0, command[j] * y[FIRST_WHEEL + j])
        allowed = min(1.0, max_power / power) if power > 0.0 else 1.0
        for j in range(n):
            target = allowed * command[j]
            torque[0, j] = shaft[j] if keep > 0.0 else target
            shaft[j] = target + (torque[0, j] - target) * keep
            torque[1, j] = shaft[j]
        derivative(
            t + k * dt, y, torque, given, 0, 0.0, model, ruts, forces, work[0],
            model.wheels.shape[0], model.form, model.mode,
        )  # fmt: skip
        advance(
            t + k * dt, dt, y, torque, given, 0, model, ruts, forces, work,
            model.wheels.shape[0], model.form, model.mode,
        )  # fmt: skip


@dataclass(frozen=True)
class Trajectory:
    """A simulated motion; k samples, n wheels.

    Attributes
    ----------
    t : ndarray, shape (k,)
        Time, s.
    v : ndarray, shape (k,)
        Speed, m/s, forward positive.
    x : ndarray, shape (k,)
        Distance along the path, m.
    omega : ndarray, shape (k, n)
        Wheel speeds, rad/s, forward positive.
    slip : ndarray, shape (k, n)
        Slip, -1 to 1; see `traction_model.slip.slip`.
    sinkage : ndarray, shape (k, n)
        m, downward positive.
    load : ndarray, shape (k, n)
        Load on the wheel after load transfer, N.
    thrust : ndarray, shape (k, n)
        F, N, forward positive.
    resistance : ndarray, shape (k, n)
        R, N, positive against forward motion.
    moment : ndarray, shape (k, n)
        M, N*m, the soil's resistance to the wheel's rotation.
    """

    t: Array
    v: Array
    x: Array
    omega: Array
    slip: Array
    sinkage: Array
    load: Array
    thrust: Array
    resistance: Array
    moment: Array


class Plant:
    """A vehicle on terrain, advanced step by step.

    Parameters
    ----------
    vehicle : Vehicle
        What drives.
    terrain : Terrain or Soil
        What it drives on.
    form : Form
        Form of the contact model.
    sinkage : {'dynamic', 'equilibrium'}
        Sinkage as a state, or from vertical equilibrium at every instant.
    drawbar : Drawbar
        Draft of the implement, N.
    multipass : bool
        Whether wheels meet the ruts of those before them, or fresh soil.
    torque_time_constant : float
        First-order lag between commanded and shaft torque, s, at least 0.
    max_power : float
        Power of the engine, W, above 0: where the wheels ask for more, all their torques are
        reduced alike.
    step_size : float
        Longest integration step, s, above 0.
    v0 : float
        Speed at the start, m/s; the wheels roll without slip.

    Raises
    ------
    ValueError
        Naming the parameter that is out of range.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        terrain: Terrain | Soil,
        *,
        form: Form = Form.CONTACT,
        sinkage: Literal['dynamic', 'equilibrium'] = 'dynamic',
        drawbar: Drawbar = Drawbar(),
        multipass: bool = True,
        torque_time_constant: float = 0.0,
        max_power: float = math.inf,
        step_size: float = 1e-3,
        v0: float = 0.0,
    ) -> None:
        if sinkage not in ('dynamic', 'equilibrium'):
            raise ValueError(f"sinkage must be 'dynamic' or 'equilibrium', got {sinkage!r}")
        if not (math.isfinite(torque_time_constant) and torque_time_constant >= 0):
            raise ValueError(
                f'torque_time_constant must be at least 0 s, got {torque_time_constant}'
            )
        if not max_power > 0:
            raise ValueError(f'max_power must be above 0 W, got {max_power}')
        if not 0 < step_size <= 0.01:
            raise ValueError(f'step_size must be above 0 and at most 0.01 s, got {step_size}')
        if not math.isfinite(v0):
            raise ValueError(f'v0 must be finite, got {v0} m/s')
        self.vehicle = vehicle
        self.torque_time_constant = torque_time_constant
        self.max_power = max_power
        self.step_size = step_size
        self._radii = np.array([wheel.radius for wheel in vehicle.wheels])
        self._form = form
        self._sinkage: Literal['dynamic', 'equilibrium'] = sinkage
        self._multipass = multipass
        self._terrain = _terrain(terrain)
        self._drawbar = drawbar
        self._pack()
        self._ruts = _fresh_ruts(vehicle)
        self.t = 0.0
        self.state = initial_state(vehicle, terrain, form)
        self.state[SPEED] = v0
        self.state[FIRST_WHEEL : FIRST_WHEEL + self.n_wheels] = v0 / self._radii
        self.shaft_torque = np.zeros(self.n_wheels)
        self.forces = np.zeros((self.n_wheels, 7))
        self.forces[:, 0] = vehicle.static_loads()
        # Room for the kernels: torque at the start and end of a step, no given sinkage, slopes.
        self._torque = np.zeros((2, self.n_wheels))
        self._not_given = np.zeros((2, 3, self.n_wheels))
        self._work = np.zeros((3, self.state.size))
        _begin(
            self.state, self._torque, self._not_given, self._model, self._ruts, self.forces,
            self._work,
        )  # fmt: skip

    def _pack(self) -> None:
        self._model = pack(
            self.vehicle, self._terrain, self._form, self._sinkage, self._drawbar, self._multipass
        )

    @property
    def terrain(self) -> Terrain:
        """What it drives on; may be changed on the way, SI units. Ruts stay."""
        return self._terrain

    @terrain.setter
    def terrain(self, terrain: Terrain | Soil) -> None:
        self._terrain = _terrain(terrain)
        self._pack()

    @property
    def drawbar(self) -> Drawbar:
        """Draft of the implement, N; may be changed on the way. Its ramp counts from t = 0."""
        return self._drawbar

    @drawbar.setter
    def drawbar(self, drawbar: Drawbar) -> None:
        self._drawbar = drawbar
        self._pack()

    @property
    def n_wheels(self) -> int:
        """Number of wheels, dimensionless."""
        return len(self._radii)

    @property
    def v(self) -> float:
        """Speed, m/s, forward positive."""
        return float(self.state[SPEED])

    @property
    def x(self) -> float:
        """Distance along the path, m."""
        return float(self.state[DISTANCE])

    @property
    def omega(self) -> Array:
        """Wheel speeds, rad/s, forward positive, shape (n,)."""
        return np.asarray(self.state[FIRST_WHEEL : FIRST_WHEEL + self.n_wheels])

    @property
    def rim_speed(self) -> Array:
        """r*omega of every wheel, m/s, forward positive, shape (n,)."""
        return np.asarray(self._radii * self.omega)

    @property
    def slip(self) -> list[float]:
        """Slip of every wheel, -1 to 1, n entries."""
        return [slip(self.v, float(rim)) for rim in self.rim_speed]

    @property
    def slip_valid(self) -> list[bool]:
        """Whether each wheel's slip means anything, n entries."""
        return [is_valid(self.v, float(rim), MIN_SPEED) for rim in self.rim_speed]

    @property
    def sinkage(self) -> Array:
        """Sinkage of every wheel, m, downward positive, shape (n,)."""
        return self.forces[:, 4]

    @property
    def thrust(self) -> Array:
        """Thrust F of every wheel, N, forward positive, shape (n,)."""
        return self.forces[:, 1]

    @property
    def max_shear_stress(self) -> list[float]:
        """c + (N/A)*tan(phi) over the contact arc of every wheel, Pa, n entries."""
        stresses = []
        for j, wheel in enumerate(self.vehicle.wheels):
            row = soil_row(self.x + self.vehicle.wheel_positions[j], self._terrain.starts)
            soil = self._terrain.soil(row, self.vehicle.tracks[j])
            depth = min(max(float(self.forces[j, 4]), 1e-3), wheel.radius)
            area = wheel.width * wheel.contact_length(depth)
            stresses.append(soil.max_shear_stress(float(self.forces[j, 5]) / area))
        return stresses

    @property
    def shear_deformation_modulus(self) -> list[float]:
        """K of the soil under every wheel, m, n entries."""
        return [
            self._terrain.soil(
                soil_row(self.x + x, self._terrain.starts), track
            ).shear_deformation_modulus
            for x, track in zip(self.vehicle.wheel_positions, self.vehicle.tracks, strict=True)
        ]

    @property
    def gross_traction(self) -> Array:
        """Moment of the soil over the radius of every wheel, N, forward positive, shape (n,)."""
        radii = np.array([wheel.radius for wheel in self.vehicle.wheels])
        return np.asarray(self.forces[:, 3] / radii)

    @property
    def external_resistance(self) -> float:
        """Gross traction less what accelerates the vehicle, N: soil, drawbar, grade and air."""
        grade = self._model.grades[soil_row(self.x, self._model.starts)]
        climb = self._model.mass * GRAVITY * math.sin(grade)
        drag = self._model.drag * self.v * abs(self.v)
        model = self._model
        pull = drawbar_force(self.t, self.v, model.pull, model.pull_per_speed, model.pull_ramp)
        net_traction = self.forces[:, 1].sum() - self.forces[:, 2].sum()
        return float(self.gross_traction.sum() - net_traction + pull + climb + drag)

    def step(self, torque: ArrayLike, duration: float) -> None:
        """Advance by a duration under constant commanded torque.

        Parameters
        ----------
        torque : array_like, shape (n,)
            Commanded torque, N*m, forward positive.
        duration : float
            s, above 0.

        Raises
        ------
        ValueError
            If a torque is not finite, their number is not the number of wheels, or the
            duration is not above 0.
        """
        if not (math.isfinite(duration) and duration > 0):
            raise ValueError(f'duration must be above 0 s, got {duration}')
        command = np.asarray(torque, dtype=float)
        if command.shape != (self.n_wheels,) or not np.all(np.isfinite(command)):
            raise ValueError(f'torque must be {self.n_wheels} finite numbers, got {torque!r}')
        steps = max(1, math.ceil(duration / self.step_size - 1e-9))
        dt = duration / steps
        keep = math.exp(-dt / self.torque_time_constant) if self.torque_time_constant else 0.0
        state, shaft = self.state.copy(), self.shaft_torque.copy()
        _drive(
            self.t, dt, steps, state, command, shaft, keep, self.max_power, self._torque,
            self._not_given, self._model, self._ruts, self.forces, self._work,
        )  # fmt: skip
        self.state, self.shaft_torque = state, shaft
        self.t += steps * dt


def initial_state(vehicle: Vehicle, terrain: Terrain | Soil, form: Form = Form.CONTACT) -> Array:
    """Return the state of a vehicle at rest at the start of its path.

    Parameters
    ----------
    vehicle : Vehicle
        What stands there.
    terrain : Terrain or Soil
        What it stands on.
    form : Form
        Form of the contact model.

    Returns
    -------
    ndarray, shape (2 + 3n,)
        State as `derivative` takes it, SI units.
    """
    terrain = _terrain(terrain)
    n = len(vehicle.wheels)
    state = np.zeros(FIRST_WHEEL + 3 * n)
    places = zip(
        vehicle.wheels, vehicle.wheel_positions, vehicle.static_loads(), vehicle.tracks,
        strict=True,
    )  # fmt: skip
    for j, (wheel, x, load, track) in enumerate(places):
        state[FIRST_WHEEL + n + j] = sinkage_at(
            int(form), 0.0, 0.0, load, x, terrain.packed(wheel, track), terrain.starts,
            wheel.radius, wheel.width, -1, UNTOUCHED, 0.0,
        )  # fmt: skip
    return state


def simulate(
    vehicle: Vehicle,
    terrain: Terrain | Soil,
    torque: ArrayLike,
    dt: float,
    *,
    form: Form = Form.CONTACT,
    sinkage: Literal['dynamic', 'equilibrium'] | ArrayLike = 'dynamic',
    drawbar: Drawbar = Drawbar(),
    multipass: bool = True,
    shear_step: float = 0.0,
    t0: float = 0.0,
    x0: float = 0.0,
    v0: float = 0.0,
    omega0: ArrayLike | None = None,
    sinkage0: ArrayLike | None = None,
    sinkage_rate0: ArrayLike | None = None,
) -> Trajectory:
    """Simulate a vehicle under recorded torque.

    Parameters
    ----------
    vehicle : Vehicle
        What drives.
    terrain : Terrain or Soil
        What it drives on.
    torque : array_like, shape (k, n)
        Torque on every wheel at every sample, N*m; linear in between.
    dt : float
        Time between samples and longest step of integration, s, above 0 and at most 0.02.
    form : Form
        Form of the contact model.
    sinkage : {'dynamic', 'equilibrium'} or array_like, shape (k, n)
        Sinkage as a state, from vertical equilibrium, or given, m (from equilibrium where
        it is not positive). With given sinkage the soil carries the vehicle's weight, as it is
        spread over the wheels, less what the acceleration of sinkage takes of it.
    drawbar : Drawbar
        Draft, N.
    multipass : bool
        Whether wheels meet the ruts of those before them, or fresh soil.
    shear_step : float
        Time of shearing, s, at least 0, that soil has behind it as soon as it is touched: 0
        but where a simulation that takes steps is to be reproduced, as it counts shear by
        whole steps.
    t0 : float
        Time of the first sample, s.
    x0 : float
        Place of the rear axle at `t0`, m along the path.
    v0 : float
        Speed at `t0`, m/s.
    omega0 : array_like, shape (n,), optional
        Wheel speeds at `t0`, rad/s; rolling without slip when not given.
    sinkage0 : array_like, shape (n,), optional
        Sinkages at `t0`, m, where sinkage is a state; those at rest when not given.
    sinkage_rate0 : array_like, shape (n,), optional
        Their rates, m/s, downward positive; 0 when not given.

    Returns
    -------
    Trajectory
        The motion, SI units, one row a sample.

    Raises
    ------
    ValueError
        If an argument has the wrong shape or is out of range; the text names it.
    """
    n = len(vehicle.wheels)
    torque = _series('torque', torque, n)
    if not 0 < dt <= 0.02:
        raise ValueError(f'dt must be above 0 and at most 0.02 s, got {dt}')
    if isinstance(sinkage, str):
        mode, given = sinkage, np.zeros((2, 3, n))
    else:
        mode, depth = 'given', _series('sinkage', sinkage, n)
        if len(depth) != len(torque):
            raise ValueError(f'sinkage has {len(depth)} samples, torque has {len(torque)}')
        given = _with_rates(depth, dt)
    if not (math.isfinite(shear_step) and shear_step >= 0):
        raise ValueError(f'shear_step must be at least 0 s, got {shear_step}')
    model = pack(vehicle, terrain, form, mode, drawbar, multipass, shear_step)

    radii = np.array([wheel.radius for wheel in vehicle.wheels])
    start = initial_state(vehicle, terrain, form)
    start[SPEED], start[DISTANCE] = v0, x0
    # Rolling without slip, where nothing else is said.
    start[FIRST_WHEEL : FIRST_WHEEL + n] = v0 / radii
    for k, (name, values) in enumerate(
        (('omega0', omega0), ('sinkage0', sinkage0), ('sinkage_rate0', sinkage_rate0))
    ):
        if values is not None:
            if np.shape(values) != (n,):
                raise ValueError(f'{name} must have shape ({n},), got {np.shape(values)}')
            start[FIRST_WHEEL + k * n : FIRST_WHEEL + (k + 1) * n] = values
    if not np.all(np.isfinite(start)):
        raise ValueError(
            f'x0, v0, omega0, sinkage0 and sinkage_rate0 must be finite, got {x0} m, {v0} m/s, '
            f'{omega0!r} rad/s, {sinkage0!r} m and {sinkage_rate0!r} m/s'
        )
    states = np.empty((len(torque), start.size))
    forces = np.empty((len(torque), n, 7))
    loads = np.zeros((n, 7))
    loads[:, 0] = model.wheels[:, STATIC_LOAD]
    loads[:, 4] = start[FIRST_WHEEL + n : FIRST_WHEEL + 2 * n]
    work = np.empty((3, start.size))
    _run(t0, dt, start, torque, given, model, _fresh_ruts(vehicle), loads, work, states, forces)

    v = states[:, SPEED]
    omega = states[:, FIRST_WHEEL : FIRST_WHEEL + n]
    return Trajectory(
        t=t0 + dt * np.arange(float(len(v))),
        v=v,
        x=states[:, DISTANCE],
        omega=omega,
        slip=slips(v, omega * radii),
        sinkage=forces[:, :, 4],
        load=forces[:, :, 0],
        thrust=forces[:, :, 1],
        resistance=forces[:, :, 2],
        moment=forces[:, :, 3],
    )


def _terrain(terrain: Terrain | Soil) -> Terrain:
    return Terrain(terrain) if isinstance(terrain, Soil) else terrain


def pack(
    vehicle: Vehicle,
    terrain: Terrain | Soil,
    form: Form,
    sinkage: str,
    drawbar: Drawbar,
    multipass: bool,
    shear_step: float = 0.0,
) -> Model:
    """Pack everything that stays constant over a run.

    Parameters
    ----------
    vehicle, terrain, form, drawbar, multipass, shear_step
        As in `simulate`; SI units.
    sinkage : {'dynamic', 'equilibrium', 'given'}
        How sinkage, m, is found.

    Returns
    -------
    Model
        The same, in SI units.

    Raises
    ------
    ValueError
        If sinkage is none of these, the soils lack what the form needs, or they are given for
        another number of tracks than the vehicle has.
    """
    if sinkage not in SINKAGE_MODES:
        raise ValueError(f"sinkage must be 'dynamic', 'equilibrium' or samples, got {sinkage!r}")
    terrain = _terrain(terrain)
    tracks = vehicle.tracks
    n_tracks = max(tracks) + 1
    if terrain.n_tracks not in (None, n_tracks):
        raise ValueError(
            f'soils are given for {terrain.n_tracks} tracks, the vehicle runs in {n_tracks}'
        )
    rows = range(len(terrain.soils))
    check_form(form, [terrain.soil(row, track) for row in rows for track in set(tracks)])
    cg_x, cg_height = vehicle.centre_of_gravity
    return Model(
        form=int(form),
        mode=SINKAGE_MODES[sinkage],
        wheels=vehicle.packed_wheels(multipass),
        spread=np.ascontiguousarray(vehicle.load_distribution()),
        soils=np.array(
            [
                terrain.packed(wheel, track)
                for wheel, track in zip(vehicle.wheels, tracks, strict=True)
            ]
        ),
        starts=terrain.starts,
        grades=terrain.grades,
        mass=float(vehicle.mass),
        cg_x=float(cg_x),
        cg_height=float(cg_height),
        hitch_height=float(vehicle.hitch_height),
        drag=AIR_DENSITY / 2 * vehicle.drag_area,
        pull=float(drawbar.pull),
        pull_per_speed=float(drawbar.pull_per_speed),
        pull_ramp=float(drawbar.ramp),
        shear_step=float(shear_step),
    )


def _fresh_ruts(vehicle: Vehicle) -> Ruts:
    positions = vehicle.wheel_positions
    return fresh_ruts(max(vehicle.tracks) + 1, float(np.ptp(positions)))


def _with_rates(depth: Array, dt: float) -> Array:
    """Sinkage, its rate and its acceleration, each smoothed over SMOOTHED seconds."""
    # Here, as it takes longer to import than all the rest of the package.
    from scipy.signal import savgol_filter

    window = max(5, 2 * round(SMOOTHED / dt / 2) + 1)
    if len(depth) < window:
        raise ValueError(f'sinkage needs at least {window} samples, got {len(depth)}')
    rates = [savgol_filter(depth, window, 2, deriv=order, delta=dt, axis=0) for order in (1, 2)]
    return np.ascontiguousarray(np.stack([depth, *rates], axis=1))


def _series(name: str, values: ArrayLike, n: int) -> Array:
    """Check samples of n wheels."""
    series = np.asarray(values, dtype=float)
    if series.ndim != 2 or series.shape[1] != n or len(series) < 2:
        raise ValueError(f'{name} must have shape (samples, {n}), got {series.shape}')
    if not np.all(np.isfinite(series)):
        row, column = np.argwhere(~np.isfinite(series))[0]
        raise ValueError(f'{name} of wheel {column} is not finite at sample {row}')
    return np.ascontiguousarray(series)
