"""Trials of slip control: drives with random soil, mass, speed, drive lag and sensors.

A trial holds slip at a target on a soil with unknown tau_max, K and n.

- The tractor starts from standstill. Below the smallest speed of valid slip the request passes, so
  control starts from this torque. (A start in motion would have no torque, because torque may only
  fall without slip and speed.)
- The target rises by `STEP` when the speed has reached `UNDER_WAY` of the drawn one and the rear
wheels
  have been in the ruts of the front ones for `SETTLE`.
- `STEP_WINDOW` later the wheels, one axle after the other, reach soil of half the tau_max.
- Draft is proportional to speed, and the path goes downhill if the traction of the soil is too
small,
  so that steady motion at the target has the drawn speed on both soils. The draft changes when the
  front wheels reach the weaker soil.

Every draw runs with sensor noise and once without it: the first shows the behaviour of a vehicle,
the second the response of the loop. `trial_figures` evaluates both.
"""

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from traction_evaluation.closed_loop.closed_loop import DT, ClosedLoop, Drive, Sensors
from traction_evaluation.closed_loop.trial_figures import (
    STEP,
    STEP_WINDOW,
    Figures,
    differences,
    judge,
    step_response,
)
from traction_evaluation.loop.traction_loop import TractionLoop
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
"""Initial slip target, dimensionless: in the middle of the usual range on soil, 8 to 20 %."""

FIRST_STEP = 4.0
"""Earliest time of the step, s."""

SETTLE = 2.0
"""Time of the rear wheels in the ruts of the front wheels before the step, s."""

LONGEST_START = 20.0
"""Latest time of the step, s."""

WEAKENED = 0.5
"""tau_max of the last soil over that of the first, dimensionless."""

DROP_WINDOW = 3.0
"""Duration after the last wheel reaches the weaker soil, s."""

LONGEST_DROP = 15.0
"""Longest duration of a drive, s."""

MIN_DRAFT = 0.2
"""Smallest draft over the weight of the vehicle; a downhill slope provides missing traction."""

UNDER_WAY = 0.9
"""Speed over drawn speed above which the tractor counts as under way, dimensionless."""

INTEGRATION = 2e-3
"""Integration step of the plant, s; half and twice this step give the same figures."""

SPEEDS = (0.3, 6.0)
"""Range of the steady speed, m/s."""

PULSES_PER_TURN = (200.0, 4000.0)
"""Range of the pulses per turn of the tachometers, dimensionless."""

DISTRIBUTIONS = {
    'strength': Distribution(relative=0.5),
    'shear_deformation_modulus': Distribution(relative=0.5),
    'sinkage_exponent': Distribution(relative=0.5),
    'mass': Distribution(relative=0.2),
    'lag': Distribution(uniform=(0.1, 0.3)),
    'speed': Distribution(uniform=SPEEDS),
    'pulses_per_turn': Distribution(log_uniform=PULSES_PER_TURN),
    'radar_noise': Distribution(uniform=(0.01, 0.1)),
    'radar_latency': Distribution(uniform=(0.0, 0.1)),
    'torque_noise': Distribution(uniform=(0.0, 0.01)),
}
"""Distribution of each entry of a `TrialDraw`; relative ones are over the nominal value."""


@dataclass(frozen=True)
class TrialDraw:
    """Random values of one trial.

    Attributes
    ----------
    strength, shear_deformation_modulus, sinkage_exponent, mass : float
        tau_max (cohesion and tan(phi)), K, n and mass of the vehicle over their nominal values,
        dimensionless.
    lag : float
        Time constant of the drive, s.
    speed : float
        Steady speed at the target, m/s.
    pulses_per_turn : float
        Pulses per turn of the tachometers.
    radar_noise : float
        Standard deviation, m/s.
    radar_latency : float
        s.
    torque_noise : float
        Standard deviation of a torque reading, over static load times radius, dimensionless.
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


def draws(count: int, seed: int) -> list[TrialDraw]:
    """Draw trials by a scrambled Sobol sequence.

    Parameters
    ----------
    count : int
        Number of trials, a power of 2.
    seed : int
        Seed of the sequence and of the noise, at least 0.

    Returns
    -------
    list of TrialDraw
        In SI units.

    Raises
    ------
    ValueError
        If the number is no power of 2.
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
        TrialDraw(
            **{name: float(values[k]) for name, values in columns.items()}, seed=int(seeds[k])
        )
        for k in range(count)
    ]


