"""Error of a representation of an LPV model."""

from collections.abc import Sequence

import numpy as np

from traction_model.lpv.matrices import Matrices


def relative_error(exact: Sequence[Matrices], found: Sequence[Matrices]) -> float:
    """Largest difference of any entry of A, B and B_uc over its largest magnitude.

    Parameters
    ----------
    exact, found : sequence of Matrices
        The exact matrices and those to judge, of equally many samples, in the units of a model.

    Returns
    -------
    float
        Relative to the largest magnitude that an entry has over the samples, dimensionless.
    """
    worst = 0.0
    for name in ('A', 'B', 'B_uc'):
        wanted = np.array([getattr(entry, name) for entry in exact])
        got = np.array([getattr(entry, name) for entry in found])
        size = np.abs(wanted).max(axis=0)
        difference = np.abs(got - wanted).max(axis=0)
        # An entry that is always zero and is not found so has an infinite relative error.
        with np.errstate(divide='ignore'):
            relative = np.divide(difference, size, out=np.zeros_like(size), where=difference > 0)
        worst = max(worst, float(relative.max()))
    return worst
