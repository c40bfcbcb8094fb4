"""Wheel rig of Chrono: steady states of one wheel on undisturbed soil, and the contact form.

The rig prescribes speed, wheel speed and slip angle; the wheel sinks under its load. Geometry,
load, slip and soil come from a Sobol sequence. The model has no slip angle, so only points with
slip angle 0 are used.

The pressure modulus of Chrono is k_phi + k_c*inv_b, with inv_b the perimeter of the contact patch
over twice its area. Bekker's is k_phi + k_c/b. The points contain inv_b, so both are compared.
"""

import csv
import itertools
import lzma
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from traction_evaluation.markdown import Target, table
from traction_model.contact.contact import Form
from traction_model.contact.tractive import steady_contact
from traction_model.soil.empirical import rms
from traction_model.soil.soil import Soil
from traction_model.vehicle.wheel import Wheel

RIG_FILE = 'wheel_rig.csv.xz'
"""Name of the file of the points, in the folder of the bags."""

COLUMNS = (
    'r', 'b', 'load', 'v', 'omega', 'slip', 'alpha', 'k_phi', 'k_c', 'n', 'c', 'phi_deg', 'K',
    'Fx', 'My', 'sinkage', 'inv_b',
)  # fmt: skip
"""Columns in use, in SI units, `phi_deg` in degrees; forces of the soil on the wheel."""

DAMPING, ELASTIC_MODULUS = 3e4, 4e7
"""Damping and elastic modulus of the soil in all points, Pa·s/m and Pa/m."""


LIMIT = 0.002
"""Limit of the RMS of each error with Chrono's pressure modulus, dimensionless."""

SLIPS = (-0.5, -0.2, 0.0, 0.2, 0.5, 0.8)
"""Ends of the ranges of slip in the table."""


class RigErrors(NamedTuple):
    """Errors of the contact form at points of the rig, model less Chrono.

    Attributes
    ----------
    slip : ndarray, shape (n,)
        Slip of the points, -1 to 1.
    force : ndarray, shape (n,)
        Of the net force along the motion, over load, dimensionless.
    moment : ndarray, shape (n,)
        Of the soil's moment, over radius and load, dimensionless.
    sinkage : ndarray, shape (n,)
        Over Chrono's sinkage, dimensionless.
    """

    slip: NDArray[np.float64]
    force: NDArray[np.float64]
    moment: NDArray[np.float64]
    sinkage: NDArray[np.float64]


def read_rig(path: str | Path) -> dict[str, NDArray[np.float64]]:
    """Read the points without slip angle.

    Parameters
    ----------
    path : str or Path
        CSV file with a header line, compressed by xz.

    Returns
    -------
    dict of str to ndarray
        `COLUMNS`, in their units.

    Raises
    ------
    ValueError
        Naming the file and the column that is missing.
    """
    with lzma.open(path, 'rt', encoding='utf-8') as file:
        names, *rows = csv.reader(file)
    for name in COLUMNS:
        if name not in names:
            raise ValueError(f'{path}: column {name} is missing')
    columns = dict(zip(names, np.array(rows, dtype=float).T, strict=True))
    straight = columns['alpha'] == 0
    return {name: columns[name][straight] for name in COLUMNS}


def rig_errors(points: dict[str, NDArray[np.float64]], *, told_patch: bool) -> RigErrors:
    """Errors of the contact form in steady motion at the points.

    Parameters
    ----------
    points : dict of str to ndarray
        As of `read_rig`.
    told_patch : bool
        True: pressure modulus of Chrono. False: Bekker's k_phi + k_c/b.

    Returns
    -------
    RigErrors
        One entry a point, dimensionless.
    """
    errors = []
    for values in zip(*(points[name] for name in COLUMNS), strict=True):
        at = dict(zip(COLUMNS, map(float, values), strict=True))
        per_width = at['inv_b'] if told_patch else 1 / at['b']
        soil = Soil(
            cohesive_modulus=0.0,
            frictional_modulus=at['k_phi'] + at['k_c'] * per_width,
            sinkage_exponent=at['n'],
            cohesion=at['c'],
            friction_angle=math.radians(at['phi_deg']),
            shear_deformation_modulus=at['K'],
            damping=DAMPING,
            elastic_modulus=ELASTIC_MODULUS,
        )
        wheel = Wheel(radius=at['r'], width=at['b'], inertia=1.0)
        speed = max(at['v'], at['omega'] * at['r'])
        sinkage, thrust, resistance, moment = steady_contact(
            soil, wheel, at['slip'], at['load'], Form.CONTACT, speed
        )
        errors.append(
            (
                at['slip'],
                (thrust - resistance - at['Fx']) / at['load'],
                # My is the moment on the wheel.
                (-moment - at['My']) / (at['r'] * at['load']),
                sinkage / at['sinkage'] - 1,
            )
        )
    return RigErrors(*np.array(errors).T)


def rig_table(told: RigErrors, untold: RigErrors) -> str:
    """RMS and greatest errors, over all points and by slip.

    Parameters
    ----------
    told, untold : RigErrors
        With Chrono's pressure modulus and with Bekker's.

    Returns
    -------
    str
        Markdown, %.
    """
    rows = []
    for name, found in (('told the patch', told), ('k_c/b', untold)):
        ranges = [('all', np.ones_like(found.slip, dtype=bool))]
        ranges += [
            (f'{low:g} to {high:g}', (found.slip >= low) & (found.slip < high))
            for low, high in itertools.pairwise(SLIPS)
        ]
        for text, chosen in ranges:
            if not chosen.any():
                continue
            row = [name, text, str(int(chosen.sum()))]
            for error in (found.force, found.moment, found.sinkage):
                row.append(f'{100 * rms(error[chosen]):.3f}')
                row.append(f'{100 * np.abs(error[chosen]).max():.2f}')
            rows.append(row)
    headings = (
        'pressure modulus', 'slip', 'points', 'Fx over load, RMS', 'max', 'My over r·load, RMS',
        'max', 'sinkage, RMS', 'max',
    )  # fmt: skip
    return table(headings, rows)


def rig_targets(told: RigErrors) -> list[Target]:
    """Targets of the rig with Chrono's pressure modulus.

    Parameters
    ----------
    told : RigErrors
        Errors with `told_patch`, dimensionless.

    Returns
    -------
    list of Target
        Targets of force, moment and sinkage.
    """
    return [
        Target(
            f'wheel rig, {len(error)} points: RMS of {what}',
            f'{100 * rms(error):.3f} %',
            f'at most {100 * LIMIT:g} %',
            rms(error) <= LIMIT,
        )
        for what, error in (
            ('Fx over load', told.force),
            ('My over r·load', told.moment),
            ('sinkage', told.sinkage),
        )
    ]
