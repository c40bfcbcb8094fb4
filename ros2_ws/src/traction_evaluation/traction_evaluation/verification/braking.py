"""Braked run: brakes applied in steps to lock, a tow that holds the speed, and the contact form.

The torque of a brake depends on the motion. With the recorded torque a locked wheel of the model
turns backward if its soil moment is slightly below that of Chrono. So the simulation uses the
demand on the brakes and their law.
"""

import numpy as np
from numpy.typing import NDArray

from traction_evaluation.markdown import table
from traction_evaluation.verification.chrono import SAMPLE_TIME, ChronoRecording
from traction_evaluation.verification.run_errors import HEADINGS, cells
from traction_evaluation.verification.verification import LIMITS, Errors, Motion, first_sample
from traction_model.simulation.drawbar import Drawbar
from traction_model.simulation.plant import Plant
from traction_model.simulation.vehicle_dynamics import DISTANCE, FIRST_WHEEL, SPEED

Array = NDArray[np.float64]

BRAKED_RUN = 'tractor_braked'

TIMES = (0.0, 1.0, 3.0, 4.0, 6.0, 7.0, 9.0, 10.0, 11.0, 11.5)
"""Times of the points of the demand, s."""

DEMAND = {
    'front': (0, 500, 500, 1000, 1000, 1400, 1400, 3000, 3000, 600),
    'rear': (0, 1500, 1500, 3000, 3000, 4500, 4500, 9000, 9000, 2000),
}
"""Demanded brake torque per wheel at these times, N·m, linear in between."""

FULL_BRAKE = 0.3
"""Wheel speed of full brake torque, rad/s; below it the torque is proportional to the speed."""

TOW_ENDS = (12.0, 13.0)
"""Start and end of the fade of the tow, s."""

PLATEAUS = ((2.0, 3.0), (5.0, 6.0), (8.0, 9.0), (10.5, 11.0), (11.6, 12.0))
"""Intervals of constant demand and speed, s."""

STEP = 1e-3
"""Time step of the brake torque, s, as in Chrono."""


def brake_torque(t: float, omega: Array) -> Array:
    """Torque of the brakes on the wheels fl, fr, rl, rr.

    Parameters
    ----------
    t : float
        Time, s.
    omega : ndarray, shape (4,)
        Wheel speeds, rad/s.

    Returns
    -------
    ndarray, shape (4,)
        N·m, against the rotation.
    """
    front, rear = (np.interp(t, TIMES, DEMAND[axle]) for axle in ('front', 'rear'))
    demand = np.array([front, front, rear, rear])
    return np.asarray(-demand * np.clip(omega / FULL_BRAKE, -1, 1))


def tow(t: float, drawbar: Drawbar) -> Drawbar:
    """Tow of the run at a time.

    Parameters
    ----------
    t : float
        Time, s.
    drawbar : Drawbar
        Tow before the fade, N.

    Returns
    -------
    Drawbar
        N, with the ramp of `drawbar`.
    """
    share = float(np.interp(t, TOW_ENDS, (1.0, 0.0)))
    return Drawbar(share * drawbar.pull, share * drawbar.pull_per_speed, drawbar.ramp)


def follow_braked(recording: ChronoRecording) -> Motion:
    """Simulate the braked run from Chrono's state at 0.3 s on, sinkage predicted.

    Parameters
    ----------
    recording : ChronoRecording
        The run.

    Returns
    -------
    Motion
        The model's motion, SI units.
    """
    first = first_sample(recording)
    n = recording.omega.shape[1]
    drawbar = recording.run.drawbar
    plant = Plant(recording.vehicle, recording.run.terrain(), drawbar=drawbar, step_size=STEP)
    plant.t = float(recording.t[first])
    plant.state[SPEED] = recording.v[first]
    plant.state[DISTANCE] = recording.x[first]
    depth = recording.sinkage[first : first + 2]
    for k, values in enumerate((recording.omega[first], depth[0], np.diff(depth, axis=0)[0])):
        plant.state[FIRST_WHEEL + k * n : FIRST_WHEEL + (k + 1) * n] = values
    plant.state[FIRST_WHEEL + 2 * n :] /= SAMPLE_TIME
    rows = []
    for t in recording.t[first:]:
        rows.append((plant.v, plant.omega.copy(), plant.slip, plant.sinkage.copy()))
        if TOW_ENDS[0] <= t <= TOW_ENDS[1]:
            plant.drawbar = tow(float(t), drawbar)
        for _ in range(round(SAMPLE_TIME / STEP)):
            plant.step(brake_torque(plant.t, plant.omega), STEP)
    v, omega, slip, sinkage = (np.array(column) for column in zip(*rows, strict=True))
    return Motion(recording.t[first:], v, omega, slip, sinkage)


def braking_tables(recording: ChronoRecording, motion: Motion, found: Errors) -> dict[str, str]:
    """Tables of the braked run.

    Parameters
    ----------
    recording : ChronoRecording
        Recording of Chrono.
    motion : Motion
        Motion from `follow_braked`, SI units.
    found : Errors
        Errors of the run: m/s, rad/s, dimensionless.

    Returns
    -------
    dict of str to str
        Markdown: ``braking``, errors over the run; ``plateaus``, means of Chrono and of the model
        while the demand is steady, of front and rear wheels.
    """
    first = len(recording.t) - len(motion.t)
    rows = []
    for begin, end in PLATEAUS:
        steady = (motion.t >= begin) & (motion.t <= end)
        row = [f'{begin:g} to {end:g}']
        row += [f'{np.interp(begin, TIMES, DEMAND[axle]):.0f}' for axle in ('front', 'rear')]
        for chronos, ours, digits in (
            (recording.v[first:], motion.v, 3),
            (recording.slip[first:], motion.slip, 3),
            (1e3 * recording.sinkage[first:], 1e3 * motion.sinkage, 1),
        ):
            pair = [_by_axle(values[steady]) for values in (chronos, ours)]
            row += [
                f'{each[0]:.{digits}f}, {each[1]:.{digits}f}' for each in zip(*pair, strict=True)
            ]
        rows.append(row)
    headings = (
        'time, s', 'demand front, N·m', 'rear', 'speed, m/s', 'slip front', 'slip rear',
        'sinkage front, mm', 'sinkage rear',
    )  # fmt: skip
    return {
        'braking': table(HEADINGS, [cells(found, LIMITS[BRAKED_RUN])]),
        'plateaus': table(headings, rows),
    }


def _by_axle(values: Array) -> Array:
    """Mean of front and of rear wheels, or the mean of a speed, in the unit of the values."""
    mean = np.atleast_1d(values.mean(axis=0))
    return np.asarray(mean.reshape(-1, min(2, mean.size)).mean(axis=1))
