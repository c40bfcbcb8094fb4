"""Equations of motion of an n-wheel vehicle on soft soil, and their Runge-Kutta 4 steps.

Per wheel and for the vehicle (Agriculture 2024, 14(3), 499, equations (29) and (31), made
dimensionally consistent):

    m*v'      = sum_j (F_j - R_j) - drawbar - m*g*sin(grade) - air drag
    J*omega'  = T - b_f*omega - M
    m_j*z''   = W_j - N_j

with m_j the mass that the wheel carries at rest and W_j its load after longitudinal load
transfer. The paper's (31) prints ``cos(alpha)`` on the resistance R; here the slope is in the
load that R follows from.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from traction_model.contact.contact import (
    BEKKER_WONG,
    CONTACT,
    EMPIRICAL,
    FREE,
    MIN_TRANSIT_SPEED,
    UNTOUCHED,
    Form,
    check_form,
    forces_at,
    sinkage_at,
)
from traction_model.kernel import inlined
from traction_model.simulation.drawbar import Drawbar, drawbar_force
from traction_model.simulation.wheel_forces import (
    FORCE_COLUMNS,
    LOAD,
    MOMENT,
    RESISTANCE,
    SHEAR,
    SINKAGE,
    THRUST,
    UPWARD,
)
from traction_model.soil.empirical import curve_ratios
from traction_model.soil.rut import Ruts, fresh_ruts, press_rut
from traction_model.soil.soil import (
    COHESION,
    CURVE,
    DAMPING,
    HUMP,
    JANOSI_HANAMOTO,
    RESIDUAL,
    SHEAR_LAW,
    SHEAR_MODULUS,
    TAN_PHI,
    WONG_PRESTON_THOMAS,
    Soil,
)
from traction_model.soil.terrain import Terrain, as_terrain, soil_row
from traction_model.vehicle.load_transfer import load_moment, wheel_load
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

# Modes of sinkage as integers, for kernels.
DYNAMIC, EQUILIBRIUM, GIVEN = range(3)
SINKAGE_MODES = {'dynamic': DYNAMIC, 'equilibrium': EQUILIBRIUM, 'given': GIVEN}

# State: speed, distance, then wheel speed, sinkage and sinkage rate of every wheel.
SPEED, DISTANCE, FIRST_WHEEL = range(3)


class Model(NamedTuple):
    """Packed constants of a run, for kernels; n wheels, k soils.

    Attributes
    ----------
    form : int
        A `Form`.
    mode : int
        An entry of `SINKAGE_MODES`.
    wheels : ndarray, shape (n, 7)
        Packed wheels, SI units.
    load_distribution : ndarray, shape (n, 2)
        Load of a wheel, N, per N of total load and per N·m of load moment.
    soils : ndarray, shape (n, k, 17)
        Packed soils for each wheel, SI units.
    starts : ndarray, shape (k,)
        Start of each soil, m; the first is minus infinity.
    grades : ndarray, shape (k,)
        Slope from each start on, rad, uphill positive.
    mass, cg_x, cg_height, hitch_height : float
        kg, m, m, m.
    drag : float
        Air drag per square of speed, N*s^2/m^2.
    pull, pull_per_speed, pull_ramp : float
        Draft, N, N*s/m, s.
    shear_step : float
        See `traction_model.contact.contact.arc_stresses`, s.
    """

    form: int
    mode: int
    wheels: Array
    load_distribution: Array
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
def derivative(t, y, torque, given, row, share, model, ruts, forces, slope, n, form, mode):
    """Rate of change of the state, and the forces.

    Parameters
    ----------
    t : float
        Time, s.
    y : ndarray, shape (2 + 3n,)
        Speed m/s, distance m, wheel speeds rad/s, sinkages m, sinkage rates m/s.
    torque : ndarray, shape (k, n)
        Samples of drive torque, N·m, forward positive.
    given : ndarray, shape (k, 3, n)
        Samples of sinkage, m, its rate, m/s, and its acceleration, m/s^2, downward positive;
        read in mode 'given' only, and used where the sinkage is positive.
    row : int
        Index of the sample before `t`, at most k - 2.
    share : float
        Fraction of the interval to the next sample, 0 to 1, dimensionless.
    model : Model
        Constants of the run, SI units.
    ruts : Ruts
        Ruts so far.
    forces : ndarray, shape (n, 7)
        Wheel forces in SI units, see `traction_model.simulation.wheel_forces`. In: loads and
        sinkages as initial values. Out: all of them.
    slope : ndarray, shape (2 + 3n,)
        Out: rate of change of `y` in SI units per second.
    n, form, mode : int
        Number of wheels, `Form`, and entry of `SINKAGE_MODES` of the model, as separate arguments
        so that they can be constants at compile time.
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
    # If sinkage follows from load, or load is imposed, load transfer and contact are computed by
    # fixed point iteration. Load transfer is a small part of the load: more than a digit per
    # iteration.
    for _ in range(1 if mode == DYNAMIC else 4):
        net = 0.0
        transfer = 0.0
        for j in range(n):
            omega = y[FIRST_WHEEL + j]
            radius, width = wheels[j, RADIUS], wheels[j, WIDTH]
            x = y[DISTANCE] + wheels[j, POSITION]
            track = int(wheels[j, TRACK])
            z_rate = 0.0
            imposed = FREE
            if mode == DYNAMIC:
                z = y[FIRST_WHEEL + n + j]
                z_rate = y[FIRST_WHEEL + 2 * n + j]
            else:
                z = 0.0
                if mode == GIVEN:
                    z = given[row, 0, j] + share * (given[row + 1, 0, j] - given[row, 0, j])
                if z > 0.0:
                    z_rate = given[row, 1, j] + share * (given[row + 1, 1, j] - given[row, 1, j])
                    rising = given[row, 2, j] + share * (given[row + 1, 2, j] - given[row, 2, j])
                    carried = wheels[j, STATIC_LOAD] / GRAVITY
                    imposed = max(0.0, forces[j, LOAD] - carried * rising)
                else:
                    z = sinkage_at(
                        form, v, omega, forces[j, LOAD], x, model.soils[j], model.starts, radius,
                        width, track, ruts, forces[j, SINKAGE],
                    )  # fmt: skip
            load, thrust, resistance, soil_moment, sheared = forces_at(
                form, v, omega, z, z_rate, x, model.soils[j], model.starts, radius, width, track,
                ruts, imposed, model.shear_step,
            )  # fmt: skip
            forces[j, THRUST] = thrust
            forces[j, RESISTANCE] = resistance
            forces[j, MOMENT] = soil_moment
            forces[j, SINKAGE] = z
            forces[j, UPWARD] = load
            forces[j, SHEAR] = sheared
            drive = torque[row, j] + share * (torque[row + 1, j] - torque[row, j])
            drive -= wheels[j, FRICTION] * omega
            slope[FIRST_WHEEL + j] = (drive - soil_moment) / wheels[j, INERTIA]
            net += thrust - resistance
            transfer += drive - radius * (thrust - resistance)
        acceleration = (net - pull - climb - drag) / mass
        moment = load_moment(
            weight, model.cg_x, model.cg_height, model.hitch_height, pull,
            mass * acceleration + climb + drag, transfer,
        )  # fmt: skip
        moved = 0.0
        for j in range(n):
            load = max(0.0, wheel_load(model.load_distribution[j], weight, moment))
            moved = max(moved, abs(load - forces[j, LOAD]))
            forces[j, LOAD] = load
        if moved < 1e-9 * weight:
            break
    slope[SPEED] = acceleration
    slope[DISTANCE] = v
    for j in range(n):
        rise = 0.0
        if mode == DYNAMIC:
            rise = (forces[j, LOAD] - forces[j, UPWARD]) * GRAVITY / wheels[j, STATIC_LOAD]
        slope[FIRST_WHEEL + n + j] = y[FIRST_WHEEL + 2 * n + j] if mode == DYNAMIC else 0.0
        slope[FIRST_WHEEL + 2 * n + j] = rise


