"""Trials of slip control: drives drawn at random over soils, masses, speeds, drives and sensors.

A trial holds slip at a target, on a soil whose tau_max, K and n the control does not know. The
tractor pulls away from standstill, as on a field: below the least speed at which slip means
anything its request passes, so that control takes over a torque that is there. (Were control to
begin on the move, it would begin from no torque, since without slip and speed torque may only
fall.) When it has come to `UNDER_WAY` of the drawn speed, and the rear wheels into the ruts of the
front ones, and `SETTLE` has passed since, the target rises by `STEP`; `STEP_WINDOW` later all wheels, one axle after the other, come onto soil of half the
tau_max. Draft is in proportion to speed, and where the soil does not pull
enough, the path goes downhill, so that steady motion at the target has the drawn speed on both
soils; when the front wheels come onto the weaker one, the draft changes to that.

The answer to the step is the difference to a copy of the same drive, with the same noise, whose
target stays. A wheel's answer counts until the wheel comes into the rut that the one before it has
pressed since the step: that is another soil, met at another time by every draw, and no answer to
the step any more. What noise does to both cancels, but not all of it: pulses are counted at other
angles, and filters may decide otherwise. So the same draw is driven once more with sensors that
have no noise, to tell how the loop answers from what noise adds.
"""

import copy
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from traction_controller.control.slip_control import SlipControl
from traction_controller.estimation.slip_filter import SlipFilter
from traction_evaluation.closed_loop.closed_loop import DT, ClosedLoop, Drive, Sensors
from traction_model.contact.tractive import steady_contact
from traction_model.distribution import Distribution
from traction_model.simulation.drawbar import Drawbar
from traction_model.simulation.plant import Plant
from traction_model.simulation.sensors import RadarModel
from traction_model.soil.soil import Soil
from traction_model.soil.terrain import STEEPEST, Terrain
from traction_model.vehicle.vehicle import GRAVITY, Vehicle

Array = NDArray[np.float64]

TARGET = 0.15
"""Slip held at first, dimensionless: in the middle of what is aimed at on soil, 8 to 20 %."""

STEP = 0.05
"""Rise of the target, dimensionless."""

FIRST_STEP = 4.0
"""When the target rises at the earliest, s."""

SETTLE = 2.0
"""Time that rear wheels have been in the ruts of front wheels by then, s."""

LONGEST_START = 20.0
"""When the target rises at the latest, s, even if the vehicle has not got that far."""

STEP_WINDOW = 2.5
"""Time over which the answer to the step is judged, s."""

WEAKENED = 0.5
"""tau_max of the soil that comes last, as a share of what it was before, dimensionless."""

DROP_WINDOW = 3.0
"""Time that goes on after the last wheel has come onto the weaker soil, s."""

LONGEST_DROP = 15.0
"""Time after which a drive ends that has not got there, s."""

MIN_DRAFT = 0.2
"""Least draft as a share of the vehicle's weight; what the soil does not pull, the slope does."""

UNDER_WAY = 0.9
"""Share of the drawn speed from which on a tractor counts as under way, dimensionless."""

BAND = 0.1
"""Band about its end within which an answer counts as settled, as a share of the step."""

LAST = 1.0
"""Time before the step from which on a trial is judged, s."""

LARGEST_ERROR = 0.1
"""Root mean square error of slip, over a second, above which a drive is not stable."""

RUNAWAY = 0.6
"""Slip that must not last for a second."""

INTEGRATION = 2e-3
"""Integration step of the plant, s: half and twice of it give the same figures."""

DISTRIBUTIONS = {
    'strength': Distribution(relative=0.5),
    'shear_deformation_modulus': Distribution(relative=0.5),
    'sinkage_exponent': Distribution(relative=0.5),
    'mass': Distribution(relative=0.2),
    'lag': Distribution(uniform=(0.1, 0.3)),
    'speed': Distribution(uniform=(0.3, 6.0)),
    'pulses_per_turn': Distribution(log_uniform=(200.0, 4000.0)),
    'radar_noise': Distribution(uniform=(0.01, 0.1)),
    'radar_latency': Distribution(uniform=(0.0, 0.1)),
    'torque_noise': Distribution(uniform=(0.0, 0.01)),
}
"""How each entry of a `Draw` is drawn; relative ones are shares of what is nominal."""


