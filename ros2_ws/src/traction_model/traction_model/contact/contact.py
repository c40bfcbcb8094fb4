"""Contact of one wheel with soil: load, thrust, motion resistance and moment in all forms.

All forms share one interface: from speed, wheel speed, sinkage and its rate they give

- ``load`` N, the soil's upward force on the wheel,
- ``thrust`` F and ``resistance`` R, whose difference is the net horizontal force,
- ``moment`` M, the soil's moment about the wheel's centre, positive when it resists.

A load that is known, as when sinkage is measured, may be imposed: normal stress is then scaled
so that the soil carries just that load, and thrust, resistance and moment follow.

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
        Thrust with kappa = 1/y, the paper's (22) without the exponential: right above about
        10 % slip only.
    BEKKER_WONG
        Thrust with kappa = (1 - exp(-y))/y, the paper's (18), (19) and nonlinear model (21).
    CONTACT
        Stresses integrated over the contact arc, after Wong and Reece.
    EMPIRICAL
        The soil's traction curve, over the load that a flat plate carries.
    """

    PAPER = 0
    BEKKER_WONG = 1
    CONTACT = 2
    EMPIRICAL = 3


# The same as the kernels are told.
PAPER, BEKKER_WONG, CONTACT, EMPIRICAL = (int(form) for form in Form)


def check_form(form: Form, soils: Iterable[Soil]) -> None:
    """Refuse soils that lack what a form needs.

    Parameters
    ----------
    form : Form
        Form of the contact model.
    soils : iterable of Soil
        The soils that it is to be used on.

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
"""Speed below which soil is taken to pass under the wheel at this speed, m/s.

It bounds the shear displacement at standstill, where the stress integral has no limit.
"""

FREE = -1.0
"""In place of an imposed load, N: the soil carries what sinkage makes it carry."""

_NODES, _WEIGHTS = (array for array in np.polynomial.legendre.leggauss(12))
# On (0, 1) for each part of the contact, closer together towards its front: pressure and shear
# rise from nothing there, like a power of the distance.
NODES = ((_NODES + 1) / 2) ** 2
WEIGHTS = _WEIGHTS * (_NODES + 1) / 2

# Terms of the sine and cosine series: on +-pi/2, half the widest contact, what is left out is
# below 7e-12, on +-1 below 3e-15. Unlike math.sin they go through vector instructions.
SINE = tuple((-1) ** k / math.factorial(2 * k + 1) for k in range(8))
COSINE = tuple((-1) ** k / math.factorial(2 * k) for k in range(9))

EVERYWHERE = np.array([-np.inf])
UNTOUCHED = fresh_ruts(0, 0.0)


@inlined
def shear_deficit(y):
    """Share of the shear strength not yet mobilised along the contact, kappa in the paper's (19).

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
        # The series; its next term is below 1e-13. math.expm1 takes three times as long as exp.
        rest = 1.0 - y / 4.0 * (1.0 - y / 5.0 * (1.0 - y / 6.0))
        return 1.0 - y / 2.0 * (1.0 - y / 3.0 * rest)
    return (1.0 - math.exp(-y)) / y


@inlined
def mobilised(y, law, residual, hump):
    """Share of the shear strength mobilised at a shear displacement, by the soil's law.

    Parameters
    ----------
    y : float
        Shear displacement over K, dimensionless, at least 0.
    law : float
        The law's number, see `traction_model.soil.soil.SHEAR_LAWS`.
    residual, hump : float
        The law's parameters, dimensionless.

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
    """Mean of `mobilised` over a contact along which shear displacement grows evenly.

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
    """Slip that passes evenly through standstill, for the closed forms.

    Parameters
    ----------
    v, rim : float
        Speed of the centre and r*omega, m/s, forward positive.

    Returns
    -------
    float
        Slip, -1 to 1, along the path positive, whichever way the wheel goes.
    """
    slipping = (rim - v) / max(abs(v), abs(rim), MIN_TRANSIT_SPEED)
    return max(-1.0, min(1.0, slipping))


