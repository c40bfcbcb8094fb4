"""Contact of one wheel with soil: load, thrust, motion resistance and moment in all forms.

All forms have one interface. Inputs are speed, wheel speed, sinkage and its rate; outputs are

- ``load`` N, upward force of the soil on the wheel,
- ``thrust`` F and ``resistance`` R, whose difference is the net horizontal force,
- ``moment`` M, moment of the soil about the wheel's centre, positive when it resists.

A known load can be imposed, for example with measured sinkage. Normal stress is then scaled to
carry this load, and thrust, resistance and moment change accordingly.

Sources: Agriculture 2024, 14(3), 499 (*the paper*), equations (17) to (25); M. G. Bekker,
Introduction to Terrain-Vehicle Systems, 1969; J. Y. Wong and A. R. Reece, Prediction of rigid
wheel performance, J. Terramechanics 4(1), 1967.
"""

import math
from collections.abc import Iterable
from enum import IntEnum

import numpy as np

from traction_model.elementary import exponential, power
from traction_model.kernel import inlined, kernel, lean_kernel
from traction_model.soil.empirical import curve_ratios
from traction_model.soil.rut import fresh_ruts, rut_at
from traction_model.soil.soil import (
    COHESION,
    CURVE,
    DAMPING,
    ELASTIC_MODULUS,
    HUMP,
    JANOSI_HANAMOTO,
    MODULUS,
    N_EXP,
    RESIDUAL,
    SHEAR_LAW,
    SHEAR_MEMORY,
    SHEAR_MODULUS,
    TAN_PHI,
    WONG_PRESTON_THOMAS,
    Soil,
)
from traction_model.soil.terrain import soil_row


class Form(IntEnum):
    """Form of the contact model.

    Attributes
    ----------
    PAPER
        Thrust with kappa = 1/y, the paper's (22) without the exponential: valid above about 10 %
        slip only.
    BEKKER_WONG
        Thrust with kappa = (1 - exp(-y))/y, the paper's (18), (19) and nonlinear model (21).
    CONTACT
        Stresses integrated over the contact arc, after Wong and Reece.
    EMPIRICAL
        Traction curve of the soil, times the load of a flat plate.
    """

    PAPER = 0
    BEKKER_WONG = 1
    CONTACT = 2
    EMPIRICAL = 3


# The same as integers, for kernels.
PAPER, BEKKER_WONG, CONTACT, EMPIRICAL = (int(form) for form in Form)


def check_form(form: Form, soils: Iterable[Soil]) -> None:
    """Check that soils have the parameters of a form.

    Parameters
    ----------
    form : Form
        Form of the contact model.
    soils : iterable of Soil
        Soils for this form.

    Raises
    ------
    ValueError
        If the form is `EMPIRICAL` and a soil has no traction curve.
    """
    if form == Form.EMPIRICAL and any(soil.traction_curve is None for soil in soils):
        raise ValueError(
            'form empirical needs soils with a traction_curve: give mobility_number of a Brixius '
            'curve, say, or fit a curve with fit_curve'
        )


MIN_TRANSIT_SPEED = 0.05
"""Smallest speed of soil under the wheel in the shear displacement, m/s.

It bounds the shear displacement at standstill, where the integral diverges.
"""

FREE = -1.0
"""Value of `imposed` without an imposed load, N: the load follows from sinkage."""

_NODES, _WEIGHTS = (array for array in np.polynomial.legendre.leggauss(12))
# Points on (0, 1) for each part of the contact, closer together towards its front, where pressure
# and shear rise from 0 like a power of the distance.
NODES = ((_NODES + 1) / 2) ** 2
WEIGHTS = _WEIGHTS * (_NODES + 1) / 2

# Terms of the sine and cosine series. Error on +-pi/2, half the widest contact: below 7e-12; on
# +-1: below 3e-15. Unlike math.sin they compile to vector instructions.
SINE = tuple((-1) ** k / math.factorial(2 * k + 1) for k in range(8))
COSINE = tuple((-1) ** k / math.factorial(2 * k) for k in range(9))

EVERYWHERE = np.array([-np.inf])
UNTOUCHED = fresh_ruts(0, 0.0)


