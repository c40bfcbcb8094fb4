"""Soil's shear on a wheel as a product of stress and area, for every form of the contact model.

With wheel speeds as states the shear is ``F = stress*thrust_area``, the stress an input and the
area a term of the matrices. What the area follows from, and so what schedules the matrices,
depends on the form: one class each.
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
    """Terms of one form; what is by wheel has shape (n,).

    Attributes
    ----------
    STRESS : str
        Name of the input that the thrust is proportional to; Pa.
    PARAMETERS : tuple of str
        Names of the scheduling parameters.
    LEVER : str
        Term that gives the shear's moment over radius per stress, m^2.
    """

    STRESS: ClassVar[str] = 'tau_max'
    PARAMETERS: ClassVar[tuple[str, ...]]
    LEVER: ClassVar[str] = 'thrust_area'

    def stress(self, pressure: Array, soils: Array) -> Array:
        """Stress that the thrust is proportional to.

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
    """Stresses over the contact arc: the moment has a mobilisation of its own."""

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
    """Traction curve: the mean pressure stands for the strength, which a curve does not know."""

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
        # A*(1 - kappa) with A = b*l; none where kappa exceeds 1.
        inverse = values['inverse_slip']
        lost = width * values['shear_deformation_modulus'] * np.abs(inverse)
        return np.asarray(np.sign(inverse) * np.maximum(0.0, values['area'] - lost))


SHEAR_TERMS: dict[Form, ShearTerms] = {
    Form.PAPER: PaperTerms(),
    Form.BEKKER_WONG: PlateTerms(),
    Form.CONTACT: ArcTerms(),
    Form.EMPIRICAL: CurveTerms(),
}
