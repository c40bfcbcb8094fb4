"""Soil: pressure-sinkage and shear parameters, presets, and soils along a path."""

import math
from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from traction_model.definition import Definition, DefinitionError, build, closest, read_yaml

# Columns of a packed soil, as the kernels index them.
K_C, K_PHI, N_EXP, COHESION, TAN_PHI, SHEAR_MODULUS, DAMPING, SOIL_COLUMNS = range(8)


class Soil(Definition):
    """Bekker pressure-sinkage, Mohr-Coulomb strength and Janosi-Hanamoto shear of one soil.

    Pressure under a plate of width b at sinkage z is ``(k_c/b + k_phi)*z**n``; shear stress at
    shear displacement j is ``(c + sigma*tan(phi))*(1 - exp(-j/K))`` (Agriculture 2024, 14(3),
    499, equations (17) to (21)).

    Attributes
    ----------
    cohesive_modulus : float
        k_c, N/m^(n+1), at least 0.
    frictional_modulus : float
        k_phi, N/m^(n+2), above 0.
    sinkage_exponent : float
        n, dimensionless, above 0 and at most 3.
    cohesion : float
        c, Pa, at least 0.
    friction_angle : float
        phi, rad, at least 0 and below pi/2.
    shear_deformation_modulus : float
        K, m, above 0.
    damping : float
        D, Pa*s/m, at least 0: normal stress per speed at which soil is pressed down.
    """

    cohesive_modulus: float = Field(ge=0)
    frictional_modulus: float = Field(gt=0)
    sinkage_exponent: float = Field(gt=0, le=3)
    cohesion: float = Field(ge=0)
    friction_angle: float = Field(ge=0, lt=math.pi / 2)
    shear_deformation_modulus: float = Field(gt=0)
    damping: float = Field(default=3e4, ge=0)

    def packed(self) -> NDArray[np.float64]:
        """Pack the soil for the kernels.

        Returns
        -------
        ndarray, shape (7,)
            k_c, k_phi, n, c, tan(phi), K, D in SI units.
        """
        return np.array(
            [
                self.cohesive_modulus,
                self.frictional_modulus,
                self.sinkage_exponent,
                self.cohesion,
                math.tan(self.friction_angle),
                self.shear_deformation_modulus,
                self.damping,
            ]
        )

    def max_shear_stress(self, pressure: float) -> float:
        """Mohr-Coulomb shear strength under a mean pressure, equation (18) of the paper.

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


def _soil_from_yaml(content: Any, where: str) -> Soil:
    """Build a soil from YAML, where the friction angle is given in degrees."""
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
        The soils by name.

    Raises
    ------
    DefinitionError
        Naming file, soil and key of what is wrong.
    """
    path = Path(path)
    return {
        name: _soil_from_yaml(content, f'{path}: {name}')
        for name, content in read_yaml(path).items()
    }


@cache
def preset_soils() -> dict[str, Soil]:
    """Return the soils that come with the package, parameters in SI units.

    Returns
    -------
    dict of str to Soil
        The soils of ``presets/soils.yaml`` by name.
    """
    return read_soils(Path(str(files('traction_model') / 'presets' / 'soils.yaml')))


def load_soil(name: str) -> Soil:
    """Return a preset soil.

    Parameters
    ----------
    name : str
        Name in ``presets/soils.yaml``, or ``file.yaml:name`` for a soil of one's own.

    Returns
    -------
    Soil
        The soil, parameters in SI units.

    Raises
    ------
    DefinitionError
        If there is no such soil; the text names the nearest one.
    """
    path, _, own = name.rpartition(':')
    if own.endswith(('.yaml', '.yml')):
        raise DefinitionError(f"'{name}': say which soil of the file, as in file.yaml:name")
    soils = read_soils(path) if path else preset_soils()
    if own not in soils:
        raise DefinitionError(f"unknown soil '{own}'{closest(own, soils)}")
    return soils[own]


class Terrain:
    """Soils along the path of a vehicle.

    Parameters
    ----------
    soils : Soil or sequence of Soil
        The soils in the order in which they are met.
    starts : sequence of float
        Where each soil but the first begins, m along the path from where the rear axle
        starts, strictly increasing.

    Raises
    ------
    ValueError
        If the numbers of soils and starts do not fit, or starts do not increase.
    """

    def __init__(self, soils: Soil | Sequence[Soil], starts: Sequence[float] = ()) -> None:
        self.soils = (soils,) if isinstance(soils, Soil) else tuple(soils)
        if len(self.soils) != len(starts) + 1:
            raise ValueError(
                f'{len(self.soils)} soils need {len(self.soils) - 1} starts, got {len(starts)}'
            )
        self.starts = np.array([-np.inf, *starts])
        if not np.all(np.isfinite(self.starts[1:])) or np.any(np.diff(self.starts) <= 0):
            raise ValueError(f'starts of soils must be finite and increase, got {list(starts)} m')
        self.packed = np.array([soil.packed() for soil in self.soils])
