"""Quasi-static contact of a wheel on soil that is known by a few factors, for estimation.

The soil under a wheel is the nominal one times three factors, each by its logarithm: strength
(cohesion and tan(phi)), shear deformation modulus K, and sinkage modulus k. The wheel neither
rises nor sinks: sinkage is that at which the soil carries the load.
"""

import math

from traction_model.contact.contact import EVERYWHERE, arc_contact, sinkage_at
from traction_model.kernel import kernel
from traction_model.soil.soil import COHESION, MODULUS, SHEAR_MODULUS, TAN_PHI
from traction_model.vehicle.wheel import RADIUS, TRACK, WIDTH

CONTACT = 2
"""Number of the contact form that this uses, `traction_model.contact.contact.Form.CONTACT`."""


@kernel
def quasi_static(v, omega, load, place, factors, nominal, wheel, ruts, guess, soil):
    """Moment, resistance and sinkage of a wheel that carries a load and slips steadily.

    Parameters
    ----------
    v, omega : float
        Speed of the centre, m/s, and wheel speed, rad/s, forward positive.
    load : float
        On the wheel, N.
    place : float
        Of the wheel along the path, m.
    factors : tuple of float
        Logarithms of the factors on strength, shear deformation modulus and sinkage modulus,
        dimensionless.
    nominal : ndarray, shape (17,)
        The packed nominal soil, SI units.
    wheel : ndarray, shape (7,)
        The packed wheel, SI units.
    ruts : Ruts
        What wheels have left so far.
    guess : float
        Sinkage to begin with, m.
    soil : ndarray, shape (1, 17)
        Out: the soil with its factors, SI units.

    Returns
    -------
    moment, resistance, strength_moment, sinkage, shear : float
        N·m about the wheel's centre, positive when it resists; motion resistance, N; the part
        of the moment that is proportional to strength, N·m; m; shear displacement of the soil
        as it is left, m.
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
