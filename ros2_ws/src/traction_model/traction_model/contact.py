"""Contact of one wheel with soil: load, thrust, motion resistance and moment in four forms.

All forms share one interface: from speed, wheel speed, sinkage and its rate they give

- ``load`` N, the soil's upward force on the wheel,
- ``thrust`` F and ``resistance`` R, whose difference is the net horizontal force,
- ``moment`` M, the soil's moment about the wheel's centre, positive when it resists.

Sources: Agriculture 2024, 14(3), 499 (*the paper*), equations (17) to (25); M. G. Bekker,
Introduction to Terrain-Vehicle Systems, 1969; J. Y. Wong and A. R. Reece, Prediction of rigid
wheel performance, J. Terramechanics 4(1), 1967.
"""

import math
from enum import IntEnum

import numpy as np

from traction_model.kernel import kernel
from traction_model.slip import slip
from traction_model.soil import COHESION, DAMPING, K_C, K_PHI, N_EXP, SHEAR_MODULUS, TAN_PHI


class Form(IntEnum):
    """Form of the contact model.

    Attributes
    ----------
    PAPER
        Thrust with kappa = 1/y, the paper's (22): right above about 10 % slip only.
    BEKKER_WONG
        Thrust with kappa = (1 - exp(-y))/y, the paper's (21).
    CONTACT
        Stresses integrated over the contact arc, after Wong and Reece.
    """

    PAPER = 0
    BEKKER_WONG = 1
    CONTACT = 2


LEAST_TRANSIT_SPEED = 0.05
"""Speed below which soil is taken to pass under the wheel at this speed, m/s.

It bounds the shear displacement at standstill, where the stress integral has no limit.
"""

_NODES, _WEIGHTS = (array for array in np.polynomial.legendre.leggauss(16))
# On (0, 1), for each of the two parts of the contact in which shear has one direction.
NODES = (_NODES + 1) / 2
WEIGHTS = _WEIGHTS / 2


@kernel
def shear_deficit(y):
    """Share of the shear strength not yet mobilised along the contact, the paper's kappa (21).

    Parameters
    ----------
    y : float
        Shear displacement at the contact's end over K, ``|slip|*l/K``, dimensionless, >= 0.

    Returns
    -------
    float
        ``(1 - exp(-y))/y``, from 1 at y = 0 towards 0.
    """
    if y < 1e-4:
        # Two terms of the series; the third is below 2e-9.
        return 1.0 - y / 2.0
    return -math.expm1(-y) / y


@kernel
def plate_contact(form, v, omega, z, z_rate, soil, radius, width):
    """Forces on a wheel by the closed forms `PAPER` and `BEKKER_WONG`.

    The contact is a flat plate of width b and of the length the sinkage gives it,
    ``sqrt(2*r*z - z^2)``; resistance is Bekker's compaction resistance (25).

    Parameters
    ----------
    form : int
        ``Form.PAPER`` or ``Form.BEKKER_WONG``.
    v, omega : float
        Speed of the centre, m/s, and wheel speed, rad/s, forward positive.
    z, z_rate : float
        Sinkage, m, and its rate, m/s, downward positive.
    soil : ndarray, shape (7,)
        A packed soil, SI units.
    radius, width : float
        r and b, m.

    Returns
    -------
    load, thrust, resistance, moment : float
        N, N, N, N*m. `PAPER` gives no thrust where its kappa exceeds 1 (below about 10 %
        slip), where the formula would push the wrong way.
    """
    if z <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    z = min(z, radius)
    length = math.sqrt(2.0 * radius * z - z * z)
    area = width * length
    pressure = (soil[K_C] / width + soil[K_PHI]) * z ** soil[N_EXP]
    load = area * (pressure + soil[DAMPING] * max(z_rate, 0.0))
    strength = soil[COHESION] + load / area * soil[TAN_PHI]

    slipping = slip(v, radius * omega)
    y = abs(slipping) * length / soil[SHEAR_MODULUS]
    if form == 0:
        kappa = min(1.0, 1.0 / y) if y > 0.0 else 1.0
    else:
        kappa = shear_deficit(y)
    direction = 1.0 if radius * omega >= v else -1.0
    thrust = direction * strength * area * (1.0 - kappa)
    # Fades out at standstill, where resistance has no direction.
    rolling = max(-1.0, min(1.0, v / LEAST_TRANSIT_SPEED))
    resistance = rolling * width * load * z / ((soil[N_EXP] + 1.0) * area)
    return load, thrust, resistance, radius * thrust


