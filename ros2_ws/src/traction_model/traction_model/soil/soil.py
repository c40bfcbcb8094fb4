"""Soil: pressure-sinkage and shear laws and their parameters, and presets.

Sources: M. G. Bekker, Introduction to Terrain-Vehicle Systems, 1969; A. R. Reece, Principles of
soil-vehicle mechanics, 1965; J. Y. Wong, Terramechanics and Off-Road Vehicle Engineering, 2009
(for Bernstein's, Janosi and Hanamoto's, and Wong and Preston-Thomas's laws); V. V. Kacigin and
V. V. Guskov, The basis of tractor performance theory, J. Terramechanics 5(3), 1968.
"""

import math
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from traction_model.definition import Definition, DefinitionError, build, read_yaml
from traction_model.soil.empirical import CURVE_COLUMNS, Brixius, Burckhardt, Pacejka
from traction_model.vehicle.wheel import Wheel
from traction_node.closest import closest

# Columns of a packed soil, as the kernels index them.
MODULUS, N_EXP, COHESION, TAN_PHI, SHEAR_MODULUS, DAMPING = range(6)
ELASTIC_MODULUS, SHEAR_LAW, RESIDUAL, HUMP, SHEAR_MEMORY, CURVE = range(6, 12)

PressureLaw = Literal['bekker', 'bernstein', 'reece']
ShearLaw = Literal['janosi_hanamoto', 'wong_preston_thomas', 'kacigin_guskov']
# The same as integers, for kernels.
JANOSI_HANAMOTO, WONG_PRESTON_THOMAS, KACIGIN_GUSKOV = range(3)
SHEAR_LAWS = {
    'janosi_hanamoto': JANOSI_HANAMOTO,
    'wong_preston_thomas': WONG_PRESTON_THOMAS,
    'kacigin_guskov': KACIGIN_GUSKOV,
}