@inlined
def shear_deficit(y):
    """Share of the shear strength not mobilised along the contact, kappa in the paper's (19).

    Parameters
    ----------
    y : float
        Shear displacement at the contact's end over K, ``|slip|*l/K``, dimensionless, >= 0.

    Returns
    -------
    float
        ``(1 - exp(-y))/y``, from 1 at y = 0 towards 0.
    """
    if y < 0.02:
        # Series; the next term is below 1e-13. math.expm1 takes three times as long as exp.
        rest = 1.0 - y / 4.0 * (1.0 - y / 5.0 * (1.0 - y / 6.0))
        return 1.0 - y / 2.0 * (1.0 - y / 3.0 * rest)
    return (1.0 - math.exp(-y)) / y


@inlined
def mobilised(y, law, residual, hump):
    """Share of the shear strength mobilised at a shear displacement, by the shear law.

    Parameters
    ----------
    y : float
        Shear displacement over K, dimensionless, at least 0.
    law : float
        Number of the law, see `traction_model.soil.soil.SHEAR_LAWS`.
    residual, hump : float
        Parameters of the law, dimensionless.

    Returns
    -------
    float
        g, dimensionless, 0 to 1; by Wong and Preston-Thomas up to 1.08.
    """
    if law == JANOSI_HANAMOTO:
        return 1.0 - exponential(-y)
    if law == WONG_PRESTON_THOMAS:
        return residual * (1.0 + hump * math.exp(1.0 - y)) * (1.0 - math.exp(-y))
    fading = 2.0 * math.exp(-y) / (1.0 + math.exp(-2.0 * y))
    return residual * math.tanh(y) * (1.0 + hump * fading)


@inlined
def mean_mobilised(y, soil):
    """Mean of `mobilised` over a contact with linearly growing shear displacement.

    Parameters
    ----------
    y : float
        Shear displacement at the contact's end over K, dimensionless, at least 0.
    soil : ndarray, shape (17,)
        A packed soil, SI units.

    Returns
    -------
    float
        ``1 - kappa``, dimensionless, 0 to 1; by Wong and Preston-Thomas up to 1.08.
    """
    deficit = shear_deficit(y)
    if soil[SHEAR_LAW] == JANOSI_HANAMOTO:
        return 1.0 - deficit
    residual, hump = soil[RESIDUAL], soil[HUMP]
    if soil[SHEAR_LAW] == WONG_PRESTON_THOMAS:
        # Integral of (1 + H*e^(1-u))*(1 - e^-u).
        return residual * (1.0 - deficit + hump * math.e * (deficit - shear_deficit(2.0 * y)))
    if y < 1e-4:
        return residual * (1.0 + hump) * y / 2.0
    # Integral of tanh(u)*(1 + H/cosh(u)): ln cosh(y) + H*(1 - 1/cosh(y)).
    fading = 2.0 * math.exp(-y) / (1.0 + math.exp(-2.0 * y))
    logarithm = y + math.log1p(math.exp(-2.0 * y)) - math.log(2.0)
    return residual * (logarithm + hump * (1.0 - fading)) / y


@inlined
def slip_along_path(v, rim):
    """Slip for the closed forms, continuous through standstill.

    Parameters
    ----------
    v, rim : float
        Speed of the centre and r*omega, m/s, forward positive.

    Returns
    -------
    float
        Slip, -1 to 1, positive in the direction of the path, for either direction of motion.
    """
    slipping = (rim - v) / max(abs(v), abs(rim), MIN_TRANSIT_SPEED)
    return max(-1.0, min(1.0, slipping))


