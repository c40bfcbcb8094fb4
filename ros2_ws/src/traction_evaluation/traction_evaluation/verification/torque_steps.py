"""Oscillation of wheels in Chrono after steps of torque, and the quasi-static contact form.

Soil in Chrono stores its shear displacement under the wheel, so that a slow wheel oscillates on it
as on a spring. The contact form has the shear displacement of steady motion at every instant.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from traction_evaluation.markdown import table
from traction_evaluation.verification.chrono import SAMPLE_TIME, ChronoRecording
from traction_evaluation.verification.run_errors import FollowedRuns

Array = NDArray[np.float64]

STEPPED_RUNS = ('tractor_steps_slow', 'tractor_steps_medium')
STEPPED_WHEELS = ('fl', 'rl')
AVERAGED = 0.2
"""Window of the moving mean, s."""

FROM = 6.0
"""Time of the first step, s."""


def moving_mean(values: Array, duration: float = AVERAGED) -> Array:
    """Centred moving mean, with the first and last values repeated at the ends.

    Parameters
    ----------
    values : ndarray, shape (k,)
        Samples, any unit.
    duration : float
        s.

    Returns
    -------
    ndarray, shape (k,)
        In the unit of the samples.
    """
    half = round(duration / SAMPLE_TIME / 2)
    padded = np.pad(values, half, mode='edge')
    return np.convolve(padded, np.full(2 * half + 1, 1 / (2 * half + 1)), 'valid')


def ringing(omega: Array) -> tuple[float, float]:
    """RMS and frequency of the deviation of a wheel speed from its moving mean.

    Parameters
    ----------
    omega : ndarray, shape (k,)
        rad/s, every 5 ms.

    Returns
    -------
    rms, frequency : float
        rad/s, and frequency of the peak of the spectrum, Hz.
    """
    swing = omega - moving_mean(omega)
    power = np.abs(np.fft.rfft(swing)) ** 2
    frequencies = np.fft.rfftfreq(len(swing), SAMPLE_TIME)
    return float(np.sqrt(np.mean(swing**2))), float(frequencies[np.argmax(power)])


def step_table(recordings: Mapping[str, ChronoRecording], runs: FollowedRuns) -> str:
    """Oscillation of the wheels with steps of torque, and errors, sinkage predicted.

    Parameters
    ----------
    recordings : mapping of str to ChronoRecording
        Runs by name.
    runs : FollowedRuns
        The same, followed.

    Returns
    -------
    str
        Markdown; rad/s, Hz, dimensionless.
    """
    rows = []
    for name in STEPPED_RUNS:
        recording, motion = recordings[name], runs.motions[name, False]
        first = len(recording.t) - len(motion.t)
        stepped = motion.t >= FROM
        for wheel in STEPPED_WHEELS:
            j = recording.vehicle.wheel_names.index(wheel)
            omegas = [each[:, j][stepped] for each in (recording.omega[first:], motion.omega)]
            slips = [each[:, j][stepped] for each in (recording.slip[first:], motion.slip)]
            swing, frequency = ringing(omegas[0])
            row = [name, wheel, f'{recording.v[first:][stepped].mean():.2f}', f'{swing:.3f}']
            row += [f'{ringing(omegas[1])[0]:.3f}', f'{frequency:.1f}']
            for (chronos, ours), digits in ((omegas, 3), (slips, 4)):
                smooth = moving_mean(ours) - moving_mean(chronos)
                row.append(f'{np.abs(ours - chronos).mean():.{digits}f}')
                row.append(f'{np.abs(smooth).mean():.{digits}f}')
            rows.append(row)
    headings = (
        'run', 'wheel', 'speed, m/s', 'oscillation in Chrono, rad/s RMS', 'in the model', 'at, Hz',
        'mean error of ω', f'of {AVERAGED:g} s means', 'mean error of slip',
        f'of {AVERAGED:g} s means',
    )  # fmt: skip
    return table(headings, rows)