@inlined
def steps_for(dt, y, model, forces, n, form, mode):
    """Number of Runge-Kutta 4 steps for a time; near standstill forces change very fast.

    The largest rate is that of slip, ``C*(1/m + r^2/J)/(r*omega)`` (see
    `traction_model.lpv.slip_dynamics`), with the slip stiffness C at most
    ``(c*A + N*tan(phi))*l/K``, more for laws with a peak; or that of sinkage, from the
    damping D and, for the arc, from the growth of contact behind the wheel.

    Parameters
    ----------
    dt : float
        Time to advance, s.
    y : ndarray, shape (2 + 3n,)
        State in SI units, see `derivative`.
    model : Model
        Constants of the run, SI units.
    forces : ndarray, shape (n, 7)
        Wheel forces in SI units, see `derivative`; sinkages and upward forces are read.
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
        length = math.sqrt(2.0 * radius * min(max(forces[j, SINKAGE], 0.0), radius))
        strength = soil[COHESION] * wheels[j, WIDTH] * length + forces[j, UPWARD] * soil[TAN_PHI]
        speed = max(abs(v), radius * abs(y[FIRST_WHEEL + j]), MIN_TRANSIT_SPEED)
        stiffness = strength * length / (soil[SHEAR_MODULUS] * speed)
        # Initial slope of laws with a peak; that of Janosi and Hanamoto is 1.
        if soil[SHEAR_LAW] != JANOSI_HANAMOTO:
            steepness = math.e if soil[SHEAR_LAW] == WONG_PRESTON_THOMAS else 1.0
            stiffness *= max(1.0, soil[RESIDUAL] * (1.0 + soil[HUMP] * steepness))
        elif form == BEKKER_WONG:
            # Initial slope of the mean of 1 - exp(-j/K) over the contact: 1/2.
            stiffness /= 2.0
        if form == EMPIRICAL:
            rise = curve_ratios(soil[CURVE:], 1e-3)[0] - curve_ratios(soil[CURVE:], 0.0)[0]
            stiffness = forces[j, UPWARD] * rise / 1e-3 / speed
        shared += stiffness / model.mass
        fastest = max(fastest, stiffness * radius * radius / wheels[j, INERTIA])
        if mode == DYNAMIC:
            damping = soil[DAMPING] * wheels[j, WIDTH] * length
            if form == CONTACT and length > 0.0:
                transit = max(abs(v), MIN_TRANSIT_SPEED)
                damping += forces[j, UPWARD] / (transit * length / radius)
            fastest = max(fastest, damping * GRAVITY / wheels[j, STATIC_LOAD])
    # Stable up to 2.8; C is mostly half of its bound.
    if dt * (fastest + shared) <= 2.5:
        return 1
    return int(math.ceil(dt * (fastest + shared) / 2.5))  # noqa: RUF046


@inlined
def advance(t, dt, y, torque, given, row, model, ruts, forces, work, n, form, mode):
    """Advance the state from one sample to the next by Runge-Kutta 4, and add ruts.

    Parameters
    ----------
    t, dt : float
        Start time and duration, s.
    y : ndarray, shape (2 + 3n,)
        State in SI units, see `derivative`; changed in place.
    torque, given, row, model, forces
        See `derivative`; SI units. Torque and given sinkage are linear between samples.
    ruts : Ruts
        Ruts so far; changed in place.
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
                # Midpoint again, then endpoint.
                reach = 0.5 * h if stage == 1 else h
                for i in range(2 + 3 * n):
                    total[i] += 2.0 * slope[i]
                    trial[i] = y[i] + reach * slope[i]
        for i in range(2 + 3 * n):
            y[i] += h / 6.0 * (total[i] + slope[i])
        # The other forms use undisturbed soil.
        for j in range(n if form == CONTACT else 0):
            place = wheels[j, POSITION]
            press_rut(
                x + place, y[DISTANCE] + place, forces[j, SINKAGE], forces[j, SHEAR],
                wheels[j, WIDTH], int(wheels[j, TRACK]), ruts,
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
        Working memory, SI units.
    every : int
        Number of samples per stored one, at least 1.
    states : ndarray, shape (m, 2 + 3n)
        Out: states at the stored samples, SI units.
    logged : ndarray, shape (m, n, 7)
        Out: forces at the stored samples, SI units.
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
                for i in range(FORCE_COLUMNS):
                    logged[kept, j, i] = forces[j, i]
        if k < last:
            advance(
                t0 + k * dt, dt, y, torque, given, row, model, ruts, forces, work, n, form, mode
            )


def pack(
    vehicle: Vehicle,
    terrain: Terrain | Soil,
    form: Form,
    sinkage: str,
    drawbar: Drawbar,
    multipass: bool,
    shear_step: float = 0.0,
) -> Model:
    """Packed constants of a run.

    Parameters
    ----------
    vehicle, terrain, form, drawbar, multipass, shear_step
        As in `simulate`; SI units.
    sinkage : {'dynamic', 'equilibrium', 'given'}
        Mode of sinkage, m.

    Returns
    -------
    Model
        Constants in SI units.

    Raises
    ------
    ValueError
        If the mode is unknown, the soils lack parameters of the form, or their number of tracks
        does not match the vehicle.
    """
    if sinkage not in SINKAGE_MODES:
        raise ValueError(f"sinkage must be 'dynamic', 'equilibrium' or samples, got {sinkage!r}")
    terrain = as_terrain(terrain)
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
        load_distribution=np.ascontiguousarray(vehicle.load_distribution()),
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


def initial_state(vehicle: Vehicle, terrain: Terrain | Soil, form: Form = Form.CONTACT) -> Array:
    """State of a vehicle at rest at the start of its path.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle.
    terrain : Terrain or Soil
        Terrain or soil.
    form : Form
        Form of the contact model.

    Returns
    -------
    ndarray, shape (2 + 3n,)
        State as for `derivative`, SI units.
    """
    terrain = as_terrain(terrain)
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


def fresh_ruts_of(vehicle: Vehicle) -> Ruts:
    """Ruts of a vehicle before it has moved.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle.

    Returns
    -------
    Ruts
        Undisturbed soil in all tracks, m, over the length of the vehicle.
    """
    return fresh_ruts(max(vehicle.tracks) + 1, float(np.ptp(vehicle.wheel_positions)))