@inlined
def plate_contact(form, v, omega, z, z_rate, soil, radius, width, imposed):
    """Forces on a wheel by the forms `PAPER`, `BEKKER_WONG` and `EMPIRICAL`.

    The contact is a flat plate of width b and length ``sqrt(2*r*z - z^2)``; resistance is Bekker's
    compaction resistance (25). `EMPIRICAL` uses only its load.

    Parameters
    ----------
    form : int
        ``Form.PAPER``, ``Form.BEKKER_WONG`` or ``Form.EMPIRICAL``.
    v, omega : float
        Speed of the centre, m/s, and wheel speed, rad/s, forward positive.
    z, z_rate : float
        Sinkage, m, and its rate, m/s, downward positive.
    soil : ndarray, shape (17,)
        A packed soil, SI units.
    radius, width : float
        r and b, m.
    imposed : float
        Load that the soil carries, N, or `FREE`.

    Returns
    -------
    load, thrust, resistance, moment : float
        N, N, N, N·m. Thrust of `PAPER` is 0 where its kappa exceeds 1 (below about 10 % slip),
        since the formula would change its sign there.
    """
    if z <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    z = min(z, radius)
    length = math.sqrt(2.0 * radius * z - z * z)
    area = width * length
    load = imposed
    if load < 0.0:
        load = area * (soil[MODULUS] * z ** soil[N_EXP] + soil[DAMPING] * max(z_rate, 0.0))

    # Linear through standstill, where resistance has no direction.
    rolling = max(-1.0, min(1.0, v / MIN_TRANSIT_SPEED))
    rim = radius * omega
    slipping = slip_along_path(v, rim)
    if form == EMPIRICAL:
        gross, drag = curve_ratios(soil[CURVE:], slipping)
        backward, _ = curve_ratios(soil[CURVE:], -slipping)
        thrust = load * ((1.0 + rolling) * gross - (1.0 - rolling) * backward) / 2.0
        return load, thrust, rolling * load * drag, radius * thrust
    y = abs(slipping) * length / soil[SHEAR_MODULUS]
    if form == PAPER:
        share = 1.0 - min(1.0, 1.0 / y) if y > 0.0 else 0.0
    else:
        share = mean_mobilised(y, soil)
    direction = 1.0 if rim >= v else -1.0
    thrust = direction * (soil[COHESION] * area + load * soil[TAN_PHI]) * share
    resistance = rolling * load * z / ((soil[N_EXP] + 1.0) * length)
    return load, thrust, resistance, radius * thrust


@inlined
def pressure(sunk, depth, surface, held, soil):
    """Pressure of soil with a compression history.

    Parameters
    ----------
    sunk : float
        Present depth of compression, m.
    depth, surface : float
        Earlier depth of compression, 0 for undisturbed soil, and depth after rebound, m.
    held : float
        Pressure at the earlier depth, Pa.
    soil : ndarray, shape (17,)
        A packed soil, SI units.

    Returns
    -------
    float
        Pa: elastic up to the earlier depth, then by the pressure-sinkage law. If the rebound would
        reach above the ground, the elastic line starts at the ground.
    """
    fresh = soil[MODULUS] * power(max(sunk, 0.0), soil[N_EXP])
    if sunk >= depth:
        return fresh
    if sunk <= surface:
        return 0.0
    return min(fresh, held * (sunk - surface) / (depth - surface))


@inlined
def stresses(loading, reloading, law, part, motion, soil, rebound):
    """Integrals of the stresses over a part of the contact without discontinuities.

    Parameters
    ----------
    loading, reloading : bool
        True if the soil is compressed here; true if it is on its elastic line.
    law : float
        Number of the shear law.
    part : tuple of float
        Middle and length of the part, rad; antiderivative of the rim's speed over the ground, m/s,
        and shear displacement, m, at its front.
    motion : tuple of float
        z m, z' m/s, rim speed m/s, v m/s, r m, shear displacement per swept speed s, and
        `shear_step` of `arc_stresses` s.
    soil : tuple of float
        k, n, D, elastic modulus, residual ratio, hump, 1/K; SI units.
    rebound : tuple of float
        Surface of compressed soil, m, and slope of its elastic line, Pa/m; pressure where the rim
        starts to rise, Pa, and the angle there, rad.

    Returns
    -------
    load, shear, friction, shear_moment, friction_moment, compaction : float
        Integrals of normal stress, mobilised share, their product, the last two times the cosine,
        and normal stress times the sine; Pa, or dimensionless, per element ``b*r``.
    """
    middle, span, swept_before, displacement = part
    z, z_rate, rim, v, radius, per_transit, shear_step = motion
    modulus, exponent, damping, elastic, residual, hump, per_shear = soil
    surface, stiffness, peak, leaving = rebound
    sin_middle, cos_middle = math.sin(middle), math.cos(middle)
    sin_leaving, cos_leaving = math.sin(leaving), math.cos(leaving)
    load = 0.0
    shear = 0.0
    friction = 0.0
    shear_moment = 0.0
    friction_moment = 0.0
    compaction = 0.0
    for k in range(NODES.size):
        offset = span * (0.5 - NODES[k])
        square = offset * offset
        sine = SINE[7]
        cosine = COSINE[8] * square + COSINE[7]
        for term in range(6, -1, -1):
            sine = sine * square + SINE[term]
            cosine = cosine * square + COSINE[term]
        sine *= offset
        theta = middle + offset
        sin_theta = sin_middle * cosine + cos_middle * sine
        cos_theta = cos_middle * cosine - sin_middle * sine
        pressing = damping * (z_rate + rim * sin_theta)
        if loading:
            sunk = max(z - radius * (1.0 - cos_theta), 0.0)
            sigma = modulus * power(sunk, exponent)
            if reloading:
                sigma = min(sigma, stiffness * max(sunk - surface, 0.0))
            sigma += max(pressing, 0.0)
        else:
            turned = cos_theta * cos_leaving + sin_theta * sin_leaving
            sigma = max(peak - elastic * radius * (1.0 - turned) / cos_leaving, 0.0)
            sigma = max(sigma + pressing, 0.0)
        swept = rim * (theta + sin_theta * cos_theta) / 2.0 - v * sin_theta
        sheared = displacement + per_transit * abs(swept_before - swept)
        sheared += shear_step * abs(rim * cos_theta - v)
        area = span * WEIGHTS[k] * cos_theta
        share = mobilised(sheared * per_shear, law, residual, hump) * area
        by_friction = share * sigma
        load += sigma * area
        shear += share
        friction += by_friction
        shear_moment += share * cos_theta
        friction_moment += by_friction * cos_theta
        compaction += sigma * sin_theta * area
    return load, shear, friction, shear_moment, friction_moment, compaction


