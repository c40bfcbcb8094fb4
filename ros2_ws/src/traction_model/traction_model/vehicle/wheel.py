"""Wheel: size, inertia and friction of one wheel."""

import math

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from traction_model.definition import Definition

# Columns of a packed wheel, as the kernels index them.
RADIUS, WIDTH, INERTIA, FRICTION, POSITION, STATIC_LOAD, TRACK = range(7)


class Wheel(Definition):
    """Rigid driven wheel.

    Grousers shear soil at the sides of the block between them, too. After Bekker (Introduction to
    Terrain-Vehicle Systems, 1969) cohesion has the factor ``1 + 2*h/b`` and ``tan(phi)`` the
    factor ``1 + 0.64*(h/b)*atan(b/h)``.

    Attributes
    ----------
    radius : float
        r, m, above 0: rolling radius.
    width : float
        b, m, above 0: width of the tread in contact with soil.
    inertia : float
        J, kg*m^2, above 0: of the wheel and all that turns with it, about its axle.
    viscous_friction : float
        b_f, N·m·s/rad, at least 0: friction torque of the drive per wheel speed.
    mass : float
        kg, at least 0; not part of the mass of the chassis.
    grouser_height : float
        h, m, at least 0: height of the lugs beyond `radius`.
    """

    radius: float = Field(gt=0)
    width: float = Field(gt=0)
    inertia: float = Field(gt=0)
    viscous_friction: float = Field(default=0.0, ge=0)
    mass: float = Field(default=0.0, ge=0)
    grouser_height: float = Field(default=0.0, ge=0)

    @property
    def grip(self) -> tuple[float, float]:
        """Factors of the grousers on cohesion and on ``tan(phi)``, dimensionless, at least 1."""
        share = self.grouser_height / self.width
        if share == 0.0:
            return 1.0, 1.0
        return 1 + 2 * share, 1 + 0.64 * share * math.atan(1 / share)

    def contact_length(self, sinkage: float) -> float:
        """Length of the arc in contact with flat soil.

        Parameters
        ----------
        sinkage : float
            m, 0 to `radius`.

        Returns
        -------
        float
            m.

        Raises
        ------
        ValueError
            If the sinkage is out of its range.
        """
        if not 0 <= sinkage <= self.radius:
            raise ValueError(f'sinkage must be 0 to {self.radius:g} m, got {sinkage}')
        return self.radius * math.acos(1.0 - sinkage / self.radius)

    def packed(
        self, position: float = 0.0, static_load: float = 0.0, track: int = -1
    ) -> NDArray[np.float64]:
        """Packed wheel, for kernels.

        Parameters
        ----------
        position : float
            m ahead of the rear axle.
        static_load : float
            Upward force of the soil at rest, N.
        track : int
            Index of its rut, -1 for none.

        Returns
        -------
        ndarray, shape (7,)
            r, b, J, b_f, position, static load, track in SI units.
        """
        return np.array(
            [
                self.radius, self.width, self.inertia, self.viscous_friction,
                position, static_load, track,
            ]
        )  # fmt: skip