class Soil(Definition):
    """Pressure-sinkage, Mohr-Coulomb strength and shear-displacement law of one soil.

    Pressure under a plate of width b at sinkage z is ``k*z**n``, with k by Bekker
    ``k_c/b + k_phi``, by Reece ``(c*k_c' + gamma*b*k_phi')/b**n``, and by Bernstein a constant
    with ``n = 0.5``. Shear stress at shear displacement j is ``(c + sigma*tan(phi))*g(j)``
    (Agriculture 2024, 14(3), 499, equations (9) to (19)), with g by `shear_law`:

    - ``janosi_hanamoto``: ``1 - exp(-j/K)``, without a peak;
    - ``wong_preston_thomas``: ``R*(1 + h*exp(1 - j/K))*(1 - exp(-j/K))``, a peak that falls to
      R, the `residual_ratio`, with h such that it is 1 at ``j = K``; its maximum is within 8 % of
      1, at 0.7 to 1.7 times K;
    - ``kacigin_guskov``: ``tanh(j/K)*(1 + f/cosh(j/K))`` over its maximum, with f such that it
      falls to `residual_ratio`: organic terrain.

    Attributes
    ----------
    pressure_law : {'bekker', 'bernstein', 'reece'}
        Pressure-sinkage law.
    cohesive_modulus : float
        k_c, N/m^(n+1), at least 0; Reece's k_c', dimensionless.
    frictional_modulus : float
        k_phi, N/m^(n+2), above 0; Bernstein's k, N/m^2.5; Reece's k_phi', dimensionless.
    sinkage_exponent : float
        n, dimensionless, above 0 and at most 3; 0.5 by Bernstein.
    unit_weight : float, optional
        gamma, N/m^3, above 0; only for Reece.
    cohesion : float
        c, Pa, at least 0.
    friction_angle : float
        phi, rad, at least 0 and below pi/2.
    shear_law : {'janosi_hanamoto', 'wong_preston_thomas', 'kacigin_guskov'}
        Law of shear stress over shear displacement.
    shear_deformation_modulus : float
        K, m, above 0.
    residual_ratio : float, optional
        Residual over maximum shear stress, dimensionless, within (0, 1); for the laws with a peak.
    damping : float
        D, Pa*s/m, at least 0: normal stress per rate of compression.
    elastic_modulus : float, optional
        Pa/m, above 0: slope of unloading and reloading; None: no elastic rebound.
    shear_memory : float
        Share of the shear displacement that remains for the next wheel in the rut, 0 to 1.
    traction_curve : Brixius, Burckhardt or Pacejka, optional
        Traction over slip, dimensionless, for the contact form `EMPIRICAL`.
    """

    pressure_law: PressureLaw = 'bekker'
    cohesive_modulus: float = Field(default=0.0, ge=0)
    frictional_modulus: float = Field(gt=0)
    sinkage_exponent: float = Field(default=0.5, gt=0, le=3)
    unit_weight: float | None = Field(default=None, gt=0)
    cohesion: float = Field(ge=0)
    friction_angle: float = Field(ge=0, lt=math.pi / 2)
    shear_law: ShearLaw = 'janosi_hanamoto'
    shear_deformation_modulus: float = Field(gt=0)
    residual_ratio: float | None = Field(default=None, gt=0, lt=1)
    damping: float = Field(default=3e4, ge=0)
    elastic_modulus: float | None = Field(default=None, gt=0)
    shear_memory: float = Field(default=1.0, ge=0, le=1)
    traction_curve: Brixius | Burckhardt | Pacejka | None = None

    @model_validator(mode='after')
    def _parameters_of_the_laws(self) -> 'Soil':
        given = self.model_fields_set
        if self.pressure_law == 'bernstein':
            if self.cohesive_modulus != 0 or self.sinkage_exponent != 0.5:
                raise ValueError(
                    'bernstein takes frictional_modulus only: cohesive_modulus is 0 and '
                    'sinkage_exponent 0.5'
                )
        else:
            for name in ('cohesive_modulus', 'sinkage_exponent'):
                if name not in given:
                    raise ValueError(f'{name} is missing: {self.pressure_law} needs it')
        if (self.pressure_law == 'reece') != (self.unit_weight is not None):
            raise ValueError('unit_weight goes with the pressure_law reece, and only with it')
        if (self.shear_law == 'janosi_hanamoto') != (self.residual_ratio is None):
            raise ValueError(
                'residual_ratio goes with the shear_law wong_preston_thomas or kacigin_guskov, '
                'and only with them'
            )
        return self

    def sinkage_modulus(self, width: float) -> float:
        """Pressure over ``z**n`` under a plate.

        Parameters
        ----------
        width : float
            b, m, above 0: smaller dimension of the plate.

        Returns
        -------
        float
            k, N/m^(n+2).
        """
        if self.unit_weight is None:
            return self.cohesive_modulus / width + self.frictional_modulus
        strength = self.cohesion * self.cohesive_modulus
        strength += self.unit_weight * width * self.frictional_modulus
        return float(strength / width**self.sinkage_exponent)

    def packed(self, wheel: Wheel) -> NDArray[np.float64]:
        """Packed soil for a wheel, for kernels.

        Grousers increase its strength; see `traction_model.vehicle.wheel.Wheel`.

        Parameters
        ----------
        wheel : Wheel
            Wheel, for width and grousers; SI units.

        Returns
        -------
        ndarray, shape (17,)
            k, n, c, tan(phi), K, D, elastic modulus (infinite if none), number of the shear law,
            residual ratio, parameter of the peak, shear memory, packed traction curve (NaN if
            none); SI units.
        """
        on_cohesion, on_friction = wheel.grip
        law = SHEAR_LAWS[self.shear_law]
        residual = self.residual_ratio or 1.0
        curve = self.traction_curve
        return np.array(
            [
                self.sinkage_modulus(wheel.width),
                self.sinkage_exponent,
                self.cohesion * on_cohesion,
                math.tan(self.friction_angle) * on_friction,
                self.shear_deformation_modulus,
                self.damping,
                math.inf if self.elastic_modulus is None else self.elastic_modulus,
                law,
                residual,
                HUMPS[law](residual),
                self.shear_memory,
                *(np.full(CURVE_COLUMNS, np.nan) if curve is None else curve.packed()),
            ]
        )

    def sheared(self, strength: float, modulus: float = 1.0) -> 'Soil':
        """Soil with scaled shear parameters and the same pressure-sinkage law.

        Parameters
        ----------
        strength : float
            Factor on cohesion and tan(phi), and so on the shear strength, dimensionless, above 0.
        modulus : float
            Factor on the shear deformation modulus, dimensionless, above 0.

        Returns
        -------
        Soil
            The soil, in SI units.
        """
        return self.model_copy(
            update={
                'cohesion': self.cohesion * strength,
                'friction_angle': math.atan(strength * math.tan(self.friction_angle)),
                'shear_deformation_modulus': self.shear_deformation_modulus * modulus,
            }
        )

    def max_shear_stress(self, pressure: float) -> float:
        """Mohr-Coulomb shear strength under a mean pressure, equation (15) of the paper.

        Parameters
        ----------
        pressure : float
            Mean normal stress, Pa, at least 0.

        Returns
        -------
        float
            tau_max, Pa.
        """
        return self.cohesion + pressure * math.tan(self.friction_angle)


