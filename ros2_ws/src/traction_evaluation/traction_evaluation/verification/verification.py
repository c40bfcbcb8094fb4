"""Verification against Chrono, by the protocol of Agriculture 2024, 14(3), 499, section 3.

The model starts from Chrono's state at 0.3 s with Chrono's torque. Sinkage is either Chrono's
(*fed*; of equilibrium if it is not positive) or computed by the model (*predicted*). Errors are
those of the paper's Table 3.

Two constants represent the numerics of Chrono. They are fitted on these runs and equal for all:

- contact starts `CONTACT_OFFSET` before the wheel reaches the soil;
- soil is sheared for `SHEAR_STEP` at first contact, as Chrono integrates shear displacement in
whole
  time steps.
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
"""Start time of the model, s."""

CONTACT_OFFSET = 0.005
"""Offset of contact in Chrono, m: added to the sinkage from the position of the wheel."""

SHEAR_STEP = 1e-4
"""Time of shear at first contact in Chrono, s."""


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


PAPER_TABLE_3 = {
    'wheel_high_slip': Errors(1.406, 0.314, 40.631, 14.706, 0.02, 0.008),
    'wheel_low_slip': Errors(0.908, 0.456, 2.650, 1.416, 0.019, 0.015),
}
"""Errors of the paper's model against its Chrono runs: m/s, rad/s, dimensionless."""

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
"""Limits of the contact form with fed sinkage: m/s, rad/s, dimensionless."""

NOT_REACHED = {'wheel_low_slip': ['slip_max']}
"""Errors above their limits with fed sinkage, dimensionless.

Slip in Chrono jumps by more than that between samples, when the wheel reaches cells of its grid.
"""

PREDICTED_FACTOR = 3.0
"""Factor on `LIMITS` with predicted sinkage, dimensionless."""


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
        True: sinkage from Chrono. False: predicted sinkage.
    terrain : Terrain, optional
        Soils that replace those of the run.
    offset : float
        Added to Chrono's sinkage, m.
    shear_step : float
        See `traction_model.simulation.simulate.simulate`, s.
    multipass : bool
        True: wheels run in the ruts of those before them. False: undisturbed soil.

    Returns
    -------
    Trajectory
        Motion of the model, SI units, at the samples of Chrono.
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
        Recording of Chrono.
    trajectory : Trajectory
        Simulated motion, to the end of the run.

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
        Limits, in the same units; infinite if there is none.
    factor : float
        Factor on the limits, dimensionless.

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
