"""Scenarios: five drives with a disturbance, the same for every controller.

The requested torque is above the traction of the soil, and slip is limited. Each scenario starts
on the same loam; its entry in `SCENARIOS` has the disturbance.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from traction_evaluation.closed_loop.closed_loop import DT, ClosedLoop, Drive, Sensors
from traction_evaluation.loop.traction_loop import TractionLoop
from traction_model.simulation.drawbar import Drawbar
from traction_model.simulation.plant import Plant
from traction_model.simulation.sensors import RadarModel
from traction_model.soil.soil import Soil, load_soil
from traction_model.soil.terrain import Terrain
from traction_model.vehicle.vehicle import Vehicle

LAG = 0.2
"""Time constant of the drive, s."""

START_SPEED = 2.0
"""Speed at the start, m/s."""

RAMP = 1.0
"""Time of the rise of torque and draft, s."""

REQUEST = (0.40, 0.90)
"""Requested torque of the first axle and of all others, over static load times radius."""

SENSORS = Sensors(1000.0, RadarModel(0.05, latency=0.05), torque_noise=0.005)
"""Ordinary sensors."""


@dataclass(frozen=True)
class DriveScenario:
    """Drive with a disturbance.

    Attributes
    ----------
    text : str
        Description of the disturbance.
    duration : float
        s.
    happens : float
        Time of the disturbance, s; slip is evaluated from then on.
    """

    text: str
    duration: float
    happens: float


SCENARIOS = {
    'torque_steps': DriveScenario('torque asked for: half, all, half, all', 12.0, 3.0),
    'soft_patch': DriveScenario('10 m of soft soil', 14.0, 3.0),
    'slope': DriveScenario('10 degrees uphill', 12.0, 3.0),
    'drawbar_jump': DriveScenario('draft doubles', 10.0, 3.0),
    'split_soil': DriveScenario('soft soil under the left wheels', 10.0, 3.0),
}
"""Scenarios by name."""


def run_scenario(name: str, vehicle: Vehicle, loop: TractionLoop | None, seed: int = 1) -> Drive:
    """Run a scenario.

    Parameters
    ----------
    name : str
        One of `SCENARIOS`.
    vehicle : Vehicle
        SI units.
    loop : TractionLoop or None
        Loop in mode limit; None: wheels have the requested torque.
    seed : int
        Seed of all noise, at least 0.

    Returns
    -------
    Drive
        SI units.

    Raises
    ------
    ValueError
        If there is no such scenario.
    """
    if name not in SCENARIOS:
        raise ValueError(f"unknown scenario '{name}'; there are: {', '.join(SCENARIOS)}")
    scenario = SCENARIOS[name]
    loam, soft = load_soil('sandy_loam_chrono'), load_soil('soft_patch_chrono')
    draft = Drawbar(7000.0, 2000.0, RAMP)
    plant = Plant(
        vehicle, loam, drawbar=draft, torque_time_constant=LAG, step_size=2e-3, v0=START_SPEED
    )
    full = np.array(
        [
            share * float(load) * wheel.radius
            for load, wheel, share in zip(
                vehicle.static_loads(), vehicle.wheels, _shares(vehicle), strict=True
            )
        ]
    )
    driven = ClosedLoop(plant, loop, SENSORS, seed)
    events: dict[str, Callable[[], None]] = {
        'torque_steps': lambda: None,
        'soft_patch': lambda: _change(plant, [loam, soft, loam], [0.0, 10.0]),
        'slope': lambda: _change(plant, [loam, loam], [0.0], [0.0, math.radians(10.0)]),
        'drawbar_jump': lambda: setattr(
            plant, 'drawbar', Drawbar(2 * draft.pull, 2 * draft.pull_per_speed)
        ),
        'split_soil': lambda: _change(plant, [loam, (soft, loam)], [0.0]),
    }
    happened = False
    for k in range(round(scenario.duration / DT)):
        t = k * DT
        if not happened and t >= scenario.happens:
            happened = True
            events[name]()
        share = min(1.0, t / RAMP)
        if name == 'torque_steps':
            share *= 1.0 if int(t / scenario.happens) % 2 else 0.5
        driven.step((share * full).tolist())
    return driven.drive()


def _shares(vehicle: Vehicle) -> list[float]:
    first = float(np.max(vehicle.wheel_positions))
    return [REQUEST[0] if x == first else REQUEST[1] for x in vehicle.wheel_positions]


def _change(
    plant: Plant,
    soils: Sequence[Soil | tuple[Soil, ...]],
    starts: Sequence[float],
    grades: float | Sequence[float] = 0.0,
) -> None:
    """Set soils ahead of the front wheels; the first one reaches up to there."""
    ahead = plant.x + float(np.max(plant.vehicle.wheel_positions))
    plant.terrain = Terrain(soils, [ahead + start for start in starts], grades)
