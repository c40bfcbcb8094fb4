"""Wheel: size, inertia and friction of one wheel."""

from pydantic import Field

from traction_model.definition import Definition


class Wheel(Definition):
    """A rigid driven wheel.

    Attributes
    ----------
    radius : float
        r, m, above 0: rolling radius.
    width : float
        b, m, above 0: width of the tread in contact with soil.
    inertia : float
        J, kg*m^2, above 0: of the wheel and all that turns with it, about its axle.
    viscous_friction : float
        b_f, N*m*s/rad, at least 0: friction torque of the drive per wheel speed.
    mass : float
        kg, at least 0: carried by the soil but not part of the chassis.
    """

    radius: float = Field(gt=0)
    width: float = Field(gt=0)
    inertia: float = Field(gt=0)
    viscous_friction: float = Field(default=0.0, ge=0)
    mass: float = Field(default=0.0, ge=0)