@dataclass(frozen=True)
class Draw:
    """What one trial has of its own.

    Attributes
    ----------
    strength, shear_deformation_modulus, sinkage_exponent, mass : float
        tau_max (cohesion and tan(phi) alike), K, n and the vehicle's mass as shares of what is
        nominal, dimensionless.
    lag : float
        Time constant of the drive, s.
    speed : float
        Steady speed at the target, m/s.
    pulses_per_turn : float
        Of the tachometers.
    radar_noise : float
        Standard deviation, m/s.
    radar_latency : float
        s.
    torque_noise : float
        Standard deviation of a torque reading, as a share of static load times radius,
        dimensionless.
    seed : int
        Seed of all noise.
    """

    strength: float
    shear_deformation_modulus: float
    sinkage_exponent: float
    mass: float
    lag: float
    speed: float
    pulses_per_turn: float
    radar_noise: float
    radar_latency: float
    torque_noise: float
    seed: int


def draws(count: int, seed: int) -> list[Draw]:
    """Draw trials by a scrambled Sobol sequence.

    Parameters
    ----------
    count : int
        Number of trials, a power of 2.
    seed : int
        Seed of the sequence and of the noise, at least 0.

    Returns
    -------
    list of Draw
        In SI units.

    Raises
    ------
    ValueError
        If the count is no power of 2.
    """
    if count < 1 or count & (count - 1):
        raise ValueError(f'number of draws must be a power of 2, got {count}')
    points = qmc.Sobol(len(DISTRIBUTIONS), rng=np.random.default_rng(seed)).random(count)
    columns = {
        name: distribution.values(points[:, k], 1.0, -math.inf, math.inf)
        for k, (name, distribution) in enumerate(DISTRIBUTIONS.items())
    }
    seeds = np.random.default_rng((seed, 1)).integers(2**31, size=count)
    return [
        Draw(**{name: float(values[k]) for name, values in columns.items()}, seed=int(seeds[k]))
        for k in range(count)
    ]


@dataclass(frozen=True)
class Figures:
    """What came of a trial; slips are true ones.

    Attributes
    ----------
    stable : bool
        See `judge`.
    settling : float
        Time after the step from which on the mean slip of the wheels stays within 10 % of the
        step about its end, s; infinite where it does not.
    overshoot : float
        By how much the mean answer goes beyond the step, as a share of it, at least 0.
    settling_quiet, overshoot_quiet : float
        The same with sensors without noise, s and dimensionless.
    settling_throughout : float
        As `settling_quiet`, s, of all wheels throughout, whichever rut they are in.
    rmse : float
        Root mean square of slip less target, over all wheels, from `LAST` before the step on.
    rmse_before : float
        The same up to the change of soil, dimensionless.
    estimate_rmse : float
        Root mean square of estimated less true slip, as `rmse`, dimensionless.
    peak : float
        Largest slip of any wheel after the first came onto the weaker soil, dimensionless.
    work, energy : float
        Tractive work and work of all shafts from `LAST` before the step on, J (N*m).
    speed : float
        Mean speed over `LAST` before the step, m/s.
    """

    stable: bool
    settling: float
    overshoot: float
    settling_quiet: float
    overshoot_quiet: float
    settling_throughout: float
    rmse: float
    rmse_before: float
    estimate_rmse: float
    peak: float
    work: float
    energy: float
    speed: float


@dataclass(frozen=True)
class Trial:
    """A trial as it was driven.

    Attributes
    ----------
    draw : Draw
        What was drawn.
    stepped, unstepped : Drive
        The drive, and the copy whose target stays, in SI units.
    step_time : float
        When the target rose, s.
    drop_time : float
        When the first wheels came onto the weaker soil, s.
    noisy_answer, quiet_answer : ndarray, shape (k,)
        What the step did to slip, see `answer`, with sensor noise and without, dimensionless.
    figures : Figures
        What came of it.
    """

    draw: Draw
    stepped: Drive
    unstepped: Drive
    step_time: float
    drop_time: float
    noisy_answer: Array
    quiet_answer: Array
    figures: Figures