@inlined
def plate_contact(form, v, omega, z, z_rate, soil, radius, width, imposed):
    """Forces on a wheel by the forms `PAPER`, `BEKKER_WONG` and `EMPIRICAL`.

    The contact is a flat plate of width b and of the length the sinkage gives it,
    ``sqrt(2*r*z - z^2)``; resistance is Bekker's compaction resistance (25). `EMPIRICAL` takes
    only the load from it.

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
        N, N, N, N·m. `PAPER` gives no thrust where its kappa exceeds 1 (below about 10 %
        slip), where the formula would push the wrong way.
    """
    if z <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    z = min(z, radius)
    length = math.sqrt(2.0 * radius * z - z * z)
    area = width * length
    load = imposed
    if load < 0.0:
        load = area * (soil[MODULUS] * z ** soil[N_EXP] + soil[DAMPING] * max(z_rate, 0.0))

    # Fades out at standstill, where resistance has no direction.
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
    """Pressure of soil that may have been pressed before.

    Parameters
    ----------
    sunk : float
        How deep it is pressed now, m.
    depth, surface : float
        To which depth it was pressed before, 0 when fresh, and to which it sprang back, m.
    held : float
        Pressure at which it was left, Pa.
    soil : ndarray, shape (17,)
        A packed soil, SI units.

    Returns
    -------
    float
        Pa: along the elastic modulus up to the depth before, then along the pressure-sinkage
        law. Where soil would spring back above the ground by its elastic modulus, along the
        straight line from there.
    """
    fresh = soil[MODULUS] * power(max(sunk, 0.0), soil[N_EXP])
    if sunk >= depth:
        return fresh
    if sunk <= surface:
        return 0.0
    return min(fresh, held * (sunk - surface) / (depth - surface))