@inlined
def arc_stresses(
    v, omega, z, z_rate, side, x, soils, starts, radius, width, depth, shear, shear_step
):
    """Stresses over the contact arc of a strip of the wheel that enters soil at one side.

    The wheel moves towards positive theta. Entry is where the rim reaches the surface. The soil is
    compressed up to ``tan(theta) = -z'/v``, where the depth of the rim no longer grows: behind the
    bottom of a sinking wheel, ahead of it for a rising one. Then it springs back by its elastic
    modulus.

    Parameters
    ----------
    v, omega : float
        Speed of the centre, m/s, and wheel speed, rad/s, positive towards the entry.
    z, z_rate : float
        Sinkage, m, above 0 and at most r, and its rate, m/s, downward positive.
    side : float
        1 if the entry is ahead along the path, -1 if it is behind.
    x : float
        Position of the wheel's centre along the path, m.
    soils : ndarray, shape (k, 17)
        Packed soils, SI units.
    starts : ndarray, shape (k,)
        Start of each soil, m; the first is minus infinity.
    radius, width : float
        r and the strip's width, m.
    depth : float
        Earlier depth of compression, m; 0 for undisturbed soil.
    shear : float
        Earlier shear displacement of the soil, m.
    shear_step : float
        Time of shear before contact, s: 0, or half the time step of a simulation to reproduce.

    Returns
    -------
    load : float
        Upward force, N.
    friction, cohesion : float
        Horizontal force, N, from friction under normal stress and from cohesion.
    friction_moment, cohesion_moment : float
        Their moments about the centre over r, N.
    compaction : float
        Moment of the normal stress about the centre over r, N.
    displacement : float
        Shear displacement of the soil at the exit, m.
    """
    transit = max(abs(v), MIN_TRANSIT_SPEED)
    rim = radius * omega
    # Stresses are not smooth where rim and ground have equal speed, and where compressed soil
    # yields again. Between +-`turning` shear drives the wheel forward, outside it resists.
    turning = math.pi
    if rim == 0.0 or v / rim >= 1.0:
        turning = -math.pi
    elif v / rim > 0.0:
        turning = math.acos(v / rim)
    inner = 1.0 if rim > 0.0 else -1.0
    outer = 1.0 if v < 0.0 else -1.0
    yields = math.acos(1.0 - (z - depth) / radius) if 0.0 < depth < z else math.pi

    load = 0.0
    friction = 0.0
    cohesion = 0.0
    friction_moment = 0.0
    cohesion_moment = 0.0
    compaction = 0.0
    motion = (z, z_rate, rim, v, radius, radius / transit, shear_step)
    before = shear
    displacement = 0.0
    # Soil by soil, from the entry on.
    rear = soil_row(x - radius, starts)
    front = soil_row(x + radius, starts)
    for turn in range(front - rear + 1):
        row = front - turn if side > 0.0 else rear + turn
        here = soils[row]
        held = here[MODULUS] * depth ** here[N_EXP]
        # Surface of compressed soil after rebound.
        surface = max(depth - held / here[ELASTIC_MODULUS], 0.0)
        if z <= surface:
            continue
        before = shear * here[SHEAR_MEMORY]
        start = math.acos(max(0.0, 1.0 - (z - surface) / radius))
        leaving = max(-start, min(start, -math.atan(z_rate / transit)))
        rear_angle = leaving
        peak = 0.0
        if here[ELASTIC_MODULUS] < math.inf:
            deepest = z - radius * (1.0 - math.cos(leaving))
            peak = pressure(deepest, depth, surface, held, here)
            # The rim rises from its deepest point by r*(1 - cos(theta - leaving))/cos(leaving).
            rise = peak / here[ELASTIC_MODULUS] * math.cos(leaving) / radius
            rear_angle = max(leaving - math.acos(max(0.0, 1.0 - rise)), -math.pi / 2.0)
        if front > rear:
            begins = (starts[row] - x) / radius
            ends = (starts[row + 1] - x) / radius if row < front else 1.0
            if side < 0.0:
                begins, ends = -ends, -begins
            start = min(start, math.asin(max(-1.0, min(1.0, ends))))
            rear_angle = max(rear_angle, math.asin(max(-1.0, min(1.0, begins))))
        elastic_line = held / (depth - surface) if depth > surface else 0.0
        rebound = (surface, elastic_line, peak, leaving)
        stiffnesses = (
            here[MODULUS], here[N_EXP], here[DAMPING], here[ELASTIC_MODULUS], here[RESIDUAL],
            here[HUMP], 1.0 / here[SHEAR_MODULUS],
        )  # fmt: skip
        # Antiderivative of the rim's speed over the ground, (rim*cos s - v)*cos s.
        swept = rim * (start + math.sin(start) * math.cos(start)) / 2.0 - v * math.sin(start)
        while start > rear_angle:
            stop = rear_angle
            for place in (turning, -turning, yields, -yields, leaving):
                if stop < place < start:
                    stop = place
            span = start - stop
            middle = (start + stop) / 2.0
            direction = inner if abs(middle) < turning else outer
            law = here[SHEAR_LAW]
            loading = middle > leaving
            reloading = z - radius * (1.0 - math.cos(middle)) < depth
            part = (middle, span, swept, before + displacement)
            # Conditions are evaluated before the loops: without branches they are twice as fast.
            if law != JANOSI_HANAMOTO:
                sums = stresses(loading, reloading, law, part, motion, stiffnesses, rebound)
            elif not loading:
                sums = stresses(False, False, JANOSI_HANAMOTO, part, motion, stiffnesses, rebound)
            elif reloading:
                sums = stresses(True, True, JANOSI_HANAMOTO, part, motion, stiffnesses, rebound)
            else:
                sums = stresses(True, False, JANOSI_HANAMOTO, part, motion, stiffnesses, rebound)
            load += sums[0]
            cohesion += direction * here[COHESION] * sums[1]
            friction += direction * here[TAN_PHI] * sums[2]
            cohesion_moment += direction * here[COHESION] * sums[3]
            friction_moment += direction * here[TAN_PHI] * sums[4]
            compaction += sums[5]
            swept_before = swept
            swept = rim * (stop + math.sin(stop) * math.cos(stop)) / 2.0 - v * math.sin(stop)
            displacement += radius / transit * abs(swept_before - swept)
            start = stop
    element = width * radius
    # Soil ahead cannot drive a wheel that turns against the motion.
    rolling = max(0.0, min(1.0, 1.0 + rim / transit))
    return (
        load * element,
        friction * element,
        cohesion * element,
        friction_moment * element,
        cohesion_moment * element,
        rolling * compaction * element,
        before + displacement,
    )


