"""Figures of a trial: step response, settling, overshoot, slip error, stability.

The response to the step is the difference to a copy of the drive with the same noise and without
the step. The response of a wheel counts until it enters the rut pressed since the step by the
wheel before it, since this is a change of soil. Noise cancels only in part: pulses come at other
angles, and the gates of filters may accept other readings.
"""

import math
from dataclasses import asdict, dataclass, fields

import numpy as np
from numpy.typing import NDArray

from traction_evaluation.closed_loop.closed_loop import DT, Drive
from traction_model.vehicle.vehicle import Vehicle

Array = NDArray[np.float64]

STEP = 0.05
"""Rise of the target, dimensionless."""

STEP_WINDOW = 2.5
"""Time window of the step response, s."""

BAND = 0.1
"""Band of a settled response about its final value, over the step."""

LAST = 1.0
"""Time before the step from which a trial is evaluated, s."""

LARGEST_ERROR = 0.1
"""Largest RMS error of slip over a second in a stable drive."""

RUNAWAY = 0.6
"""Slip that must not last for a second in a stable drive."""


@dataclass(frozen=True)
class Figures:
    """Figures of a trial; slips are true ones.

    Attributes
    ----------
    stable : bool
        See `judge`.
    settling : float
        Time after the step until the mean slip of the wheels stays within 10 % of the step about
        its final value, s; infinite if it does not.
    overshoot : float
        Overshoot of the mean response over the step, at least 0.
    settling_noise_free, overshoot_noise_free : float
        The same without sensor noise, s and dimensionless.
    settling_throughout : float
        As `settling_noise_free`, s, for all wheels throughout, in any rut.
    rmse : float
        Root mean square of slip less target, over all wheels, from `LAST` before the step on.
    rmse_before : float
        The same up to the change of soil, dimensionless.
    estimate_rmse : float
        Root mean square of estimated less true slip, as `rmse`, dimensionless.
    peak : float
        Largest slip of any wheel after the first reached the weaker soil, dimensionless.
    work, energy : float
        Tractive work and work of all shafts from `LAST` before the step on, J (N·m).
    speed : float
        Mean speed over `LAST` before the step, m/s.
    """

    stable: bool
    settling: float
    overshoot: float
    settling_noise_free: float
    overshoot_noise_free: float
    settling_throughout: float
    rmse: float
    rmse_before: float
    estimate_rmse: float
    peak: float
    work: float
    energy: float
    speed: float


def differences(stepped: Drive, unstepped: Drive, step_time: float) -> Array:
    """Response of the true slip of every wheel to the step.

    Parameters
    ----------
    stepped, unstepped : Drive
        A drive and its copy without the step, SI units.
    step_time : float
        Time of the step, s.

    Returns
    -------
    ndarray, shape (k, n)
        Difference of slips over `STEP_WINDOW` from the step on, dimensionless.
    """
    first = round(step_time / DT)
    last = first + round(STEP_WINDOW / DT)
    return stepped.slip[first:last] - unstepped.slip[first:last]


def step_response(stepped: Drive, unstepped: Drive, step_time: float, vehicle: Vehicle) -> Array:
    """Mean step response of the wheels outside ruts pressed since the step.

    Parameters
    ----------
    stepped, unstepped : Drive
        A drive and its copy without the step, SI units.
    step_time : float
        Time of the step, s.
    vehicle : Vehicle
        The vehicle, SI units.

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
    # Contact starts ahead of the axle. Front wheels always count.
    ahead -= [wheel.radius for wheel in vehicle.wheels]
    return np.asarray(np.average(each, axis=1, weights=moved[:, None] < ahead))


def settling_time(response: Array) -> float:
    """Time after which a response stays within `BAND` of the step.

    Parameters
    ----------
    response : ndarray, shape (k,)
        Response to a step of `STEP` at its first sample, dimensionless.

    Returns
    -------
    float
        s; infinite if the last sample is outside the band.
    """
    outside = np.flatnonzero(np.abs(response - STEP) > BAND * STEP)
    if not outside.size:
        return 0.0
    return math.inf if outside[-1] == len(response) - 1 else float(outside[-1] + 1) * DT


def overshoot(response: Array) -> float:
    """Overshoot of a response.

    Parameters
    ----------
    response : ndarray, shape (k,)
        Response to a step of `STEP`, dimensionless.

    Returns
    -------
    float
        Over the step, at least 0.
    """
    return max(0.0, float(response.max()) / STEP - 1.0)


def judge(
    stepped: Drive,
    unstepped: Drive,
    step_time: float,
    drop_time: float,
    noisy_response: Array,
    noise_free_response: Array,
    throughout: Array,
) -> Figures:
    """Figures of a trial.

    A drive is stable if all numbers are finite, no slip stays above `RUNAWAY` for `LAST`, and the
    RMS slip error of every wheel is below `LARGEST_ERROR` in the last second before the step,
    before the weaker soil and before the end.

    Parameters
    ----------
    stepped, unstepped : Drive
        The drive, and its copy without the step, SI units.
    step_time : float
        Time of the step, s.
    drop_time : float
        Time at which the first wheels reached the weaker soil, s.
    noisy_response, noise_free_response : ndarray, shape (k,)
        See `Trial`, dimensionless.
    throughout : ndarray, shape (k,)
        Mean step response of all wheels, without noise, dimensionless.

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
        settling=settling_time(noisy_response),
        overshoot=overshoot(noisy_response),
        settling_noise_free=settling_time(noise_free_response),
        overshoot_noise_free=overshoot(noise_free_response),
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
        One per trial.

    Returns
    -------
    dict of str to ndarray, shape (k,)
        Columns by name, in the units of `Figures`.
    """
    return {
        field.name: np.array([getattr(each, field.name) for each in figures], dtype=float)
        for field in fields(Figures)
    }
