"""Error of a representation of an LPV model."""

from collections.abc import Sequence

import numpy as np

from traction_model.lpv.matrices import Matrices


def relative_error(exact: Sequence[Matrices], found: Sequence[Matrices]) -> float:
    """Largest difference of any entry of A, B and B_uc over its largest magnitude.

    Parameters
    ----------
    exact, found : sequence of Matrices
        Exact and approximate matrices for the same samples, in the units of a model.

    Returns
    -------
    float
        Relative to the largest magnitude of the entry over the samples, dimensionless.
    """
    worst = 0.0
    for name in ('A', 'B', 'B_uc'):
        wanted = np.array([getattr(entry, name) for entry in exact])
        got = np.array([getattr(entry, name) for entry in found])
        size = np.abs(wanted).max(axis=0)
        difference = np.abs(got - wanted).max(axis=0)
        # The relative error of an entry that should always be zero is infinite.
        with np.errstate(divide='ignore'):
            relative = np.divide(difference, size, out=np.zeros_like(size), where=difference > 0)
        worst = max(worst, float(relative.max()))
    return worst