@lean_kernel
def arc_contact(
    v, omega, z, z_rate, x, soils, starts, radius, width, track, ruts, imposed, shear_step
):
    """Forces on a wheel by stresses integrated over the contact arc, form `CONTACT`.

    Normal stress is vertical, shear stress horizontal, both per horizontal area, as in Chrono's
    SCM. Shear displacement is integrated in closed form. A wheel wider than its rut runs on
    undisturbed soil beside it. Within `MIN_TRANSIT_SPEED` of standstill the contact changes
    linearly from one side of the wheel to the other, without ruts at standstill.

    In front of the angle with ``r*omega*cos(theta) = v`` the rim shears soil forward. So thrust
    grows with load only while the whole contact is behind it, ``z < r*i`` when driving on
    undisturbed soil. At larger sinkage and small slip, thrust decreases with sinkage.

    Parameters
    ----------
    v, omega : float
        Speed of the centre, m/s, and wheel speed, rad/s, forward positive.
    z, z_rate : float
        Sinkage, m, and its rate, m/s, downward positive.
    x : float
        Position of the wheel's centre along the path, m.
    soils : ndarray, shape (k, 17)
        Packed soils, SI units.
    starts : ndarray, shape (k,)
        Start of each soil, m; the first is minus infinity.
    radius, width : float
        r and b, m.
    track : int
        Index of its rut, -1 for none.
    ruts : Ruts
        Ruts so far.
    imposed : float
        Load that the soil carries, N, or `FREE`.
    shear_step : float
        See `arc_stresses`, s.

    Returns
    -------
    load, thrust, resistance, moment : float
        N, N, N, N·m.
    shear : float
        Shear displacement of the soil at the exit, m.
    """
    if z <= 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    z = min(z, radius)
    entry = math.sqrt(z * (2.0 * radius - z))
    ahead = max(0.0, min(1.0, (1.0 + v / MIN_TRANSIT_SPEED) / 2.0))
    load = 0.0
    friction = 0.0
    cohesion = 0.0
    friction_moment = 0.0
    cohesion_moment = 0.0
    compaction = 0.0
    left = 0.0
    for side in (1.0, -1.0):
        weight = ahead if side > 0.0 else 1.0 - ahead
        if weight == 0.0:
            continue
        depth, shear, rut_width = rut_at(x + side * entry, track, ruts)
        # Undisturbed soil on both sides at standstill; otherwise a wheel would roll back into its
        # rut.
        moving = max(0.0, min(1.0, side * v / MIN_TRANSIT_SPEED))
        depth *= moving
        shear *= moving
        in_rut = min(rut_width, width) if depth > 0.0 else 0.0
        for beside in range(2):
            strip = width - in_rut if beside else in_rut
            if strip <= 0.0:
                continue
            if beside:
                depth, shear = 0.0, 0.0
            part = arc_stresses(
                side * v, side * omega, z, z_rate, side, x, soils, starts, radius, strip,
                depth, shear, shear_step,
            )  # fmt: skip
            load += weight * part[0]
            friction += weight * side * part[1]
            cohesion += weight * side * part[2]
            friction_moment += weight * side * part[3]
            cohesion_moment += weight * side * part[4]
            # Firmer soil on one side does not turn a wheel at standstill.
            compaction += moving * side * part[5]
            left = max(left, part[6])
    if imposed >= 0.0 and load > 0.0:
        scale = imposed / load
        load = imposed
        friction *= scale
        friction_moment *= scale
        compaction *= scale
    # Energy: soil under a wheel that turns against the motion returns at most the work of shear
    # and sinkage.
    rim = radius * omega
    taken = (friction_moment + cohesion_moment) * rim - (friction + cohesion) * v
    taken = max(taken + load * max(z_rate, 0.0), 0.0)
    if -compaction * rim > taken:
        compaction = -taken / rim
    resistance = compaction
    moment = radius * (friction_moment + cohesion_moment + compaction)
    return load, friction + cohesion + resistance, resistance, moment, left


