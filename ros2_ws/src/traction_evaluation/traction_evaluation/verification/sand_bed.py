"""Section of the report on a single wheel in a sand bed, measured by others."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from traction_evaluation.markdown import Target, fill, table
from traction_evaluation.verification.soil_bin import Comparison
from traction_model.soil.empirical import rms

SAND_BED = 'single_wheel_sand.csv'
"""File of the field data: C. Pavlov and A. M. Johnson, Carnegie Mellon University
(3d-terramechanics); not part of this project."""

SAND_BED_LIMIT = 0.05
"""Limit of the RMS error of drawbar over load, fitted, on the tested half."""


def sand_bed_section(comparisons: Mapping[str, Comparison]) -> str:
    """Text of the section.

    Parameters
    ----------
    comparisons : mapping of str to Comparison
        By wheel; dimensionless, K in m.

    Returns
    -------
    str
        Markdown, without heading.
    """
    rows = []
    for name, each in comparisons.items():
        rows.append(
            [
                name,
                str(int(each.within.sum())),
                f'{rms(each.errors(each.unfitted, each.within)):.3f}',
                f'{rms(each.errors(each.fitted, each.fitted_half)):.3f}',
                f'{rms(each.errors(each.fitted, each.tested_half)):.3f}',
                f'{each.strength_share:.3f}',
                f'{1e3 * each.shear_deformation_modulus:.2f}',
                f'{rms(each.errors(each.unfitted, ~each.within)):.2f}',
            ]
        )
    headings = (
        'wheel', 'trials', 'RMS, published soil', 'RMS, fitted half', 'RMS, tested half',
        'share of strength', 'K, mm', 'RMS braking, published soil',
    )  # fmt: skip
    template = Path(__file__).with_name('sand_bed.template.md')
    return fill(template, table=table(headings, rows)).strip()


def sand_bed_target(comparisons: Mapping[str, Comparison]) -> Target:
    """Target of the fitted parameters.

    Parameters
    ----------
    comparisons : mapping of str to Comparison
        By wheel; dimensionless.

    Returns
    -------
    Target
        Target of the tested half of all wheels.
    """
    tested = np.concatenate(
        [each.errors(each.fitted, each.tested_half) for each in comparisons.values()]
    )
    return Target(
        'sand bed: RMS of drawbar over load, fitted, on the tested half',
        f'{rms(tested):.4f}',
        f'at most {SAND_BED_LIMIT:g}',
        rms(tested) <= SAND_BED_LIMIT,
    )


def draw_sand_bed(comparisons: Mapping[str, Comparison], path: Path) -> None:
    """Draw drawbar over load against slip, measured, as published and fitted.

    Parameters
    ----------
    comparisons : mapping of str to Comparison
        By wheel; dimensionless.
    path : Path
        PNG to write.
    """
    figure = Figure(figsize=(11, 3.8), layout='constrained')
    for (name, found), axis in zip(
        comparisons.items(), figure.subplots(1, len(comparisons), sharey=True), strict=True
    ):
        slip, measured = found.trials.slip, found.trials.drawbar_ratio
        for half, mark, label in (
            (found.fitted_half, 'o', 'measured, fitted'),
            (found.tested_half, 's', 'measured, tested'),
            (~found.within, 'x', 'measured, braking: not fitted'),
        ):
            axis.plot(slip[half], measured[half], mark, color='#444444', ms=5, label=label)
        axis.plot(slip, found.unfitted.drawbar_ratio, color='#D55E00', label="authors' soil")
        axis.plot(slip, found.fitted.drawbar_ratio, color='#0072B2', label='fitted')
        axis.set_title(name)
        axis.set_xlabel('slip')
        axis.grid(alpha=0.25)
        axis.legend(fontsize=8)
    figure.axes[0].set_ylabel('drawbar over load')
    figure.savefig(path, dpi=90)