@kernel
def arc_contact(v, omega, z, z_rate, soil, radius, width):
    """Forces on a wheel by stresses integrated over the contact arc, form `CONTACT`.

    Soil enters at ``theta0 = acos(1 - z/r)`` and leaves at the bottom. Normal stress acts
    vertically, shear stress horizontally, both per horizontal area, as in Chrono's SCM. The
    shear displacement is integrated in closed form; where the rim is slower than the ground
    (near the entry) soil is sheared backwards.

    Parameters
    ----------
    v, omega : float
        Speed of the centre, m/s, and wheel speed, rad/s, forward positive.
    z, z_rate : float
        Sinkage, m, and its rate, m/s, downward positive.
    soil : ndarray, shape (7,)
        A packed soil, SI units.
    radius, width : float
        r and b, m.

    Returns
    -------
    load, thrust, resistance, moment : float
        N, N, N, N*m.
    """
    if z <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    # In reverse the same wheel, seen from the other side.
    heading = 1.0
    if v < 0.0 or (v == 0.0 and omega < 0.0):
        heading, v, omega = -1.0, -v, -omega
    transit = max(v, LEAST_TRANSIT_SPEED)
    rim = radius * omega

    entry = math.acos(max(0.0, 1.0 - z / radius))
    cos_entry = math.cos(entry)
    stiffness = (soil[K_C] / width + soil[K_PHI]) * radius ** soil[N_EXP]

    # Antiderivative of the rim's speed over the ground, (rim*cos s - v)*cos s, at the entry
    # and where that speed changes sign, if it does within the contact.
    at_entry = rim * (entry + math.sin(entry) * cos_entry) / 2.0 - v * math.sin(entry)
    turning = min(entry, math.acos(v / rim)) if rim > v else 0.0
    at_turning = rim * (turning + math.sin(turning) * math.cos(turning)) / 2.0
    at_turning -= v * math.sin(turning)

    load = 0.0
    net = 0.0
    shear_moment = 0.0
    compaction = 0.0
    # Shear stress jumps at the turning: each side is integrated by itself, so that forces are
    # continuous in speed and sinkage.
    for side in range(2):
        start = 0.0 if side == 0 else turning
        span = (turning if side == 0 else entry) - start
        if span <= 0.0:
            continue
        direction = 1.0 if side == 0 else -1.0
        for k in range(NODES.size):
            theta = start + span * NODES[k]
            cos_theta = math.cos(theta)
            sin_theta = math.sin(theta)
            sigma = stiffness * max(cos_theta - cos_entry, 0.0) ** soil[N_EXP]
            sigma += soil[DAMPING] * max(z_rate + rim * sin_theta, 0.0)

            swept = rim * (theta + sin_theta * cos_theta) / 2.0 - v * sin_theta
            if side == 0:
                path = (at_turning - at_entry) + (at_turning - swept)
            else:
                path = swept - at_entry
            displacement = max(path, 0.0) * radius / transit
            tau = direction * (soil[COHESION] + sigma * soil[TAN_PHI])
            tau *= -math.expm1(-displacement / soil[SHEAR_MODULUS])

            area = span * WEIGHTS[k] * cos_theta
            load += sigma * area
            net += tau * area
            shear_moment += tau * cos_theta * area
            compaction += sigma * sin_theta * area
    element = width * radius
    # Soil is pushed ahead only by a wheel that moves on.
    resistance = heading * min(1.0, v / transit) * compaction * element
    moment = heading * radius * shear_moment * element + radius * resistance
    return load * element, heading * net * element + resistance, resistance, moment


@kernel
def contact(form, v, omega, z, z_rate, soil, radius, width):
    """Forces on one wheel, by any form.

    Parameters
    ----------
    form : int
        A `Form`.
    v, omega : float
        Speed of the centre, m/s, and wheel speed, rad/s, forward positive.
    z, z_rate : float
        Sinkage, m, and its rate, m/s, downward positive.
    soil : ndarray, shape (7,)
        A packed soil, SI units.
    radius, width : float
        r and b, m.

    Returns
    -------
    load, thrust, resistance, moment : float
        N, N, N, N*m: load on the wheel, thrust, motion resistance, moment about its centre.
    """
    if form == 2:
        return arc_contact(v, omega, z, z_rate, soil, radius, width)
    return plate_contact(form, v, omega, z, z_rate, soil, radius, width)


@kernel
def equilibrium_sinkage(form, v, omega, load, soil, radius, width):
    """Sinkage at which the soil carries a load while the wheel neither rises nor sinks.

    False position on (0, r) with the Illinois step, to 0.1 um or a millionth of the load.

    Parameters
    ----------
    form : int
        A `Form`.
    v, omega : float
        Speed of the centre, m/s, and wheel speed, rad/s, forward positive.
    load : float
        Load to carry, N.
    soil : ndarray, shape (7,)
        A packed soil, SI units.
    radius, width : float
        r and b, m.

    Returns
    -------
    float
        Sinkage, m; 0 for no load, and r where even that depth does not carry the load.
    """
    if load <= 0.0:
        return 0.0
    low, high = 0.0, radius
    at_low = -load
    at_high = contact(form, v, omega, high, 0.0, soil, radius, width)[0] - load
    if at_high <= 0.0:
        return radius
    z = low
    side = 0
    for _ in range(100):
        z = (low * at_high - high * at_low) / (at_high - at_low)
        at_z = contact(form, v, omega, z, 0.0, soil, radius, width)[0] - load
        if abs(at_z) < 1e-6 * load or high - low < 1e-7:
            break
        if at_z < 0.0:
            low, at_low = z, at_z
            if side < 0:
                at_high /= 2.0
            side = -1
        else:
            high, at_high = z, at_z
            if side > 0:
                at_low /= 2.0
            side = 1
    return z
