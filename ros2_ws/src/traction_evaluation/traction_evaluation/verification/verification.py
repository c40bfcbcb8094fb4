"""Verification against Chrono, by the protocol of Agriculture 2024, 14(3), 499, section 3.

The model starts from Chrono's state at 0.3 s with Chrono's torque. Sinkage is computed by the
model (*predicted*), or Chrono's (*fed*; of equilibrium if it is not positive). Errors are those
of the paper's Table 3. No parameter is fitted.

Chrono integrates shear displacement in whole time steps: soil in contact for part of a step counts
as sheared for the whole step, half a step too long on average. Above 10 m/s a rim slides farther
than K in that time. The switch `whole_steps` adds this half step. It is off by default.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from traction_evaluation.verification.chrono import SAMPLE_TIME, ChronoRecording
from traction_model.contact.contact import Form
from traction_model.simulation.simulate import Trajectory, simulate
from traction_model.slip import MIN_SPEED
from traction_model.soil.terrain import Terrain

Array = NDArray[np.float64]

START = 0.3
"""Start time of the model, s."""

CHRONO_STEP = 1e-3
"""Time step of Chrono's runs, s."""


class Errors(NamedTuple):
    """Largest and mean absolute errors over a run.

    Attributes
    ----------
    v_max, v_mean : float
        Errors of speed, m/s.
    omega_max, omega_mean : float
        Errors of wheel speed, rad/s, over all wheels.
    slip_max, slip_mean : float
        Errors of slip, dimensionless, over all wheels with rim speed above 0.3 m/s.
    """

    v_max: float
    v_mean: float
    omega_max: float
    omega_mean: float
    slip_max: float
    slip_mean: float


class Motion(NamedTuple):
    """Simulated motion without forces; k samples, n wheels.

    Attributes
    ----------
    t, v : ndarray, shape (k,)
        Time, s, and speed, m/s.
    omega, slip, sinkage : ndarray, shape (k, n)
        Wheel speed, rad/s; slip, -1 to 1; sinkage, m.
    """

    t: Array
    v: Array
    omega: Array
    slip: Array
    sinkage: Array


_SLOW = Errors(math.inf, 0.03, math.inf, 0.1, math.inf, 0.015)
_UNLIMITED = Errors(*(math.inf,) * 6)
LIMITS = {
    'wheel_drawbar': _SLOW,
    'wheel_torque_sine': _SLOW,
    'wheel_soft_patch': _SLOW,
    'wheel_low_slip': _UNLIMITED,
    'wheel_high_slip': _UNLIMITED,
    'tractor_sandy_loam': _SLOW,
    'tractor_soft_patch': _SLOW,
    # Wheels in Chrono oscillate after a step of torque; the quasi-static form does not.
    'tractor_steps_slow': _SLOW._replace(slip_mean=math.inf),
    'tractor_steps_medium': _SLOW,
    'tractor_braked': _SLOW,
}
"""Limits of the contact form, for rim speeds below 11 m/s: m/s, rad/s, dimensionless."""

FOLLOWED = tuple(name for name in LIMITS if name != 'tractor_braked')
"""Runs simulated with the torque of the recording."""


def first_sample(recording: ChronoRecording) -> int:
    """Index of the first sample of the simulation, dimensionless."""
    return int(np.searchsorted(recording.t, START - SAMPLE_TIME / 2))


def follow(
    recording: ChronoRecording,
    form: Form = Form.CONTACT,
    *,
    fed: bool = False,
    terrain: Terrain | None = None,
    whole_steps: bool = False,
    multipass: bool = True,
) -> Trajectory:
    """Simulate a run of Chrono from 0.3 s on.

    Parameters
    ----------
    recording : ChronoRecording
        The run.
    form : Form
        Form of the contact model.
    fed : bool
        True: sinkage from Chrono. False: predicted sinkage.
    terrain : Terrain, optional
        Soils that replace those of the run.
    whole_steps : bool
        True: shear displacement as from whole steps of `CHRONO_STEP`, half a step longer.
    multipass : bool
        True: wheels run in the ruts of those before them. False: undisturbed soil.

    Returns
    -------
    Trajectory
        Motion of the model, SI units, at the samples of Chrono.
    """
    first = first_sample(recording)
    depth = recording.sinkage[first:]
    return simulate(
        recording.vehicle,
        recording.run.terrain() if terrain is None else terrain,
        recording.torque[first:],
        SAMPLE_TIME,
        form=form,
        sinkage=depth if fed else 'dynamic',
        drawbar=recording.run.drawbar,
        multipass=multipass,
        shear_step=CHRONO_STEP / 2 if whole_steps else 0.0,
        t0=recording.t[first],
        x0=recording.x[first],
        v0=recording.v[first],
        omega0=recording.omega[first],
        sinkage0=depth[0],
        sinkage_rate0=(depth[1] - depth[0]) / SAMPLE_TIME,
    )


def errors(recording: ChronoRecording, motion: Trajectory | Motion) -> Errors:
    """Errors of a simulated run.

    Parameters
    ----------
    recording : ChronoRecording
        Recording of Chrono.
    motion : Trajectory or Motion
        Simulated motion, to the end of the run.

    Returns
    -------
    Errors
        In m/s, rad/s and slip.
    """
    last = slice(len(recording.t) - len(motion.t), None)
    moving = np.abs(recording.rim_speed[last]) > MIN_SPEED
    by_speed = np.abs(motion.v - recording.v[last])
    by_wheel = np.abs(motion.omega - recording.omega[last])
    by_slip = np.abs(motion.slip - recording.slip[last])[moving]
    return Errors(
        *(
            float(figure)
            for error in (by_speed, by_wheel, by_slip)
            for figure in (error.max(), error.mean())
        )
    )


def exceeded(found: Errors, limits: Errors) -> list[str]:
    """Names of the errors that are above their limits.

    Parameters
    ----------
    found : Errors
        Errors of a run: m/s, rad/s, dimensionless.
    limits : Errors
        Limits, in the same units; infinite if there is none.

    Returns
    -------
    list of str
        Fields of `Errors`, in their order.
    """
    return [
        name
        for name, error, limit in zip(Errors._fields, found, limits, strict=True)
        if error > limit
    ]
