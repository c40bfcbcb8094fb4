"""Shear of the soil on a wheel as a product of stress and area, for every form of contact.

With wheel speeds as states the shear is ``F = stress*thrust_area``: the stress is an input and the
area a term of the matrices. The scheduling parameters of the area depend on the form; there is one
class per form.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from traction_model.contact.contact import Form
from traction_model.soil.soil import COHESION, TAN_PHI

Array = NDArray[np.float64]


class ShearTerms(ABC):
    """Terms of one form; values per wheel have shape (n,).

    Attributes
    ----------
    STRESS : str
        Name of the stress input, proportional to the thrust; Pa.
    PARAMETERS : tuple of str
        Names of the scheduling parameters.
    LEVER : str
        Name of the term for the moment of the shear, over radius and stress, m^2.
    """

    STRESS: ClassVar[str] = 'tau_max'
    PARAMETERS: ClassVar[tuple[str, ...]]
    LEVER: ClassVar[str] = 'thrust_area'

    def stress(self, pressure: Array, soils: Array) -> Array:
        """Stress input, proportional to the thrust.

        Parameters
        ----------
        pressure : ndarray, shape (n,)
            Mean pressure under every wheel, Pa.
        soils : ndarray, shape (n, 17)
            Packed soils, SI units.

        Returns
        -------
        ndarray, shape (n,)
            Strength after Mohr and Coulomb, the paper's (15), Pa.
        """
        return np.asarray(soils[:, COHESION] + pressure * soils[:, TAN_PHI])

    @abstractmethod
    def areas(self, values: Mapping[str, Array], width: Array) -> dict[str, Array]:
        """Terms at a scheduling vector.

        Parameters
        ----------
        values : mapping of str to ndarray
            Scheduling vector, each entry in its parameter's unit.
        width : ndarray, shape (n,)
            Widths of the wheels, m.

        Returns
        -------
        dict of str to ndarray
            ``thrust_area``, m^2, ``resistance_gradient``, N/m, and for stresses over the arc
            ``moment_area``, m^2.
        """


class ArcTerms(ShearTerms):
    """Stresses over the contact arc; the moment has its own mobilisation."""

    PARAMETERS: ClassVar[tuple[str, ...]] = (
        'area',
        'mobilisation',
        'moment_mobilisation',
        'resistance_gradient',
    )
    LEVER = 'moment_area'

    def areas(self, values: Mapping[str, Array], width: Array) -> dict[str, Array]:
        """Terms at a scheduling vector, see `ShearTerms.areas`; m^2 and N/m."""
        return {
            'thrust_area': values['area'] * values['mobilisation'],
            'moment_area': values['area'] * values['moment_mobilisation'],
            'resistance_gradient': values['resistance_gradient'],
        }


class CurveTerms(ShearTerms):
    """Traction curve: mean pressure in place of the strength, which a curve does not have."""

    STRESS = 'pressure'
    PARAMETERS: ClassVar[tuple[str, ...]] = ('area', 'mobilisation', 'resistance_gradient')

    def stress(self, pressure: Array, soils: Array) -> Array:
        """Mean pressure, Pa, see `ShearTerms.stress`."""
        return pressure

    def areas(self, values: Mapping[str, Array], width: Array) -> dict[str, Array]:
        """Terms at a scheduling vector, see `ShearTerms.areas`; m^2 and N/m."""
        return {
            'thrust_area': values['area'] * values['mobilisation'],
            'resistance_gradient': values['resistance_gradient'],
        }


class PlateTerms(ShearTerms):
    """Flat plate with resistance after Bekker, the paper's (25), and a given mobilisation."""

    PARAMETERS: ClassVar[tuple[str, ...]] = (
        'heading',
        'sinkage_exponent',
        'area',
        'load',
        'mobilisation',
    )

    def areas(self, values: Mapping[str, Array], width: Array) -> dict[str, Array]:
        """Terms at a scheduling vector, see `ShearTerms.areas`; m^2 and N/m."""
        # R = N*z/((n + 1)*l), with l = A/b.
        gradient = width * values['load'] / ((values['sinkage_exponent'] + 1) * values['area'])
        return {
            'thrust_area': self._thrust_area(values, width),
            'resistance_gradient': values['heading'] * gradient,
        }

    def _thrust_area(self, values: Mapping[str, Array], width: Array) -> Array:
        return np.asarray(values['area'] * values['mobilisation'])


class PaperTerms(PlateTerms):
    """Flat plate with thrust without the exponential, the paper's (22)."""

    PARAMETERS: ClassVar[tuple[str, ...]] = (
        'heading', 'sinkage_exponent', 'area', 'load', 'shear_deformation_modulus',
        'inverse_slip',
    )  # fmt: skip

    def _thrust_area(self, values: Mapping[str, Array], width: Array) -> Array:
        # A*(1 - kappa) with A = b*l; 0 if kappa exceeds 1.
        inverse = values['inverse_slip']
        lost = width * values['shear_deformation_modulus'] * np.abs(inverse)
        return np.asarray(np.sign(inverse) * np.maximum(0.0, values['area'] - lost))


SHEAR_TERMS: dict[Form, ShearTerms] = {
    Form.PAPER: PaperTerms(),
    Form.BEKKER_WONG: PlateTerms(),
    Form.CONTACT: ArcTerms(),
    Form.EMPIRICAL: CurveTerms(),
}
