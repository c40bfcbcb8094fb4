"""Problem of a benchmark as plain numbers, for the suite and its peers."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from traction_model import Drawbar, Soil, Vehicle, load_soil, load_vehicle
from traction_model.slip import MIN_SPEED
from tractor_io.bags.reader import BagReader

Array = NDArray[np.float64]

BAGS = Path(__file__).resolve().parents[1] / 'bags'

SAMPLE_TIME = 1e-3
"""Time between samples of torque, s."""


@dataclass(frozen=True)
class Problem:
    """A drive: a vehicle on one soil under recorded torque.

    Attributes
    ----------
    vehicle : Vehicle
        What drives.
    soil : Soil
        What it drives on.
    drawbar : Drawbar
        Its draft, N.
    torque : ndarray, shape (k, n)
        Torque on every wheel, N·m, every `SAMPLE_TIME`; linear in between.
    v0 : float
        Speed at the start, m/s.
    omega0 : ndarray, shape (n,)
        Wheel speeds at the start, rad/s.
    """

    vehicle: Vehicle
    soil: Soil
    drawbar: Drawbar
    torque: Array
    v0: float
    omega0: Array

    @property
    def duration(self) -> float:
        """Length of the drive, s."""
        return (len(self.torque) - 1) * SAMPLE_TIME


def recorded(bag: str, drawbar: Drawbar, duration: float, *, rolling: bool) -> Problem:
    """Take the torque of a recorded bag, and the motion it starts from.

    Parameters
    ----------
    bag : str
        Its folder in ``bags/``.
    drawbar : Drawbar
        The draft of that run, N.
    duration : float
        How much of it to take, s.
    rolling : bool
        Start where every rim has the least speed at which slip means something, from the
        recorded motion; else from rest, with the recording.

    Returns
    -------
    Problem
        SI units.
    """
    times, torques, rims, starts = [], [], [], []
    with BagReader(BAGS / bag) as reader:
        vehicle = load_vehicle(reader.custom_data['vehicle'])
        # The peers have no elastic rebound.
        soil = load_soil(reader.custom_data['soil'])
        soil = soil.model_copy(update={'elastic_modulus': None})
        for entry in reader.messages(['/wheel_torque', '/ground_truth/slip_estimate']):
            message = entry.message
            if entry.topic == '/wheel_torque':
                times.append(entry.time / 1e9)
                torques.append(message.effort)
            else:
                rims.append(message.wheel_based_speed)
                starts.append((entry.time / 1e9, message.ground_based_speed))
    moving = np.min(rims, axis=1) >= MIN_SPEED
    first = int(np.argmax(moving)) if rolling else 0
    start, v0 = starts[first] if rolling else (times[0], 0.0)
    rim = rims[first] if rolling else np.zeros_like(rims[0])
    at = start + SAMPLE_TIME * np.arange(round(duration / SAMPLE_TIME) + 1)
    if not moving.any() or at[-1] > times[-1]:
        raise ValueError(f'bags/{bag} does not hold {duration} s of motion')
    columns = np.transpose(torques)
    radii = np.array([wheel.radius for wheel in vehicle.wheels])
    return Problem(
        vehicle=vehicle,
        soil=soil,
        drawbar=drawbar,
        torque=np.column_stack([np.interp(at, times, column) for column in columns]),
        v0=float(v0),
        omega0=rim / radii,
    )