def drawn_vehicle(vehicle: Vehicle, draw: Draw) -> Vehicle:
    """Vehicle of a draw: its chassis makes up the mass.

    Parameters
    ----------
    vehicle : Vehicle
        The nominal one, SI units.
    draw : Draw
        What was drawn.

    Returns
    -------
    Vehicle
        SI units.
    """
    more = (draw.mass - 1.0) * vehicle.mass
    return vehicle.model_copy(update={'chassis_mass': vehicle.chassis_mass + more})


def drawn_soil(soil: Soil, draw: Draw, weakened: float = 1.0) -> Soil:
    """Soil of a draw.

    Parameters
    ----------
    soil : Soil
        The nominal one, SI units.
    draw : Draw
        What was drawn.
    weakened : float
        Further factor of tau_max, dimensionless, above 0.

    Returns
    -------
    Soil
        SI units.
    """
    sheared = soil.sheared(draw.strength * weakened, draw.shear_deformation_modulus)
    exponent = soil.sinkage_exponent * draw.sinkage_exponent
    return sheared.model_copy(update={'sinkage_exponent': exponent})


def steady_pull(vehicle: Vehicle, soil: Soil, slip: float, speed: float) -> tuple[Array, float]:
    """Torque of every wheel, and net traction of all, in steady motion on fresh soil.

    Parameters
    ----------
    vehicle : Vehicle
        SI units.
    soil : Soil
        SI units.
    slip : float
        Slip of all wheels, -1 to 1.
    speed : float
        Rim speed, m/s, above 0.

    Returns
    -------
    torque : ndarray, shape (n,)
        N*m.
    pull : float
        N.
    """
    torques, pull = [], 0.0
    for wheel, load in zip(vehicle.wheels, vehicle.static_loads(), strict=True):
        _, thrust, resistance, moment = steady_contact(soil, wheel, slip, float(load), speed=speed)
        torques.append(moment + wheel.viscous_friction * speed / wheel.radius)
        pull += thrust - resistance
    return np.array(torques), pull


