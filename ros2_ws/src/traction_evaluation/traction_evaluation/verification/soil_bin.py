"""Trials of a single wheel in a soil bin: drawbar pull over slip, predicted and fitted.

In a trial the wheel runs at a fixed slip and load over undisturbed soil, and its drawbar pull is
measured. The model predicts drawbar over load (the net traction ratio) in steady motion under the
measured load: with the published soil, and with two parameters fitted on every second trial and
tested on the others:

- the share of shear strength that acts at the rim (0 to 1): soil slides along a smooth rim before
it
  shears. The share also contains effects that the model lacks, slip sinkage and bulldozing;
- the shear deformation modulus K, m.

Pressure-sinkage parameters are as published, so load and sinkage are predicted, not fitted.
"""

import csv
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from traction_model.contact.contact import Form
from traction_model.contact.tractive import steady_contact
from traction_model.slip import checked_slip
from traction_model.soil.soil import Soil, load_soil
from traction_model.vehicle.wheel import Wheel

COLUMNS = ('slip', 'drawbar', 'vertical_load', 'sinkage')

FITTED_SLIP = (0.0, 0.9)
"""Range of slip for fits and errors: the driven wheel."""

SLIP_TOLERANCE = 0.01
"""Tolerance of slip: trials set to 0 are measured slightly off 0."""

SHEAR_MODULI = (1e-4, 1.0)
"""Bounds of K in the fit, m."""

SAND_BED_WHEELS = {
    name: Wheel(radius=0.058, width=0.05, inertia=1e-3, grouser_height=height)
    for name, height in (('smooth', 0.0), ('grouser', 0.005))
}
"""Wheels of Pavlov and Johnson, m; inertia is nominal and has no effect."""


class Trials(NamedTuple):
    """Trials of one wheel, one entry each.

    Attributes
    ----------
    slip : ndarray, shape (n,)
        Measured slip, -1 (locked) to 1 (spinning).
    load : ndarray, shape (n,)
        Measured vertical load, N.
    drawbar : ndarray, shape (n,)
        Measured drawbar pull, N, positive in the direction of motion.
    sinkage : ndarray, shape (n,)
        Measured sinkage, m.
    """

    slip: NDArray[np.float64]
    load: NDArray[np.float64]
    drawbar: NDArray[np.float64]
    sinkage: NDArray[np.float64]

    @property
    def drawbar_ratio(self) -> NDArray[np.float64]:
        """Drawbar pull over load, dimensionless, shape (n,)."""
        return np.asarray(self.drawbar / self.load)


class Prediction(NamedTuple):
    """Prediction of the model for trials.

    Attributes
    ----------
    drawbar_ratio : ndarray, shape (n,)
        Drawbar pull over load, dimensionless.
    sinkage : ndarray, shape (n,)
        Sinkage, m.
    """

    drawbar_ratio: NDArray[np.float64]
    sinkage: NDArray[np.float64]


