"""Table 3 of the paper: errors of its model, of its form on our runs, and of the contact form.

The Chrono runs are our own, with the data in the paper. The paper compares its model with other
runs.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from traction_evaluation.markdown import Target, table
from traction_evaluation.verification.chrono import ChronoRecording
from traction_evaluation.verification.run_errors import HEADINGS, FollowedRuns, cells
from traction_evaluation.verification.verification import (
    Errors,
    Motion,
    errors,
    exceeded,
    first_sample,
    follow,
)
from traction_model.contact.contact import Form, slip_along_path
from traction_model.lpv.speed_model import LARGEST_INVERSE_SLIP, SpeedLpvModel
from traction_model.slip import slips

PAPER_TABLE_3 = {
    'wheel_high_slip': Errors(1.406, 0.314, 40.631, 14.706, 0.02, 0.008),
    'wheel_low_slip': Errors(0.908, 0.456, 2.650, 1.416, 0.019, 0.015),
}
"""Errors of the paper's own model against its Chrono runs: m/s, rad/s, dimensionless."""

PAPER_AREA = 0.224
"""Contact area A that the paper takes for both runs, m^2."""


def follow_at_constant_area(recording: ChronoRecording, area: float = PAPER_AREA) -> Motion:
    """Simulate a run of one wheel with the LPV model of the paper, (22) and (29), at constant A.

    As in the paper, sinkage of Chrono is an input and the load is the weight.

    Parameters
    ----------
    recording : ChronoRecording
        The run, of one wheel on one soil.
    area : float
        Contact area A, m^2, above 0.

    Returns
    -------
    Motion
        The model's motion at Chrono's samples, SI units.
    """
    # Imported on demand, since the import takes longer than that of the rest of the package.
    from scipy.integrate import solve_ivp

    first = first_sample(recording)
    t, torque = recording.t[first:], recording.torque[first:, 0]
    sinkage = np.maximum(recording.sinkage[first:, 0], 0.0)
    vehicle, soil = recording.vehicle, recording.run.terrain().soil(0, 0)
    radius, load = vehicle.wheels[0].radius, float(vehicle.static_loads()[0])
    model = SpeedLpvModel(vehicle, Form.PAPER)
    strength = soil.max_shear_stress(load / area)
    fixed = {
        'heading': 1.0,
        'sinkage_exponent': soil.sinkage_exponent,
        'area': area,
        'load': load,
        'shear_deformation_modulus': soil.shear_deformation_modulus,
    }

    def slope(now: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        slipping = slip_along_path(x[0], radius * x[1])
        inverse = (
            1 / slipping if abs(slipping) * LARGEST_INVERSE_SLIP > 1 else LARGEST_INVERSE_SLIP
        )
        found = model.matrices({**fixed, 'inverse_slip': inverse})
        uncontrolled = [strength, np.interp(now, t, sinkage), 0.0]
        drive = [np.interp(now, t, torque)]
        return np.asarray(found.A @ x + found.B @ drive + found.B_uc @ uncontrolled)

    start = [recording.v[first], recording.omega[first, 0]]
    solved = solve_ivp(slope, (t[0], t[-1]), start, 'LSODA', t_eval=t, rtol=1e-6, atol=1e-6)
    v, omega = solved.y[0], solved.y[1][:, np.newaxis]
    return Motion(t, v, omega, slips(v, radius * omega), sinkage[:, np.newaxis])


def paper_target(whole_steps: Mapping[str, Errors]) -> Target:
    """Target of the paper's own figures.

    Parameters
    ----------
    whole_steps : mapping of str to Errors
        As of `paper_table`; m/s, rad/s, dimensionless.

    Returns
    -------
    Target
        Of all figures of its Table 3.
    """
    above = sum(len(exceeded(found, PAPER_TABLE_3[name])) for name, found in whole_steps.items())
    figures = len(PAPER_TABLE_3) * len(Errors._fields)
    return Target(
        "figures of the paper's Table 3 reached, sinkage predicted, shear by whole steps",
        f'{figures - above} of {figures}',
        'all',
        above == 0,
    )


def paper_table(
    recordings: Mapping[str, ChronoRecording], runs: FollowedRuns
) -> tuple[str, dict[str, Errors]]:
    """Table 3, cell by cell.

    Parameters
    ----------
    recordings : mapping of str to ChronoRecording
        Runs by name.
    runs : FollowedRuns
        The same, followed; m/s, rad/s, dimensionless.

    Returns
    -------
    text : str
        Markdown; bold where a figure is above the paper's.
    whole_steps : dict of str to Errors
        Errors of the contact form with shear by whole steps, by run.
    """
    rows, whole_steps = [], {}
    for name, paper in PAPER_TABLE_3.items():
        recording = recordings[name]
        whole_steps[name] = errors(recording, follow(recording, whole_steps=True))
        rows.append([name, "the paper's model, as printed", *cells(paper)])
        for text, found in (
            (
                f'paper, A = {PAPER_AREA:g} m², sinkage fed',
                errors(recording, follow_at_constant_area(recording)),
            ),
            ('paper, A from sinkage, fed', runs.found[name, Form.PAPER, True]),
            ('bekker_wong, sinkage fed', runs.found[name, Form.BEKKER_WONG, True]),
            ('contact, sinkage fed', runs.found[name, Form.CONTACT, True]),
            ('contact, sinkage predicted', runs.found[name, Form.CONTACT, False]),
            ('contact, predicted, shear by whole steps', whole_steps[name]),
        ):
            rows.append([name, text, *cells(found, paper)])
        ratios = (a / b for a, b in zip(whole_steps[name], paper, strict=True))
        rows.append([name, "the last over the paper's", *(f'{ratio:.2f}' for ratio in ratios)])
    return table(('run', 'form', *HEADINGS), rows), whole_steps
