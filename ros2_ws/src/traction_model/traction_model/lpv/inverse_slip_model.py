"""LPV model with 1/slip as states; the paper's (22) is linear in them."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_model.lpv.scheduling import Schedule, SchedulingParameter
from traction_model.lpv.slip_model import SlipLpvModel

Array = NDArray[np.float64]

LARGEST_INVERSE_SLIP = 100.0
"""Bound of |1/i|, dimensionless, against rounding and noise."""


class InverseSlipLpvModel(SlipLpvModel):
    """LPV model with x = [v, 1/slip ...], else as `traction_model.lpv.slip_model.SlipLpvModel`.

    It is not defined for slips within -0.01 to 0.01.
    """

    _state = 'inverse_slip'

    def _state_range(self) -> SchedulingParameter:
        return self._range(
            'inverse_slip', '1', -LARGEST_INVERSE_SLIP, LARGEST_INVERSE_SLIP, reciprocal=True
        )

    def _state_of(self, slipping: Array) -> Array:
        return np.array([1 / value if value else np.inf for value in slipping])

    def _state_slope(self, slipping: Array) -> Array:
        # (1/i)' = -i'/i^2.
        return np.asarray(-1 / slipping**2)

    def terms(self, rho: Schedule | Mapping[str, ArrayLike]) -> dict[str, Array]:
        """Terms of the matrices at a scheduling vector.

        Parameters
        ----------
        rho : Schedule or mapping
            Scheduling vector, each entry in its parameter's unit.

        Returns
        -------
        dict of str to ndarray
            As `SlipLpvModel.terms`, with ``slip``, dimensionless, from ``inverse_slip``.

        Raises
        ------
        ValueError
            As `schedule`.
        """
        return {
            'slip' if name == 'inverse_slip' else name: (
                1 / entries if name == 'inverse_slip' else entries
            )
            for name, entries in super().terms(rho).items()
        }
