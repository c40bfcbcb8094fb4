"""Verification against Chrono, by the protocol of Agriculture 2024, 14(3), 499, section 3.

The model starts from Chrono's state at 0.3 s and takes Chrono's torque; sinkage is either taken
from Chrono, too (*fed*; from equilibrium where it is not positive), or the model's own
(*predicted*). Errors are those of the paper's Table 3.

Two numbers stand for Chrono's own numerics, fitted on these runs and the same for all:

- Soil bears as if a wheel were `CONTACT_OFFSET` deeper than its centre says.
- Soil has been sheared for `SHEAR_STEP` when it first bears, as Chrono counts shear
  displacement by whole time steps.
"""

import math
from typing import NamedTuple

import numpy as np

from traction_evaluation.verification.chrono import SAMPLE_TIME, ChronoRecording
from traction_model.contact.contact import Form
from traction_model.simulation.simulate import Trajectory, simulate
from traction_model.slip import MIN_SPEED
from traction_model.soil.terrain import Terrain

START = 0.3
"""Time at which the model takes over from Chrono, s."""

CONTACT_OFFSET = 0.005
"""How much deeper than its centre says a wheel of Chrono meets soil, m."""

SHEAR_STEP = 1e-4
"""For how long soil has been sheared when Chrono's wheel first bears on it, s."""


class Errors(NamedTuple):
    """Greatest and mean absolute errors over a run.

    Attributes
    ----------
    v_max, v_mean : float
        Of speed, m/s.
    omega_max, omega_mean : float
        Of wheel speed, rad/s, over all wheels.
    slip_max, slip_mean : float
        Of slip, dimensionless, over all wheels where the rim goes above 0.3 m/s.
    """

    v_max: float
    v_mean: float
    omega_max: float
    omega_mean: float
    slip_max: float
    slip_mean: float


PAPER_TABLE_3 = {
    'wheel_high_slip': Errors(1.406, 0.314, 40.631, 14.706, 0.02, 0.008),
    'wheel_low_slip': Errors(0.908, 0.456, 2.650, 1.416, 0.019, 0.015),
}
"""Errors of the paper's own model against its Chrono runs: m/s, rad/s, dimensionless."""

_TRACTOR_SPEED = Errors(math.inf, 0.05, math.inf, 0.15, math.inf, 0.015)
_TRACTOR = Errors(math.inf, 0.15, math.inf, 0.4, math.inf, 0.02)
LIMITS = {
    'wheel_drawbar': _TRACTOR_SPEED,
    'wheel_torque_sine': _TRACTOR_SPEED,
    'wheel_soft_patch': _TRACTOR_SPEED,
    **PAPER_TABLE_3,
    'tractor_sandy_loam': _TRACTOR,
    'tractor_soft_patch': _TRACTOR,
}
"""What the contact form is held to with fed sinkage: m/s, rad/s, dimensionless."""

NOT_REACHED = {'wheel_low_slip': ['slip_max']}
"""Errors that stay above their limits with fed sinkage, dimensionless.

Chrono's own slip jumps by more than that between samples, as the wheel meets cells of its grid.
"""

PREDICTED_FACTOR = 3.0
"""How many times `LIMITS` the errors may be with predicted sinkage, dimensionless."""


def follow(
    recording: ChronoRecording,
    form: Form = Form.CONTACT,
    *,
    fed: bool = True,
    terrain: Terrain | None = None,
    offset: float = CONTACT_OFFSET,
    shear_step: float = SHEAR_STEP,
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
        Whether sinkage is taken from Chrono or predicted.
    terrain : Terrain, optional
        Soils in place of the run's own.
    offset : float
        Added to Chrono's sinkage, m.
    shear_step : float
        See `traction_model.simulation.simulate.simulate`, s.
    multipass : bool
        Whether wheels meet the ruts of those before them, or fresh soil.

    Returns
    -------
    Trajectory
        The model's motion, SI units, at Chrono's samples.
    """
    first = int(np.searchsorted(recording.t, START - SAMPLE_TIME / 2))
    depth = recording.sinkage[first:] + offset
    return simulate(
        recording.vehicle,
        recording.run.terrain() if terrain is None else terrain,
        recording.torque[first:],
        SAMPLE_TIME,
        form=form,
        sinkage=depth if fed else 'dynamic',
        drawbar=recording.run.drawbar,
        multipass=multipass,
        shear_step=shear_step,
        t0=recording.t[first],
        x0=recording.x[first],
        v0=recording.v[first],
        omega0=recording.omega[first],
        sinkage0=depth[0],
        sinkage_rate0=(depth[1] - depth[0]) / SAMPLE_TIME,
    )


def errors(recording: ChronoRecording, trajectory: Trajectory) -> Errors:
    """Errors of a simulated run.

    Parameters
    ----------
    recording : ChronoRecording
        The run as Chrono had it.
    trajectory : Trajectory
        The run as simulated, to its end.

    Returns
    -------
    Errors
        In m/s, rad/s and slip.
    """
    last = slice(len(recording.t) - len(trajectory.t), None)
    moving = np.abs(recording.rim_speed[last]) > MIN_SPEED
    by_speed = np.abs(trajectory.v - recording.v[last])
    by_wheel = np.abs(trajectory.omega - recording.omega[last])
    by_slip = np.abs(trajectory.slip - recording.slip[last])[moving]
    return Errors(
        *(
            float(figure)
            for error in (by_speed, by_wheel, by_slip)
            for figure in (error.max(), error.mean())
        )
    )


def exceeded(found: Errors, limits: Errors, factor: float = 1.0) -> list[str]:
    """Names of the errors that are above their limits.

    Parameters
    ----------
    found : Errors
        Errors of a run: m/s, rad/s, dimensionless.
    limits : Errors
        What they are held to, in the same units; infinite where they are held to nothing.
    factor : float
        How many times the limits are allowed, dimensionless.

    Returns
    -------
    list of str
        Fields of `Errors`, in their order.
    """
    return [
        name
        for name, error, limit in zip(Errors._fields, found, limits, strict=True)
        if error > factor * limit
    ]
