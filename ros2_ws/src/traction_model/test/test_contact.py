"""Contact forces against hand calculation, independent integration and physics."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import brentq

from traction_model.contact.contact import (
    EVERYWHERE,
    FREE,
    MIN_TRANSIT_SPEED,
    UNTOUCHED,
    Form,
    contact,
    equilibrium_sinkage,
    forces_at,
    plate_contact,
    shear_deficit,
    sinkage_at,
)
from traction_model.soil.empirical import Brixius, Burckhardt, Pacejka
from traction_model.soil.rut import fresh_ruts, press_rut
from traction_model.soil.soil import Soil, load_soil, preset_soils
from traction_model.vehicle.wheel import Wheel

# Agriculture 2024, 14(3), 499, Table 1.
RADIUS, WIDTH = 0.5, 0.4
WHEEL = Wheel(radius=RADIUS, width=WIDTH, inertia=20)
# Burckhardt's curve of wet gravel or so; what matters is that there is one.
CURVE = Burckhardt(c1=0.6, c2=12, c3=0.1, rolling_resistance=0.05)


def packed(soil):
    """The soil as the wheel meets it, with a curve for the empirical form."""
    return soil.model_copy(update={'traction_curve': CURVE}).packed(WHEEL)


SAND = packed(load_soil('paper_sand'))
FORMS = [int(form) for form in Form]

SOILS = st.sampled_from([packed(soil) for soil in preset_soils().values()])
DEPTHS = st.floats(1e-6, 0.6)
RATES = st.floats(-2.0, 2.0)


@pytest.mark.parametrize('y', [1e-12, 1e-7, 0.99e-4, 1.01e-4, 1e-2, 1.0, 30.0, 1e4])
def test_shear_deficit_against_its_series(y):
    # (1 - exp(-y))/y = sum over k of (-y)^k/(k + 1)!; where y is large, exp(-y) is nothing.
    if y < 5:
        expected = math.fsum((-y) ** k / math.factorial(k + 1) for k in range(60))
    else:
        expected = (1 - math.exp(-y)) / y
    assert shear_deficit(y) == pytest.approx(expected, rel=2e-9)


@given(st.floats(0.0, 1e6), st.floats(0.0, 1e6))
def test_shear_deficit_falls_from_one(y, more):
    assert 0.0 < shear_deficit(y + more) <= shear_deficit(y) * (1 + 1e-9) <= 1.0 + 1e-9


def test_plate_by_hand():
    # Table 1 at 0.1 m of sinkage and 20 % slip:
    # l = sqrt(2*0.5*0.1 - 0.01) = 0.3 m, A = 0.4*0.3 = 0.12 m^2;
    # p = 0.2e6*0.1^1.1 = 15886.56 Pa, W = p*A = 1906.39 N;
    # (15) tau_max = p*tan(30 deg) = 9172.11 Pa;
    # y = i*l/K = 0.2*0.3/0.01 = 6;
    # (21) kappa = (1 - exp(-6))/6 = 0.1662535, (22) kappa = 1/6 = 0.1666667;
    # (19) F = tau_max*A*(1 - kappa) = 917.67 N and 917.21 N;
    # (25) R = b*W*z/((n + 1)*A) = 0.4*1906.39*0.1/(2.1*0.12) = 302.60 N; M = r*F.
    for form, thrust in ((Form.BEKKER_WONG, 917.67), (Form.PAPER, 917.21)):
        forces = plate_contact(int(form), 0.8, 2.0, 0.1, 0.0, SAND, RADIUS, WIDTH, FREE)
        assert forces == pytest.approx((1906.39, thrust, 302.60, 0.5 * thrust), abs=0.02)


def test_plate_brakes_by_hand():
    # v 1 m/s, rim 0.8 m/s: slip -0.2, thrust as above but backward, resistance as above.
    forces = plate_contact(int(Form.BEKKER_WONG), 1.0, 1.6, 0.1, 0.0, SAND, RADIUS, WIDTH, FREE)
    assert forces == pytest.approx((1906.39, -917.67, 302.60, -458.83), abs=0.02)


def test_paper_form_gives_no_thrust_below_its_domain():
    # y = 0.03*0.3/0.01 = 0.9 < 1: 1 - 1/y would be negative.
    _, thrust, _, _ = plate_contact(
        int(Form.PAPER), 0.97, 2.0, 0.1, 0.0, SAND, RADIUS, WIDTH, FREE
    )
    assert thrust == 0.0


def integrated(v, omega, z, z_rate, soil, r, b):
    """Load, net force and moment by adaptive quadrature of the stresses, v > 0, fresh soil.

    Ahead of the place th1 at which the rim goes neither up nor down over the ground,
    tan th1 = -z'/v: sigma = p(z - r*(1 - cos th)) + D*max(z' + omega*r*sin th, 0), p(z) = k*z^n.
    Behind it the rim rises from the ground by the integral of -(z' + v*tan s) over the time
    r*cos s/v ds that it takes to turn, here by quadrature, and sigma falls by E times that.
    j = integral from th to th0 of |omega*r*cos s - v|*(r*cos s/v) ds,
    tau = sign(omega*r*cos th - v)*(c + sigma*tan phi)*(1 - exp(-j/K)), dA = b*r*cos th dth.
    """
    k = soil.cohesive_modulus / b + soil.frictional_modulus
    n, c, tan_phi = soil.sinkage_exponent, soil.cohesion, math.tan(soil.friction_angle)
    entry = math.acos(1 - z / r)
    leaving = max(-entry, min(entry, -math.atan(z_rate / v)))
    peak = k * max(z - r * (1 - math.cos(leaving)), 0.0) ** n

    def risen(th):
        return quad(lambda s: -(z_rate + v * math.tan(s)) * r * math.cos(s) / v, th, leaving)[0]

    last = leaving
    if soil.elastic_modulus and peak > 0:
        last = brentq(lambda th: soil.elastic_modulus * risen(th) - peak, -1.5, leaving - 1e-9)
    # Where rim and ground go at the same speed, and where soil begins to spring back,
    # integrands have a kink.
    turning = math.acos(v / (r * omega)) if r * omega > v else 9.0
    kinks = [th for th in (turning, -turning, leaving) if last < th < entry]

    def sigma(th):
        damped = soil.damping * (z_rate + omega * r * math.sin(th))
        if th >= leaving:
            return k * max(z - r * (1 - math.cos(th)), 0.0) ** n + max(damped, 0.0)
        return max(max(peak - soil.elastic_modulus * risen(th), 0.0) + damped, 0.0)

    def tau(th):
        def path(s):
            return abs(omega * r * math.cos(s) - v) * r * math.cos(s) / v

        inside = [kink for kink in kinks if kink > th] or None
        j = quad(path, th, entry, points=inside, epsabs=1e-12, epsrel=1e-10)[0]
        sign = 1.0 if omega * r * math.cos(th) > v else -1.0
        return sign * (c + sigma(th) * tan_phi) * -math.expm1(-j / soil.shear_deformation_modulus)

    def over_arc(stress):
        def integrand(th):
            return stress(th) * b * r * math.cos(th)

        places = kinks or None
        return quad(integrand, last, entry, points=places, epsabs=1e-7, epsrel=1e-7, limit=200)[0]

    return (
        over_arc(sigma),
        over_arc(tau),
        over_arc(lambda th: tau(th) * r * math.cos(th) + sigma(th) * r * math.sin(th)),
    )


@pytest.mark.parametrize(
    ('v', 'omega', 'z', 'z_rate', 'soil'),
    [
        (0.8, 2.0, 0.10, 0.0, 'paper_sand'),  # 20 % slip
        (0.9, 2.0, 0.15, 0.2, 'paper_sand'),  # 10 %, sinking
        (1.0, 2.1, 0.02, -0.3, 'paper_sand'),  # 5 %, rising
        (0.2, 3.0, 0.17, 0.0, 'paper_sand_soft'),  # 87 %
        (5.0, 12.0, 0.05, 0.0, 'sandy_loam_15'),  # fast
        (1.0, 2.0, 0.08, 0.0, 'dry_sand'),  # rolling
        (1.0, 1.6, 0.10, 0.0, 'paper_sand'),  # braking, -20 %
        (1.0, 0.2, 0.10, 0.1, 'heavy_clay_25'),  # nearly locked
        (1.0, 0.0, 0.05, 0.0, 'snow_sweden'),  # locked
        (1.0, 2.3, 0.05, 0.0, 'sandy_loam_chrono'),  # springs back behind the bottom
        (1.0, 2.3, 0.05, 0.1, 'sandy_loam_chrono'),  # and while sinking
        (1.0, 2.3, 0.05, -0.05, 'soft_patch_chrono'),  # and while rising
    ],
)
def test_arc_against_adaptive_quadrature(v, omega, z, z_rate, soil):
    soil = load_soil(soil)
    load, thrust, resistance, moment = contact(2, v, omega, z, z_rate, packed(soil), RADIUS, WIDTH)
    expected = integrated(v, omega, z, z_rate, soil, RADIUS, WIDTH)
    # What Gauss points leave open is largest where pressure all but jumps at the entry: on
    # heavy clay, n = 0.13.
    assert load == pytest.approx(expected[0], rel=2e-4)
    assert thrust - resistance == pytest.approx(expected[1], abs=2e-4 * load)
    assert moment == pytest.approx(expected[2], abs=2e-4 * load * RADIUS)


def test_arc_is_continuous_in_speed():
    # From 2 to 25 % slip, where the place at which the rim is as fast as the ground wanders
    # through the contact: solvers with step control stall at jumps.
    net = []
    for v in np.linspace(0.98, 0.75, 10001):
        load, thrust, resistance, _ = contact(2, v, 2.0, 0.15, 0.0, SAND, RADIUS, WIDTH)
        net.append((thrust - resistance) / load)
    # Net force over load rises by some tenths over 10000 steps; tau jumping at a Gauss point
    # of weight 0.01 to 0.1 would change it by that much at once.
    assert 0.1 < net[-1] - net[0] < 1.0
    assert np.max(np.abs(np.diff(net))) < 1e-3


@pytest.mark.parametrize('form', FORMS)
@pytest.mark.parametrize('z', [0.0, -0.01])
def test_no_force_off_the_ground(form, z):
    assert contact(form, 1.0, 3.0, z, 0.5, SAND, RADIUS, WIDTH) == (0.0, 0.0, 0.0, 0.0)


def shear_laws(soil):
    """The soil by each shear law."""
    for law, residual in (
        ('janosi_hanamoto', None),
        ('wong_preston_thomas', 0.6),
        ('kacigin_guskov', 0.4),
    ):
        yield soil.model_copy(update={'shear_law': law, 'residual_ratio': residual})


def curves():
    """Curves of every law; the second gives up nearly all traction at slip 1."""
    yield CURVE
    yield Burckhardt(c1=0.6, c2=12, c3=0.59)
    yield Brixius(mobility_number=1)
    yield Brixius(mobility_number=40)
    yield Pacejka(
        stiffness_factor=8, shape_factor=1.8, peak_factor=0.7, curvature_factor=-1,
        rolling_resistance=0.05,
    )  # fmt: skip


# What a form makes use of: every preset by every shear law, or with every curve.
GROUND = {
    form: st.sampled_from(
        [
            variant.packed(WHEEL)
            for preset in preset_soils().values()
            for variant in (
                [preset.model_copy(update={'traction_curve': curve}) for curve in curves()]
                if form == Form.EMPIRICAL
                else shear_laws(preset.model_copy(update={'traction_curve': CURVE}))
            )
        ]
    )
    for form in FORMS
}
# Speeds where forms change over: at and about standstill, rolling, turning the other way.
SPEEDS = st.one_of(
    st.sampled_from([0.0, MIN_TRANSIT_SPEED, -MIN_TRANSIT_SPEED]),
    st.floats(-0.1, 0.1),
    st.floats(-40.0, 40.0),
)
SLIPPINGS = st.one_of(st.sampled_from([0.0, 1.0, -1.0]), st.floats(-1.5, 1.5))


@st.composite
def motions(draw):
    """Speed and wheel speed: rolling, slipping, counter-rotating, spinning on the spot."""
    v = draw(SPEEDS)
    rim = draw(st.one_of(SPEEDS, SLIPPINGS.map(lambda share: share * v)))
    return v, rim / RADIUS


@pytest.mark.parametrize('form', FORMS)
@given(data=st.data(), motion=motions(), z=DEPTHS, z_rate=RATES)
@settings(deadline=None, max_examples=150)
def test_mirrored_in_reverse(form, data, motion, z, z_rate):
    soil = data.draw(GROUND[form])
    v, omega = motion
    load, *others = contact(form, v, omega, z, z_rate, soil, RADIUS, WIDTH)
    backward = contact(form, -v, -omega, z, z_rate, soil, RADIUS, WIDTH)
    expected = (load, *(-other for other in others))
    assert backward == pytest.approx(expected, rel=1e-9, abs=1e-9 * load)


@pytest.mark.parametrize('form', [Form.PAPER, Form.BEKKER_WONG, Form.EMPIRICAL])
@given(v=st.floats(0.1, 20.0), share=st.floats(0.0, 1.0), z=DEPTHS, soil=SOILS)
@settings(deadline=None)
def test_thrust_of_the_closed_forms_is_odd_in_slip(form, v, share, z, soil):
    # Driving at slip s, r*omega = v/(1 - s); braking at -s, r*omega = v*(1 - s).
    share = min(share, 0.99)
    driving = contact(int(form), v, v / (1 - share) / RADIUS, z, 0.0, soil, RADIUS, WIDTH)
    braking = contact(int(form), v, v * (1 - share) / RADIUS, z, 0.0, soil, RADIUS, WIDTH)
    assert braking[1] == pytest.approx(-driving[1], rel=1e-6, abs=1e-6 * driving[0])
    assert (braking[0], braking[2]) == pytest.approx((driving[0], driving[2]))


@pytest.mark.parametrize('form', FORMS)
@given(
    data=st.data(), v=st.floats(-1e3, 1e3), omega=st.floats(-1e4, 1e4), z=st.floats(-1.0, 5.0),
    z_rate=st.floats(-5.0, 5.0),
)  # fmt: skip
@settings(deadline=None, max_examples=300)
def test_finite_everywhere(form, data, v, omega, z, z_rate):
    soil = data.draw(GROUND[form])
    load, *others = contact(form, v, omega, z, z_rate, soil, RADIUS, WIDTH)
    assert all(math.isfinite(force) for force in (load, *others))
    assert load >= 0.0


@pytest.mark.parametrize('form', FORMS)
@pytest.mark.parametrize('v', [0.0, -0.0, 1e-300, MIN_TRANSIT_SPEED, -1e-12])
@pytest.mark.parametrize('omega', [0.0, -0.0, 1e-300, 1e-12, 5.0, -5.0])
def test_finite_at_and_around_standstill(form, v, omega):
    forces = contact(form, v, omega, 0.1, 0.0, SAND, RADIUS, WIDTH)
    assert all(math.isfinite(force) for force in forces)


@pytest.mark.parametrize('form', FORMS)
@given(data=st.data(), motion=motions(), z=DEPTHS)
@settings(deadline=None, max_examples=400)
def test_soil_never_creates_energy(form, data, motion, z):
    # Either way, driven, braked, turning against the motion: what the shaft puts in is at least
    # what the axle gets out.
    soil = data.draw(GROUND[form])
    v, omega = motion
    load, thrust, resistance, moment = contact(form, v, omega, z, 0.0, soil, RADIUS, WIDTH)
    speed = max(abs(v), RADIUS * abs(omega))
    assert moment * omega >= (thrust - resistance) * v - 1e-9 * load * speed


def test_soil_without_strength_turns_no_wheel_backwards():
    # Soil that only presses: a wheel pushed over it could be turned against its motion, and
    # give back at the shaft what nobody put in.
    water = Soil(
        cohesive_modulus=0, frictional_modulus=1e6, sinkage_exponent=1, cohesion=0,
        friction_angle=0, shear_deformation_modulus=0.02,
    ).packed(WHEEL)  # fmt: skip
    for omega in (-4.0, -1.0, -1e-3):
        assert contact(2, 1.0, omega, 0.1, 0.0, water, RADIUS, WIDTH)[3] * omega >= 0.0
    assert contact(2, 1.0, 1.0, 0.1, 0.0, water, RADIUS, WIDTH)[3] > 0.0


@pytest.mark.parametrize('form', FORMS)
@given(data=st.data(), motion=motions(), z=st.floats(0.0, 0.5), more=st.floats(0.0, 0.2))
@settings(deadline=None, max_examples=150)
def test_deeper_wheels_bear_more(form, data, motion, z, more):
    soil = data.draw(GROUND[form])
    upper = contact(form, *motion, z, 0.0, soil, RADIUS, WIDTH)[0]
    lower = contact(form, *motion, z + more, 0.0, soil, RADIUS, WIDTH)[0]
    # Nodes lie otherwise: half a thousandth of what they leave open.
    assert lower >= upper * (1 - 5e-4)


@pytest.mark.parametrize('form', FORMS)
@given(
    data=st.data(), share=st.floats(0.05, 0.9), load=st.floats(300.0, 2e4), more=st.floats(0, 1)
)
@settings(deadline=None, max_examples=60)
def test_thrust_grows_with_load(form, data, share, load, more):
    # On the arc, soil in front of the angle where r*omega*cos(theta) = v is shorn forward: there
    # thrust may fall as the wheel sinks. It grows while the whole contact lies behind that angle,
    # 1 - z/r > v/(r*omega) = 1 - i.
    soil = data.draw(GROUND[form])
    deepest = share * RADIUS if form == Form.CONTACT else RADIUS
    thrusts = []
    for carried in (load, load * (1 + more)):
        motion = (form, 1.0, 1 / (1 - share) / RADIUS)
        z = equilibrium_sinkage(*motion, carried, soil, RADIUS, WIDTH)
        assume(z < deepest)
        thrusts.append(contact(*motion, z, 0.0, soil, RADIUS, WIDTH)[1])
    assert thrusts[1] >= thrusts[0] - 2e-3 * load


def rutted():
    """A track with ruts of several depths and widths, and fresh soil behind and ahead."""
    ruts = fresh_ruts(1, 0.0)
    for k in range(18):
        x = -1.0 + 0.1 * k
        press_rut(
            x, x + 0.1, 0.004 + 0.01 * (k % 7), 0.01 * (k % 3), 0.3 + 0.05 * (k % 4), 0, ruts
        )
    return ruts


RUTS = rutted()
PLACES = st.one_of(st.floats(-1.5, 1.5), st.sampled_from([0.0, 0.03]))


@st.composite
def states(draw):
    """Speed, wheel speed, sinkage, its rate and place."""
    v = draw(
        st.one_of(st.sampled_from([0.0, 0.05, -0.05]), st.floats(-0.1, 0.1), st.floats(-3, 3))
    )
    rim = draw(st.one_of(st.just(v), st.just(0.0), st.floats(-0.1, 0.1), st.floats(-4, 4)))
    z = draw(st.one_of(st.floats(-0.01, 0.06), st.floats(0.0, 0.6)))
    z_rate = draw(st.one_of(st.just(0.0), st.floats(-0.05, 0.05), st.floats(-5.0, 5.0)))
    return np.array([v, rim / RADIUS, z, z_rate, draw(PLACES)])


def largest_jump(force, a, b):
    """Largest jump of the forces between two states, over the load.

    Bisection that keeps the half with the larger change of forces converges to a jump. Without a
    jump the change converges to 0.
    """
    at_a, at_b = force(a), force(b)
    scale = max(at_a[0], at_b[0], 10.0)
    for _ in range(44):
        middle = (a + b) / 2
        at_middle = force(middle)
        scale = max(scale, at_middle[0])
        if np.abs(at_middle - at_a).sum() > np.abs(at_b - at_middle).sum():
            b, at_b = middle, at_middle
        else:
            a, at_a = middle, at_middle
    return np.max(np.abs(at_b - at_a)) / scale


@pytest.mark.parametrize('form', FORMS)
@given(data=st.data(), ends=st.tuples(states(), states()))
@settings(deadline=None, max_examples=150)
def test_forces_are_continuous(form, data, ends):
    soil = data.draw(GROUND[form]).reshape(1, -1)

    def force(state):
        return np.array(
            forces_at(
                form, *state, soil, EVERYWHERE, RADIUS, WIDTH, -1, UNTOUCHED, FREE, 0.0
            )[:4]
        )  # fmt: skip

    assert largest_jump(force, *ends) < 3e-3


# Springy and dead, soft to the point of springing right back, forgetful.
NEIGHBOURS = [
    soil.packed(WHEEL)
    for soil in (
        load_soil('sandy_loam_chrono'),
        load_soil('dry_sand'),
        load_soil('dry_sand').model_copy(update={'elastic_modulus': 5e5, 'cohesion': 0.0}),
        load_soil('soft_patch_chrono').model_copy(update={'shear_memory': 0.5}),
        load_soil('clayey_soil_55').model_copy(
            update={'shear_law': 'wong_preston_thomas', 'residual_ratio': 0.5}
        ),
    )
]
BORDERS = np.array([-np.inf, 0.0, 0.03])


@given(
    soils=st.tuples(*[st.sampled_from(NEIGHBOURS)] * 3),
    ends=st.tuples(states(), states()),
    track=st.sampled_from([-1, 0]),
    imposed=st.sampled_from([FREE, 5000.0]),
)
@settings(deadline=None, max_examples=400)
def test_arc_is_continuous_over_borders_and_ruts(soils, ends, track, imposed):
    soils = np.array(soils)

    def force(state):
        return np.array(
            forces_at(2, *state, soils, BORDERS, RADIUS, WIDTH, track, RUTS, FREE, 0.0)[:4]
        )

    assert largest_jump(force, *ends) < 3e-3
    # Nor does the soil give energy there, with its own load or another.
    for state in ends:
        v, omega, z, _, x = state
        load, thrust, resistance, moment, _ = forces_at(
            2, v, omega, z, 0.0, x, soils, BORDERS, RADIUS, WIDTH, track, RUTS, imposed, 0.0
        )
        assert np.all(np.isfinite([load, thrust, resistance, moment]))
        speed = max(abs(v), RADIUS * abs(omega))
        assert moment * omega >= (thrust - resistance) * v - 1e-9 * load * speed


@pytest.mark.parametrize('z_rate', [0.0, 0.3, -0.1])
def test_force_passes_from_one_soil_to_the_next(z_rate):
    soils = np.array([NEIGHBOURS[0], NEIGHBOURS[3]])
    starts = np.array([-np.inf, 0.0])
    places = np.linspace(-0.6, 0.6, 601)
    loads = np.array(
        [
            forces_at(2, 1.0, 2.2, 0.05, z_rate, x, soils, starts, RADIUS, WIDTH, -1, UNTOUCHED,
                      FREE, 0.0)[0]
            for x in places
        ]
    )  # fmt: skip
    alone = [contact(2, 1.0, 2.2, 0.05, z_rate, soil, RADIUS, WIDTH)[0] for soil in soils]
    assert loads[0] == pytest.approx(alone[0])
    assert loads[-1] == pytest.approx(alone[1])
    # The soft one ahead carries less, and more of the wheel comes to lie on it.
    assert np.all(np.diff(loads) <= 1e-3 * alone[0])


@pytest.mark.parametrize('form', FORMS)
@given(v=st.floats(0.01, 20.0), slip=st.floats(-0.9, 0.9), soil=SOILS, load=st.floats(50.0, 2e4))
@settings(deadline=None)
def test_equilibrium_carries_the_load(form, v, slip, soil, load):
    rim = v / (1 - slip) if slip > 0 else v * (1 + slip)
    z = equilibrium_sinkage(form, v, rim / RADIUS, load, soil, RADIUS, WIDTH)
    carried = contact(form, v, rim / RADIUS, z, 0.0, soil, RADIUS, WIDTH)[0]
    if z == RADIUS:
        assert carried <= load
        return
    # To a millionth of the load, or to 0.1 um of sinkage, whichever comes first.
    deeper = contact(form, v, rim / RADIUS, z + 1e-7, 0.0, soil, RADIUS, WIDTH)[0]
    higher = contact(form, v, rim / RADIUS, z - 1e-7, 0.0, soil, RADIUS, WIDTH)[0]
    assert carried == pytest.approx(load, rel=1e-6) or higher <= load <= deeper


def test_equilibrium_by_hand():
    # On clay without damping or exponent (n = 1, k = 1e6 N/m^3): plate pressure 1e6*z over
    # b*sqrt(2*r*z - z^2). At z = 0.05 m: l = sqrt(0.0475) = 0.217945 m, W = 4358.90 N.
    clay = Soil(
        cohesive_modulus=0, frictional_modulus=1e6, sinkage_exponent=1, cohesion=5e3,
        friction_angle=0.2, shear_deformation_modulus=0.02, damping=0,
    ).packed(WHEEL)  # fmt: skip
    z = equilibrium_sinkage(int(Form.BEKKER_WONG), 0.0, 0.0, 4358.90, clay, RADIUS, WIDTH)
    assert z == pytest.approx(0.05, abs=1e-6)


def test_equilibrium_of_nothing_and_of_too_much():
    assert equilibrium_sinkage(2, 1.0, 2.0, 0.0, SAND, RADIUS, WIDTH) == 0.0
    assert equilibrium_sinkage(2, 0.0, 0.0, 1e9, SAND, RADIUS, WIDTH) == RADIUS


@pytest.mark.parametrize('form', [Form.BEKKER_WONG, Form.CONTACT])
def test_sinkage_does_not_depend_on_where_the_search_begins(form):
    # A rut 0.08 m deep carries nothing down to its bottom: the search has to cross that.
    ruts = fresh_ruts(1, 2.0)
    press_rut(-1.0, 1.0, 0.08, 0.0, WIDTH, 0, ruts)
    soils = SAND.reshape(1, -1)
    for load in (10.0, 4905.0, 1.5e4):
        for track in (-1, 0):
            place = (0.0, soils, EVERYWHERE, RADIUS, WIDTH, track, ruts)
            found = [
                sinkage_at(int(form), 1.0, 2.5, load, *place, guess)
                for guess in (0.0, 1e-6, 0.05, 0.079, 0.3, 0.4999, RADIUS, 1.0)
            ]
            assert found == pytest.approx([found[0]] * len(found), rel=1e-6)
            carried = forces_at(
                int(form), 1.0, 2.5, found[0], 0.0, *place, FREE, 0.0
            )[0]  # fmt: skip
            assert carried == pytest.approx(load, rel=1e-6)