@inlined
def forces_at(
    form, v, omega, z, z_rate, x, soils, starts, radius, width, track, ruts, imposed, shear_step
):
    """Forces on one wheel at its position along the path, by any form.

    Parameters
    ----------
    form : int
        A `Form`.
    v, omega : float
        Speed of the centre, m/s, and wheel speed, rad/s, forward positive.
    z, z_rate : float
        Sinkage, m, and its rate, m/s, downward positive.
    x : float
        Position of the wheel's centre along the path, m.
    soils : ndarray, shape (k, 17)
        Packed soils, SI units.
    starts : ndarray, shape (k,)
        Start of each soil, m; the first is minus infinity.
    radius, width : float
        r and b, m.
    track : int
        Index of its rut, -1 for none; closed forms use only the undisturbed soil under the centre.
    ruts : Ruts
        Ruts so far.
    imposed : float
        Load that the soil carries, N, or `FREE`.
    shear_step : float
        See `arc_stresses`, s.

    Returns
    -------
    load, thrust, resistance, moment : float
        N, N, N, N·m: load on the wheel, thrust, motion resistance, moment about its centre.
    shear : float
        Shear displacement of the soil at the exit, m.
    """
    if form == CONTACT:
        return arc_contact(
            v, omega, z, z_rate, x, soils, starts, radius, width, track, ruts, imposed, shear_step
        )
    soil = soils[soil_row(x, starts)]
    load, thrust, resistance, moment = plate_contact(
        form, v, omega, z, z_rate, soil, radius, width, imposed
    )
    return load, thrust, resistance, moment, 0.0