def _wong_hump(residual: float) -> float:
    """Factor that makes Wong and Preston-Thomas's curve 1 at ``j = K``."""
    return 1 / (residual * (1 - 1 / math.e)) - 1


def _guskov_hump(residual: float) -> float:
    """Factor f of Kacigin and Guskov's curve with a given residual over greatest stress.

    With ``s = 1/cosh(u)`` the curve ``tanh(u)*(1 + f*s)`` has its maximum at
    ``f = s/(1 - 2*s^2)``, with the value ``(1 - s^2)^1.5/(1 - 2*s^2)``, which grows with s.
    """
    low, high = 0.0, math.sqrt(0.5)
    for _ in range(60):
        s = (low + high) / 2
        if (1 - s * s) ** 1.5 * residual < 1 - 2 * s * s:
            low = s
        else:
            high = s
    return low / (1 - 2 * low * low)


# By number of the law.
HUMPS = (lambda residual: 0.0, _wong_hump, _guskov_hump)


def _soil_from_yaml(content: Any, where: str) -> Soil:
    """Soil from YAML, with the friction angle in degrees."""
    if not isinstance(content, dict):
        raise DefinitionError(f'{where}: expected a mapping of soil parameters')
    content = {key: value for key, value in content.items() if key != 'source'}
    if 'friction_angle' in content:
        raise DefinitionError(
            f'{where}: friction_angle: give friction_angle_deg instead, in degrees'
        )
    known = Soil.model_fields.keys() - {'friction_angle'} | {'friction_angle_deg'}
    for key in content:
        if key not in known:
            raise DefinitionError(f'{where}: {key}: unknown key{closest(str(key), known)}')
    if 'friction_angle_deg' not in content:
        raise DefinitionError(f'{where}: friction_angle_deg: missing')
    angle = content.pop('friction_angle_deg')
    if not isinstance(angle, int | float) or not 0 <= angle < 90:
        raise DefinitionError(
            f'{where}: friction_angle_deg: must be at least 0 and below 90, got {angle!r}'
        )
    return build(Soil, content | {'friction_angle': math.radians(angle)}, where)


def read_soils(path: str | Path) -> dict[str, Soil]:
    """Read all soils of a YAML file laid out as ``presets/soils.yaml``.

    Parameters
    ----------
    path : str or Path
        YAML file, a mapping from name to soil parameters in SI units
        (``friction_angle_deg`` in degrees).

    Returns
    -------
    dict of str to Soil
        Soils by name.

    Raises
    ------
    DefinitionError
        If a soil is invalid; the text has file, soil and key.
    """
    path = Path(path)
    return {
        name: _soil_from_yaml(content, f'{path}: {name}')
        for name, content in read_yaml(path).items()
    }


@cache
def preset_soils() -> dict[str, Soil]:
    """Soils of the package, parameters in SI units.

    Returns
    -------
    dict of str to Soil
        The soils of ``presets/soils.yaml`` by name.
    """
    return read_soils(Path(str(files('traction_model') / 'presets' / 'soils.yaml')))


def load_soil(name: str, folder: str | Path = '') -> Soil:
    """Soil from the presets or from a file.

    Parameters
    ----------
    name : str
        Name in ``presets/soils.yaml``, or ``file.yaml:name``.
    folder : str or Path
        Folder of the file; default: the current one.

    Returns
    -------
    Soil
        The soil, parameters in SI units.

    Raises
    ------
    DefinitionError
        If there is no such soil; the text has the nearest name.
    """
    file, _, own = name.rpartition(':')
    if own.endswith(('.yaml', '.yml')):
        raise DefinitionError(f"'{name}': say which soil of the file, as in file.yaml:name")
    path = Path(folder, file)
    soils = read_soils(path) if file else preset_soils()
    if own not in soils:
        where = f'{path}: ' if file else ''
        raise DefinitionError(f"{where}unknown soil '{own}'{closest(own, soils)}")
    return soils[own]