class Comparison(NamedTuple):
    """Trials of one wheel against the model.

    Attributes
    ----------
    trials : Trials
        All trials of the wheel, sorted by slip.
    within : ndarray of bool, shape (n,)
        Trials within 0 to 0.9 slip, used for fit or test.
    fitted_half : ndarray of bool, shape (n,)
        Trials used for the fit; the others within are the tested half.
    strength_share : float
        Share of the soil's shear strength at the rim, 0 to 1, fitted.
    shear_deformation_modulus : float
        K, m, fitted.
    unfitted, fitted : Prediction
        Predictions for all trials with the published soil, and with the fitted parameters.
    """

    trials: Trials
    within: NDArray[np.bool_]
    fitted_half: NDArray[np.bool_]
    strength_share: float
    shear_deformation_modulus: float
    unfitted: Prediction
    fitted: Prediction

    @property
    def tested_half(self) -> NDArray[np.bool_]:
        """Trials within 0 to 0.9 slip that were not fitted, shape (n,)."""
        return np.asarray(self.within & ~self.fitted_half)

    def errors(self, prediction: Prediction, chosen: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Errors of the predicted drawbar over load.

        Parameters
        ----------
        prediction : Prediction
            `unfitted` or `fitted`.
        chosen : ndarray of bool, shape (n,)
            Trials to use.

        Returns
        -------
        ndarray
            Predicted less measured, dimensionless, one for each chosen trial.
        """
        return np.asarray((prediction.drawbar_ratio - self.trials.drawbar_ratio)[chosen])


def read_trials(path: str | Path) -> dict[str, Trials]:
    """Read trials from a CSV table.

    Parameters
    ----------
    path : str or Path
        Table with the columns ``wheel`` (a name), ``slip`` (-1 to 1), ``drawbar`` (N),
        ``vertical_load`` (N) and ``sinkage`` (m); others are ignored.

    Returns
    -------
    dict of str to Trials
        Trials by wheel, sorted by slip; repeats of one slip in the order of the table.

    Raises
    ------
    ValueError
        If a column is missing, or a value is not a number in range.
    """
    by_wheel: dict[str, list[list[float]]] = {}
    with Path(path).open(newline='', encoding='utf-8') as file:
        table = csv.DictReader(file)
        for column in ('wheel', *COLUMNS):
            if column not in (table.fieldnames or ()):
                raise ValueError(f'{path}: column {column} is missing')
        for row in table:
            where = f'{path}: line {table.line_num}'
            try:
                numbers = [float(row[column]) for column in COLUMNS]
                checked_slip(numbers[0])
            except (TypeError, ValueError) as error:
                raise ValueError(f'{where}: {error}') from error
            if not all(map(math.isfinite, numbers)) or numbers[2] <= 0:
                raise ValueError(f'{where}: numbers must be finite, and vertical_load above 0')
            by_wheel.setdefault(row['wheel'], []).append(numbers)
    trials = {}
    for name, rows in by_wheel.items():
        slip, drawbar, load, sinkage = np.array(sorted(rows, key=lambda row: row[0])).T
        trials[name] = Trials(slip, load, drawbar, sinkage)
    return trials


def predict(trials: Trials, soil: Soil, wheel: Wheel, form: Form = Form.CONTACT) -> Prediction:
    """Drawbar over load and sinkage of the model in steady motion, at the measured loads.

    Parameters
    ----------
    trials : Trials
        The trials.
    soil : Soil
        The soil.
    wheel : Wheel
        The wheel.
    form : Form
        Form of the contact model.

    Returns
    -------
    Prediction
        Drawbar over load, dimensionless, and sinkage, m, of every trial.
    """
    ratios = np.empty_like(trials.slip)
    sinkages = np.empty_like(trials.slip)
    for k, (slip, load) in enumerate(zip(trials.slip, trials.load, strict=True)):
        sinkage, thrust, resistance, _ = steady_contact(
            soil, wheel, float(slip), float(load), form
        )
        ratios[k] = (thrust - resistance) / load
        sinkages[k] = sinkage
    return Prediction(ratios, sinkages)


def compare(
    trials: Trials,
    soil: Soil,
    wheel: Wheel,
    form: Form = Form.CONTACT,
) -> Comparison:
    """Predict trials with the published soil, and with two parameters fitted on every second one.

    Of the trials within 0 to 0.9 slip, sorted by slip, the first, third, fifth and so on are used
    for the fit, the others for the test. So repeats of one slip are in both halves.

    Parameters
    ----------
    trials : Trials
        Trials of one wheel.
    soil : Soil
        Published soil.
    wheel : Wheel
        The wheel, in m; its inertia has no effect.
    form : Form
        Form of the contact model.

    Returns
    -------
    Comparison
        Predictions, fitted parameters (share, and K in m), and trials used for the fit.

    Raises
    ------
    ValueError
        If there are fewer than four trials within 0 to 0.9 slip: two to fit two parameters
        and two to test them.
    """
    # Imported on demand, since the import takes longer than that of the rest of the package.
    from scipy.optimize import least_squares

    order = np.argsort(trials.slip, kind='stable')
    trials = Trials(*(column[order] for column in trials))
    within = (trials.slip >= FITTED_SLIP[0] - SLIP_TOLERANCE) & (
        trials.slip <= FITTED_SLIP[1] + SLIP_TOLERANCE
    )
    if np.sum(within) < 4:
        raise ValueError(f'{np.sum(within)} trials within 0 to 0.9 slip, at least 4 are needed')
    fitted_half = np.zeros_like(within)
    fitted_half[np.flatnonzero(within)[::2]] = True
    half = Trials(*(column[fitted_half] for column in trials))

    def at_rim(free: NDArray[np.float64]) -> Soil:
        share, log_modulus = map(float, free)
        weaker = soil.sheared(share)
        return weaker.model_copy(update={'shear_deformation_modulus': math.exp(log_modulus)})

    low, high = np.log(SHEAR_MODULI)
    best = least_squares(
        lambda free: predict(half, at_rim(free), wheel, form).drawbar_ratio - half.drawbar_ratio,
        [0.5, math.log(soil.shear_deformation_modulus)],
        bounds=([0.0, low], [1.0, high]),
    )
    return Comparison(
        trials,
        within,
        fitted_half,
        float(best.x[0]),
        math.exp(best.x[1]),
        predict(trials, soil, wheel, form),
        predict(trials, at_rim(best.x), wheel, form),
    )


def compare_sand_bed(path: str | Path) -> dict[str, Comparison]:
    """Compare the trials of Pavlov and Johnson on dry sand with their published soil.

    Parameters
    ----------
    path : str or Path
        Table of their trials, see `read_trials` (slip; N; m), with the wheels ``smooth`` and
        ``grouser``.

    Returns
    -------
    dict of str to Comparison
        Comparisons by wheel; lengths in m, ratios dimensionless.

    Raises
    ------
    ValueError
        As for `read_trials`, or if one of the two wheels is missing.
    """
    trials = read_trials(path)
    missing = SAND_BED_WHEELS.keys() - trials.keys()
    if missing:
        raise ValueError(f'{path}: there are no trials of the wheel {min(missing)!r}')
    soil = load_soil('pavlov_sand')
    return {name: compare(trials[name], soil, wheel) for name, wheel in SAND_BED_WHEELS.items()}