@lean_kernel
def sinkage_at(form, v, omega, load, x, soils, starts, radius, width, track, ruts, guess):
    """Sinkage at which the soil carries a load, without vertical motion.

    Secant steps on logarithms, since load is nearly a power of sinkage, bracketed between a
    sinkage with a smaller and one with a larger load, until the relative error of the load is
    below 1e-8.

    Parameters
    ----------
    form : int
        A `Form`.
    v, omega : float
        Speed of the centre, m/s, and wheel speed, rad/s, forward positive.
    load : float
        Load to carry, N.
    x : float
        Position of the wheel's centre along the path, m.
    soils : ndarray, shape (k, 17)
        Packed soils, SI units.
    starts : ndarray, shape (k,)
        Start of each soil, m; the first is minus infinity.
    radius, width : float
        r and b, m.
    track : int
        Index of its rut, -1 for none.
    ruts : Ruts
        Ruts so far.
    guess : float
        Initial value, m, such as that of the last step; 0: none.

    Returns
    -------
    float
        Sinkage, m; 0 without load, and r if the soil does not carry the load.
    """
    if load <= 0.0:
        return 0.0
    low, high = 0.0, radius
    z = guess if 0.0 < guess < radius else radius / 10.0
    # Plate: length ~ sqrt(z), pressure ~ z**n.
    slope = soils[soil_row(x, starts), N_EXP] + 0.5
    carried_before = 0.0
    z_before = 0.0
    for turn in range(200):
        carried = forces_at(
            form, v, omega, z, 0.0, x, soils, starts, radius, width, track, ruts, FREE, 0.0
        )[0]  # fmt: skip
        if abs(carried - load) < 1e-8 * load:
            break
        if carried < load:
            low = z
            if z == radius:
                break
        else:
            high = z
        if high - low < 1e-13 * radius:
            break
        if carried > 0.0 and carried_before > 0.0 and carried != carried_before:
            slope = math.log(carried / carried_before) / math.log(z / z_before)
        carried_before, z_before = carried, z
        z = (low + high) / 2.0
        if carried > 0.0 and slope > 0.05 and turn < 50:
            step = z_before * (load / carried) ** (1.0 / slope)
            if step >= high == radius:
                z = radius
            elif low < step < high:
                z = step
    return z


@kernel
def contact(form, v, omega, z, z_rate, soil, radius, width):
    """Forces on one wheel on undisturbed, uniform soil, by any form.

    Parameters
    ----------
    form : int
        A `Form`.
    v, omega : float
        Speed of the centre, m/s, and wheel speed, rad/s, forward positive.
    z, z_rate : float
        Sinkage, m, and its rate, m/s, downward positive.
    soil : ndarray, shape (17,)
        A packed soil, SI units.
    radius, width : float
        r and b, m.

    Returns
    -------
    load, thrust, resistance, moment : float
        N, N, N, N·m: load on the wheel, thrust, motion resistance, moment about its centre.
    """
    return forces_at(
        form, v, omega, z, z_rate, 0.0, soil.reshape(1, -1), EVERYWHERE, radius, width,
        -1, UNTOUCHED, FREE, 0.0,
    )[:4]  # fmt: skip


@kernel
def equilibrium_sinkage(form, v, omega, load, soil, radius, width):
    """Equilibrium sinkage under a load on undisturbed, uniform soil.

    Parameters
    ----------
    form : int
        A `Form`.
    v, omega : float
        Speed of the centre, m/s, and wheel speed, rad/s, forward positive.
    load : float
        Load to carry, N.
    soil : ndarray, shape (17,)
        A packed soil, SI units.
    radius, width : float
        r and b, m.

    Returns
    -------
    float
        Sinkage, m; 0 without load, and r if the soil does not carry the load.
    """
    return sinkage_at(
        form, v, omega, load, 0.0, soil.reshape(1, -1), EVERYWHERE, radius, width, -1, UNTOUCHED,
        0.0,
    )  # fmt: skip