@inlined
def stresses(loading, reloading, law, part, motion, soil, rebound):
    """Integrals of the stresses over a part of the contact in which nothing jumps.

    Parameters
    ----------
    loading, reloading : bool
        Whether the soil is pressed down here, and whether along its elastic line.
    law : float
        Number of the shear law.
    part : tuple of float
        Middle and length of the part, rad; at its front the antiderivative of the rim's speed
        over the ground, m/s, and the shear displacement, m.
    motion : tuple of float
        z m, z' m/s, rim speed m/s, v m/s, r m, shear displacement per swept speed s, and
        `shear_step` of `arc_stresses` s.
    soil : tuple of float
        k, n, D, elastic modulus, residual ratio, hump, 1/K; SI units.
    rebound : tuple of float
        Surface of soil that was pressed before, m, and the slope of its elastic line, Pa/m;
        pressure where the rim begins to rise, Pa, and the angle at which it does, rad.

    Returns
    -------
    load, shear, friction, shear_moment, friction_moment, compaction : float
        Of normal stress, mobilised share, the product of both, these two again times the
        cosine, and normal stress times the sine; Pa, or dimensionless, per element ``b*r``.
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
    """Stresses over the contact arc of a strip of wheel that meets soil at one side.

    Seen so that the wheel goes towards positive theta. Soil is entered where the rim meets its
    surface. It is left where the rim no longer moves down over the ground, behind the bottom of
    a wheel that sinks, ahead of it for one that rises: at ``tan(theta) = -z'/v``. From there it
    springs back, along its elastic modulus.

    Parameters
    ----------
    v, omega : float
        Speed of the centre, m/s, and wheel speed, rad/s, positive towards the entry.
    z, z_rate : float
        Sinkage, m, above 0 and at most r, and its rate, m/s, downward positive.
    side : float
        1 where the entry lies ahead along the path, -1 where it lies behind.
    x : float
        Place of the wheel's centre along the path, m.
    soils : ndarray, shape (k, 17)
        Packed soils, SI units.
    starts : ndarray, shape (k,)
        Where each soil begins, m, the first minus infinity.
    radius, width : float
        r and the strip's width, m.
    depth : float
        To which the soil was pressed before, m; 0 when fresh.
    shear : float
        Shear displacement that the soil has seen before, m.
    shear_step : float
        Time of shearing, s, that soil has behind it as soon as it is touched: 0 but where a
        simulation with time steps this long is reproduced.

    Returns
    -------
    load : float
        Upward force, N.
    friction, cohesion : float
        Horizontal force, N, by friction under the normal stress and by cohesion.
    friction_moment, cohesion_moment : float
        Their moments about the centre over r, N.
    compaction : float
        Moment of the normal stress about the centre over r, N.
    displacement : float
        Shear displacement of the soil as it is left, m.
    """
    transit = max(abs(v), MIN_TRANSIT_SPEED)
    rim = radius * omega
    # Where rim and ground go at the same speed, and where soil that was pressed before yields
    # again, stresses jump or have a kink.
    # Below `turning` either way the rim goes as it turns, beyond against the wheel's motion.
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
    # Soil by soil, as the wheel meets them.
    rear = soil_row(x - radius, starts)
    front = soil_row(x + radius, starts)
    for turn in range(front - rear + 1):
        row = front - turn if side > 0.0 else rear + turn
        here = soils[row]
        held = here[MODULUS] * depth ** here[N_EXP]
        # Soil that was pressed before has sprung back.
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
            # The rim rises from its deepest place by r*(1 - cos(theta - leaving))/cos(leaving).
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
            # What is known beforehand leaves loops without branches, which are twice as quick.
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
    # Soil ahead cannot turn a wheel that turns against the motion.
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

    Normal stress acts vertically, shear stress horizontally, both per horizontal area, as in
    Chrono's SCM; shear displacement is integrated in closed form. A wheel wider than the rut
    that it meets runs on fresh soil beside it. Within `MIN_TRANSIT_SPEED` of standstill the
    contact passes evenly from one side of the wheel to the other, and ruts fade out.

    In front of the angle at which ``r*omega*cos(theta) = v`` the rim shears soil forward, so that
    thrust grows with load only while the whole contact lies behind it, ``z < r*i`` when driving
    on fresh soil. A wheel that is sunk deeper loses thrust at little slip as it sinks further.

    Parameters
    ----------
    v, omega : float
        Speed of the centre, m/s, and wheel speed, rad/s, forward positive.
    z, z_rate : float
        Sinkage, m, and its rate, m/s, downward positive.
    x : float
        Place of the wheel's centre along the path, m.
    soils : ndarray, shape (k, 17)
        Packed soils, SI units.
    starts : ndarray, shape (k,)
        Where each soil begins, m, the first minus infinity.
    radius, width : float
        r and b, m.
    track : int
        Which rut it runs in, -1 for none.
    ruts : Ruts
        What wheels have left so far.
    imposed : float
        Load that the soil carries, N, or `FREE`.
    shear_step : float
        See `arc_stresses`, s.

    Returns
    -------
    load, thrust, resistance, moment : float
        N, N, N, N·m.
    shear : float
        Shear displacement of the soil as it is left, m.
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
        # At standstill both sides count as fresh, or a wheel's own rut would let it roll back.
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
            # Harder soil on one side does not turn a wheel that stands.
            compaction += moving * side * part[5]
            left = max(left, part[6])
    if imposed >= 0.0 and load > 0.0:
        scale = imposed / load
        load = imposed
        friction *= scale
        friction_moment *= scale
        compaction *= scale
    # Soil that presses on a wheel which turns against the motion gives back no more than
    # shearing and sinking take.
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
    """Forces on one wheel at its place along the path, by any form.

    Parameters
    ----------
    form : int
        A `Form`.
    v, omega : float
        Speed of the centre, m/s, and wheel speed, rad/s, forward positive.
    z, z_rate : float
        Sinkage, m, and its rate, m/s, downward positive.
    x : float
        Place of the wheel's centre along the path, m.
    soils : ndarray, shape (k, 17)
        Packed soils, SI units.
    starts : ndarray, shape (k,)
        Where each soil begins, m, the first minus infinity.
    radius, width : float
        r and b, m.
    track : int
        Which rut it runs in, -1 for none; the closed forms take all soil for fresh, and for
        that under the centre.
    ruts : Ruts
        What wheels have left so far.
    imposed : float
        Load that the soil carries, N, or `FREE`.
    shear_step : float
        See `arc_stresses`, s.

    Returns
    -------
    load, thrust, resistance, moment : float
        N, N, N, N·m: load on the wheel, thrust, motion resistance, moment about its centre.
    shear : float
        Shear displacement of the soil as it is left, m.
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
    """Sinkage at which the soil carries a load while the wheel neither rises nor sinks.

    Load grows about like a power of sinkage: secant steps on logarithms, kept between a sinkage
    that carries less and one that carries more, until the load is met to 1e-8.

    Parameters
    ----------
    form : int
        A `Form`.
    v, omega : float
        Speed of the centre, m/s, and wheel speed, rad/s, forward positive.
    load : float
        Load to carry, N.
    x : float
        Place of the wheel's centre along the path, m.
    soils : ndarray, shape (k, 17)
        Packed soils, SI units.
    starts : ndarray, shape (k,)
        Where each soil begins, m, the first minus infinity.
    radius, width : float
        r and b, m.
    track : int
        Which rut it runs in, -1 for none.
    ruts : Ruts
        What wheels have left so far.
    guess : float
        Where to begin, m, as from the last step; 0 for nowhere in particular.

    Returns
    -------
    float
        Sinkage, m; 0 for no load, and r where even that depth does not carry the load.
    """
    if load <= 0.0:
        return 0.0
    low, high = 0.0, radius
    z = guess if 0.0 < guess < radius else radius / 10.0
    # Plate of length like sqrt(z), pressure like z**n.
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
    """Forces on one wheel on fresh soil that is the same all around, by any form.

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
    """Sinkage under a load, in equilibrium, on fresh soil that is the same all around.

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
        Sinkage, m; 0 for no load, and r where even that depth does not carry the load.
    """
    return sinkage_at(
        form, v, omega, load, 0.0, soil.reshape(1, -1), EVERYWHERE, radius, width, -1, UNTOUCHED,
        0.0,
    )  # fmt: skip
