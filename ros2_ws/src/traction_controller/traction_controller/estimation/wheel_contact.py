"""Quasi-static wheel-soil contact for estimation, with three factors on the nominal soil.

The factors apply to strength (cohesion and tan(phi)), shear deformation modulus K, and sinkage
modulus k; each is given by its logarithm. The wheel has no vertical motion: at its sinkage the
soil carries the load.
"""

import math

from traction_model.contact.contact import EVERYWHERE, arc_contact, sinkage_at
from traction_model.kernel import kernel
from traction_model.soil.soil import COHESION, MODULUS, SHEAR_MODULUS, TAN_PHI
from traction_model.vehicle.wheel import RADIUS, TRACK, WIDTH

CONTACT = 2
"""Contact form in use, `traction_model.contact.contact.Form.CONTACT`."""


@kernel
def quasi_static(v, omega, load, place, factors, nominal, wheel, ruts, guess, soil):
    """Moment, motion resistance and sinkage of a wheel at steady load and slip.

    Parameters
    ----------
    v, omega : float
        Speed of the centre, m/s, and wheel speed, rad/s, forward positive.
    load : float
        Load of the wheel, N.
    place : float
        Position of the wheel along the path, m.
    factors : tuple of float
        Logarithms of the factors on strength, shear deformation modulus and sinkage modulus,
        dimensionless.
    nominal : ndarray, shape (17,)
        The packed nominal soil, SI units.
    wheel : ndarray, shape (7,)
        The packed wheel, SI units.
    ruts : Ruts
        Ruts of the wheels so far.
    guess : float
        Initial value of the sinkage for the solver, m.
    soil : ndarray, shape (1, 17)
        Out: the soil with its factors, SI units.

    Returns
    -------
    moment, resistance, strength_moment, sinkage, shear : float
        Moment about the wheel's centre, N·m, positive when it resists; motion resistance, N; part
        of the moment proportional to strength, N·m; sinkage, m; shear displacement left in the
        rut, m.
    """
    soil[0, :] = nominal
    strength = math.exp(factors[0])
    soil[0, COHESION] *= strength
    soil[0, TAN_PHI] *= strength
    soil[0, SHEAR_MODULUS] *= math.exp(factors[1])
    soil[0, MODULUS] *= math.exp(factors[2])
    track = int(wheel[TRACK])
    z = sinkage_at(
        CONTACT, v, omega, load, place, soil, EVERYWHERE, wheel[RADIUS], wheel[WIDTH], track,
        ruts, guess,
    )  # fmt: skip
    _, _, resistance, moment, shear = arc_contact(
        v, omega, z, 0.0, place, soil, EVERYWHERE, wheel[RADIUS], wheel[WIDTH], track, ruts,
        load, 0.0,
    )  # fmt: skip
    return moment, resistance, moment - wheel[RADIUS] * resistance, z, shear