def run_trial(
    draw: Draw,
    vehicle: Vehicle,
    soil: Soil,
    estimation: Callable[[Draw], SlipFilter | None],
    control: Callable[[Draw], SlipControl],
    quiet: bool = True,
) -> Trial:
    """Drive one trial.

    Parameters
    ----------
    draw : Draw
        What was drawn.
    vehicle, soil : Vehicle, Soil
        The nominal ones, SI units.
    estimation, control : callable
        Make estimation and control, in hold, for a draw; they are to use nothing of it but
        what the maker of a vehicle knows, as the pulses of its tachometers.
    quiet : bool
        Whether it is driven once more without noise; otherwise what would come of that is NaN.

    Returns
    -------
    Trial
        The drives and their figures, SI units.
    """
    own, firm = drawn_vehicle(vehicle, draw), drawn_soil(soil, draw)
    weak = drawn_soil(soil, draw, WEAKENED)
    weight = own.mass * GRAVITY
    torque, pull = steady_pull(own, firm, TARGET, draw.speed / (1 - TARGET))
    _, weak_pull = steady_pull(own, weak, TARGET + STEP, draw.speed / (1 - TARGET - STEP))
    drafts = [max(each, MIN_DRAFT * weight) for each in (pull, weak_pull)]
    downhill = [
        max(-STEEPEST, -math.asin(min(1.0, (draft - each) / weight)))
        for draft, each in zip(drafts, (pull, weak_pull), strict=True)
    ]
    # What a wheel gets that is not under control: what it would need.
    request = torque.tolist()
    foremost, hindmost = float(own.wheel_positions.max()), float(own.wheel_positions.min())

    def until(loop: ClosedLoop, t: float) -> None:
        while loop.t < t - DT / 2:
            loop.step(request)

    def step(draw: Draw, sensors: Sensors) -> tuple[ClosedLoop, ClosedLoop, float]:
        """Drive, with a step of the target and without, to the end of the step's window."""
        plant = Plant(
            own,
            Terrain(firm, grades=downhill[0]),
            drawbar=Drawbar(0.0, drafts[0] / draw.speed),
            torque_time_constant=draw.lag,
            step_size=INTEGRATION,
        )
        acting = control(draw)
        acting.set_target(TARGET)
        loop = ClosedLoop(plant, acting, estimation(draw), sensors, draw.seed)
        while loop.t < LONGEST_START - SETTLE and not (
            plant.x >= foremost - hindmost and plant.v >= UNDER_WAY * draw.speed
        ):
            loop.step(request)
        until(loop, max(FIRST_STEP, loop.t + SETTLE))
        stepped_at = loop.t
        other = copy.deepcopy(loop)
        acting.set_target(TARGET + STEP)
        for each in (loop, other):
            until(each, stepped_at + STEP_WINDOW)
        return loop, other, stepped_at

    quiet_answer = throughout = np.full(round(STEP_WINDOW / DT), math.nan)
    if quiet:
        radar = RadarModel(0.0, latency=draw.radar_latency)
        ideal = replace(draw, pulses_per_turn=0.0)
        quiet_stepped, quiet_unstepped, quiet_time = step(ideal, Sensors(radar=radar))
        both = quiet_stepped.drive(), quiet_unstepped.drive()
        quiet_answer = answer(*both, quiet_time, own)
        throughout = differences(*both, quiet_time).mean(axis=1)

    noisy = RadarModel(draw.radar_noise, latency=draw.radar_latency)
    loop, other, step_time = step(
        draw, Sensors(draw.pulses_per_turn, noisy, torque_noise=draw.torque_noise)
    )
    plant, drop_time = loop.plant, loop.t
    plant.terrain = Terrain([firm, weak], [plant.x + foremost], downhill)
    plant.drawbar = Drawbar(0.0, drafts[1] / draw.speed)
    end = plant.x + foremost - hindmost
    while plant.x < end and loop.t < drop_time + LONGEST_DROP:
        loop.step(request)
    until(loop, loop.t + DROP_WINDOW)
    stepped, unstepped = loop.drive(), other.drive()
    noisy_answer = answer(stepped, unstepped, step_time, own)
    figures = judge(
        stepped, unstepped, step_time, drop_time, noisy_answer, quiet_answer, throughout
    )
    return Trial(
        draw, stepped, unstepped, step_time, drop_time, noisy_answer, quiet_answer, figures
    )


def differences(stepped: Drive, unstepped: Drive, step_time: float) -> Array:
    """What the step of the target did to every wheel's true slip.

    Parameters
    ----------
    stepped, unstepped : Drive
        A drive and its copy without the step, SI units.
    step_time : float
        When the target rose, s.

    Returns
    -------
    ndarray, shape (k, n)
        Difference of slips over `STEP_WINDOW` from the step on, dimensionless.
    """
    first = round(step_time / DT)
    last = first + round(STEP_WINDOW / DT)
    return stepped.slip[first:last] - unstepped.slip[first:last]


def answer(stepped: Drive, unstepped: Drive, step_time: float, vehicle: Vehicle) -> Array:
    """Mean answer of the wheels that are not yet in a rut pressed since the step.

    Parameters
    ----------
    stepped, unstepped : Drive
        A drive and its copy without the step, SI units.
    step_time : float
        When the target rose, s.
    vehicle : Vehicle
        Whose wheels follow each other, SI units.

    Returns
    -------
    ndarray, shape (k,)
        Mean of `differences`, dimensionless.
    """
    each = differences(stepped, unstepped, step_time)
    first = round(step_time / DT)
    moved = stepped.x[first : first + len(each)] - stepped.x[first]
    positions, tracks = np.array(vehicle.wheel_positions), np.array(vehicle.tracks)
    ahead = np.array(
        [
            min(
                (other - here for other in positions[tracks == track] if other > here),
                default=math.inf,
            )
            for here, track in zip(positions, tracks, strict=True)
        ]
    )
    # Contact begins ahead of the axle. Foremost wheels always count.
    ahead -= [wheel.radius for wheel in vehicle.wheels]
    return np.asarray(np.average(each, axis=1, weights=moved[:, None] < ahead))