@dataclass(frozen=True)
class Trial:
    """Recording of a trial.

    Attributes
    ----------
    draw : TrialDraw
        Random values.
    stepped, unstepped : Drive
        The drive, and its copy without the step, in SI units.
    step_time : float
        Time of the step, s.
    drop_time : float
        Time at which the first wheels reached the weaker soil, s.
    noisy_response, noise_free_response : ndarray, shape (k,)
        Step response, see `step_response`, with sensor noise and without, dimensionless.
    figures : Figures
        Figures of the trial.
    """

    draw: TrialDraw
    stepped: Drive
    unstepped: Drive
    step_time: float
    drop_time: float
    noisy_response: Array
    noise_free_response: Array
    figures: Figures


def drawn_vehicle(vehicle: Vehicle, draw: TrialDraw) -> Vehicle:
    """Vehicle of a draw; the chassis has the change of mass.

    Parameters
    ----------
    vehicle : Vehicle
        Nominal one, SI units.
    draw : TrialDraw
        Random values.

    Returns
    -------
    Vehicle
        SI units.
    """
    more = (draw.mass - 1.0) * vehicle.mass
    return vehicle.model_copy(update={'chassis_mass': vehicle.chassis_mass + more})


def drawn_soil(soil: Soil, draw: TrialDraw, weakened: float = 1.0) -> Soil:
    """Soil of a draw.

    Parameters
    ----------
    soil : Soil
        Nominal one, SI units.
    draw : TrialDraw
        Random values.
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
    """Torque of every wheel, and net traction of all, in steady motion on undisturbed soil.

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
        N·m.
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
    draw: TrialDraw,
    vehicle: Vehicle,
    soil: Soil,
    make_loop: Callable[[TrialDraw], TractionLoop],
    *,
    perfect: bool = False,
    noise_free: bool = True,
) -> Trial:
    """Run one trial.

    Parameters
    ----------
    draw : TrialDraw
        Random values.
    vehicle, soil : Vehicle, Soil
        Nominal ones, SI units.
    make_loop : callable
        Returns estimator, slip control in mode hold, and gate in their initial state. It may use
        only those values of the draw that are known for a real vehicle.
    perfect : bool
        True to use the true slip in place of an estimate.
    noise_free : bool
        True to run it also without noise; otherwise those figures are NaN.

    Returns
    -------
    Trial
        Drives and figures, SI units.
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
    # Request: torque at the target slip, used without control.
    request = torque.tolist()
    foremost, hindmost = float(own.wheel_positions.max()), float(own.wheel_positions.min())

    def until(loop: ClosedLoop, t: float) -> None:
        while loop.t < t - DT / 2:
            loop.step(request)

    def step(draw: TrialDraw, sensors: Sensors) -> tuple[ClosedLoop, ClosedLoop, float]:
        """Drives with and without the step, to the end of the window of the step."""
        plant = Plant(
            own,
            Terrain(firm, grades=downhill[0]),
            drawbar=Drawbar(0.0, drafts[0] / draw.speed),
            torque_time_constant=draw.lag,
            step_size=INTEGRATION,
        )
        loop = ClosedLoop(plant, make_loop(draw), sensors, draw.seed, perfect=perfect)
        loop.set_target(TARGET)
        while loop.t < LONGEST_START - SETTLE and not (
            plant.x >= foremost - hindmost and plant.v >= UNDER_WAY * draw.speed
        ):
            loop.step(request)
        until(loop, max(FIRST_STEP, loop.t + SETTLE))
        stepped_at = loop.t
        other = copy.deepcopy(loop)
        loop.set_target(TARGET + STEP)
        for each in (loop, other):
            until(each, stepped_at + STEP_WINDOW)
        return loop, other, stepped_at

    noise_free_response = throughout = np.full(round(STEP_WINDOW / DT), math.nan)
    if noise_free:
        ideal = Sensors(radar=RadarModel(0.0, latency=draw.radar_latency))
        *loops, ideal_time = step(replace(draw, pulses_per_turn=0.0), ideal)
        both = loops[0].drive(), loops[1].drive()
        noise_free_response = step_response(*both, ideal_time, own)
        throughout = differences(*both, ideal_time).mean(axis=1)

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
    noisy_response = step_response(stepped, unstepped, step_time, own)
    figures = judge(
        stepped,
        unstepped,
        step_time,
        drop_time,
        noisy_response=noisy_response,
        noise_free_response=noise_free_response,
        throughout=throughout,
    )
    return Trial(
        draw, stepped, unstepped, step_time, drop_time, noisy_response, noise_free_response,
        figures,
    )  # fmt: skip