def settling_time(response: Array) -> float:
    """Time after which an answer stays within `BAND` of the step.

    Parameters
    ----------
    response : ndarray, shape (k,)
        Answer to a step of `STEP` at its first sample, dimensionless.

    Returns
    -------
    float
        s; infinite where the last sample is not near.
    """
    outside = np.flatnonzero(np.abs(response - STEP) > BAND * STEP)
    if not outside.size:
        return 0.0
    return math.inf if outside[-1] == len(response) - 1 else float(outside[-1] + 1) * DT


def overshoot(response: Array) -> float:
    """By how much an answer goes beyond the step.

    Parameters
    ----------
    response : ndarray, shape (k,)
        Answer to a step of `STEP`, dimensionless.

    Returns
    -------
    float
        As a share of the step, at least 0.
    """
    return max(0.0, float(response.max()) / STEP - 1.0)


def judge(
    stepped: Drive,
    unstepped: Drive,
    step_time: float,
    drop_time: float,
    noisy_answer: Array,
    quiet_answer: Array,
    throughout: Array,
) -> Figures:
    """Find the figures of a trial.

    A drive is stable where all numbers are finite, no wheel runs away (its slip does not stay
    above `RUNAWAY` for `LAST`), and over the last second before the step, before the weaker soil
    and of the drive the slip of every wheel has come back to the target: its root mean square
    error is below `LARGEST_ERROR`.

    Parameters
    ----------
    stepped, unstepped : Drive
        The drive, and the copy whose target stays, SI units.
    step_time : float
        When the target rose, s.
    drop_time : float
        When the first wheels came onto the weaker soil, s.
    noisy_answer, quiet_answer : ndarray, shape (k,)
        See `Trial`, dimensionless.
    throughout : ndarray, shape (k,)
        Mean answer of all wheels, without noise, dimensionless.

    Returns
    -------
    Figures
        SI units.
    """
    error = stepped.slip - stepped.target[:, None]
    t = stepped.t
    finite = all(
        np.all(np.isfinite(value)) for drive in (stepped, unstepped)
        for value in asdict(drive).values()
    )  # fmt: skip
    back = all(
        np.max(np.sqrt(np.mean(error[(t >= end - LAST) & (t < end)] ** 2, axis=0))) < LARGEST_ERROR
        for end in (step_time, drop_time, t[-1] + DT)
    )
    start = step_time - LAST
    judged = t >= start - DT / 2
    span = round(LAST / DT)
    running = np.lib.stride_tricks.sliding_window_view(stepped.slip[judged], span, axis=0)
    runaway = bool(np.any(running.min(axis=-1) > RUNAWAY))
    work, energy = stepped.efficiency(start - DT / 2)
    before = judged & (t < step_time - DT / 2)
    return Figures(
        stable=finite and back and not runaway,
        settling=settling_time(noisy_answer),
        overshoot=overshoot(noisy_answer),
        settling_quiet=settling_time(quiet_answer),
        overshoot_quiet=overshoot(quiet_answer),
        settling_throughout=settling_time(throughout),
        rmse=float(np.sqrt(np.mean(error[judged] ** 2))),
        rmse_before=float(np.sqrt(np.mean(error[judged & (t < drop_time)] ** 2))),
        estimate_rmse=float(np.sqrt(np.mean((stepped.slip_estimate - stepped.slip)[judged] ** 2))),
        peak=float(stepped.slip[t >= drop_time].max()),
        work=work,
        energy=energy,
        speed=float(stepped.v[before].mean()),
    )


def columns(figures: list[Figures]) -> dict[str, Array]:
    """Figures of many trials as columns.

    Parameters
    ----------
    figures : list of Figures
        One a trial.

    Returns
    -------
    dict of str to ndarray, shape (k,)
        By name, in the units of `Figures`.
    """
    return {
        field.name: np.array([getattr(each, field.name) for each in figures], dtype=float)
        for field in fields(Figures)
    }
