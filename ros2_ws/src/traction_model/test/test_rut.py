"""Ruts: what is kept of them, and how a wheel that runs in one is carried."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from traction_model.contact.contact import EVERYWHERE, FREE, UNTOUCHED, forces_at
from traction_model.simulation.simulate import simulate
from traction_model.soil.rut import BEHIND, CELL, fresh_ruts, press_rut, rut_at
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import Axle, Vehicle, load_vehicle
from traction_model.vehicle.wheel import Wheel

RADIUS, WIDTH = 0.5, 0.4
WHEEL = Wheel(radius=RADIUS, width=WIDTH, inertia=20)
TRACTOR = load_vehicle('tractor_4wd')
# One that springs back, one that does not.
SPRINGY = load_soil('sandy_loam_chrono')
DEAD = load_soil('paper_sand').model_copy(update={'elastic_modulus': None})


def rut(depth, shear=0.0, width=WIDTH, x_from=-2.0, x_to=2.0):
    """Track with a rut."""
    ruts = fresh_ruts(1, 0.0)
    press_rut(x_from, x_to, depth, shear, width, 0, ruts)
    return ruts


def carried(soil, v, z, ruts, track=0, x=0.0, wheel=WHEEL, rim=None):
    """Forces of a wheel in a rut, and the shear displacement that it leaves."""
    omega = (1.25 * v if rim is None else rim) / wheel.radius
    return forces_at(
        2, v, omega, z, 0.0, x, np.array([soil.packed(wheel)]), EVERYWHERE, wheel.radius,
        wheel.width, track, ruts, FREE, 0.0,
    )  # fmt: skip


def test_untouched_soil_is_fresh():
    assert rut_at(0.3, -1, UNTOUCHED) == (0.0, 0.0, 0.0)
    assert rut_at(0.3, 0, fresh_ruts(1, 2.0)) == (0.0, 0.0, 0.0)


def test_rut_is_linear_between_cells():
    # From cell 10 on to a cell short of the wheel at 30; a quarter of the way from cell 9 to 10
    # a quarter of depth and shear, and the width of what is rut there.
    ruts = rut(0.08, 0.2, 0.3, 10.5 * CELL, 30.5 * CELL)
    assert rut_at(9.25 * CELL, 0, ruts) == pytest.approx((0.02, 0.05, 0.3))
    assert rut_at(9.0 * CELL, 0, ruts)[0] == pytest.approx(0.0)
    assert rut_at(20.0 * CELL, 0, ruts) == pytest.approx((0.08, 0.2, 0.3))
    assert rut_at(29.0 * CELL, 0, ruts) == pytest.approx((0.08, 0.2, 0.3))
    assert rut_at(29.5 * CELL, 0, ruts) == pytest.approx((0.04, 0.1, 0.3))
    assert rut_at(30.0 * CELL, 0, ruts) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize('way', [1, -1])
def test_own_rut_is_none_to_a_wheel(way):
    # However short its contact: what lies ahead of a wheel that rolls is fresh.
    ruts = fresh_ruts(1, 0.0)
    x = 0.0
    for _ in range(100):
        press_rut(x, x + way * 0.007, 0.05, 0.1, WIDTH, 0, ruts)
        x += way * 0.007
        assert rut_at(x + way * 1e-6, 0, ruts) == (0.0, 0.0, 0.0)
        assert rut_at(x + way * 0.05, 0, ruts) == (0.0, 0.0, 0.0)
    assert rut_at(x - way * 2 * CELL, 0, ruts) == pytest.approx((0.05, 0.1, WIDTH))


def test_deepest_widest_and_most_sheared_stay():
    ruts = rut(0.05, 0.1, 0.3)
    press_rut(-2.0, 2.0, 0.03, 0.4, 0.5, 0, ruts)
    assert rut_at(0.0, 0, ruts) == pytest.approx((0.05, 0.4, 0.5))


@pytest.mark.parametrize('way', [1, -1])
def test_what_is_far_behind_is_forgotten(way):
    # A ring of BEHIND metres, driven forward or in reverse for three times as long.
    ruts = fresh_ruts(1, 0.0)
    x = 0.0
    for _ in range(round(3 * BEHIND / 0.01)):
        press_rut(x, x + way * 0.01, 0.05, 0.1, WIDTH, 0, ruts)
        x += way * 0.01
        assert rut_at(x + way * 0.3, 0, ruts)[0] == 0.0
    assert rut_at(x - way * 0.9 * BEHIND, 0, ruts)[0] == pytest.approx(0.05)
    assert rut_at(x - way * 1.1 * BEHIND, 0, ruts)[0] == 0.0


def test_one_long_step_leaves_a_ring_and_no_more():
    ruts = rut(0.05, x_from=0.0, x_to=5 * BEHIND)
    assert rut_at(4.5 * BEHIND, 0, ruts)[0] == pytest.approx(0.05)
    assert rut_at(3.9 * BEHIND, 0, ruts)[0] == 0.0


def in_rut(soil, v, rim, z, depth, shear, width):
    """Load, net force, moment of a strip in a rut that deep, by adaptive quadrature.

    Surface: depth - p(depth)/E. Ahead of the bottom sigma = min(E*(sunk - surface), p(sunk)),
    behind it, where the rim has risen by r*(1 - cos th), sigma = peak - E*r*(1 - cos th), to
    both of which damping adds D*rim*sin th. j starts from what the soil has seen before.
    """
    k = soil.cohesive_modulus / WHEEL.width + soil.frictional_modulus
    stiff = soil.elastic_modulus or math.inf

    def law(sunk):
        return k * max(sunk, 0.0) ** soil.sinkage_exponent

    surface = depth - law(depth) / stiff
    entry = math.acos(1 - (z - surface) / RADIUS)
    peak = min(stiff * (z - surface), law(z))
    last = -math.acos(1 - peak / stiff / RADIUS)

    def sigma(th):
        sunk = z - RADIUS * (1 - math.cos(th))
        damped = soil.damping * rim * math.sin(th)
        if th < 0:
            return max(peak - stiff * (z - sunk) + damped, 0.0)
        return min(stiff * max(sunk - surface, 0.0), law(sunk)) + damped

    kinks = [0.0, math.acos(1 - (z - depth) / RADIUS) if z > depth else 0.0]
    kinks += [math.acos(v / rim), -math.acos(v / rim)]
    kinks = sorted(th for th in kinks if last < th < entry)

    def tau(th):
        j = shear + quad(
            lambda s: abs(rim * math.cos(s) - v) * RADIUS * math.cos(s) / v, th, entry,
            points=[kink for kink in kinks if kink > th] or None, epsabs=1e-12,
        )[0]  # fmt: skip
        sign = 1.0 if rim * math.cos(th) > v else -1.0
        strength = soil.cohesion + sigma(th) * math.tan(soil.friction_angle)
        return sign * strength * -math.expm1(-j / soil.shear_deformation_modulus)

    def over_arc(stress):
        return quad(
            lambda th: stress(th) * width * RADIUS * math.cos(th), last, entry,
            points=kinks or None, epsrel=1e-8, limit=200,
        )[0]  # fmt: skip

    return np.array(
        [
            over_arc(sigma),
            over_arc(tau),
            RADIUS * over_arc(lambda th: tau(th) * math.cos(th) + sigma(th) * math.sin(th)),
        ]
    )


@pytest.mark.parametrize('rut_width', [0.4, 0.25, 0.6])
@pytest.mark.parametrize(
    ('soil', 'depth', 'z'),
    [
        (SPRINGY, 0.04, 0.05),  # yields again
        (SPRINGY, 0.04, 0.039),  # on what has sprung back
        (DEAD, 0.10, 0.13),
    ],
)
def test_wheel_in_a_rut_against_quadrature(soil, depth, z, rut_width):
    # A wheel that is wider than the rut runs with the rest of its width on fresh soil, whose
    # pressure goes by the wheel's width.
    v, rim = 1.0, 1.2
    expected = in_rut(soil, v, rim, z, depth, 0.01, min(rut_width, WIDTH))
    if rut_width < WIDTH:
        expected += in_rut(soil, v, rim, z, 0.0, 0.0, WIDTH - rut_width)
    load, thrust, resistance, moment, _ = carried(soil, v, z, rut(depth, 0.01, rut_width), rim=rim)
    assert load == pytest.approx(expected[0], rel=3e-4)
    assert thrust - resistance == pytest.approx(expected[1], abs=3e-4 * load)
    assert moment == pytest.approx(expected[2], abs=3e-4 * load * RADIUS)


def test_shear_memory_decides_what_is_kept():
    ruts = rut(0.03, shear=0.05)
    keeps = SPRINGY.model_copy(update={'shear_memory': 1.0})
    half = SPRINGY.model_copy(update={'shear_memory': 0.5})
    forgets = SPRINGY.model_copy(update={'shear_memory': 0.0})
    unsheared = carried(keeps, 1.0, 0.04, rut(0.03, shear=0.0))
    assert carried(forgets, 1.0, 0.04, ruts) == pytest.approx(unsheared)
    halved = carried(keeps, 1.0, 0.04, rut(0.03, shear=0.025))
    assert carried(half, 1.0, 0.04, ruts) == pytest.approx(halved)
    # Sheared soil resists more from the first: more thrust under the same load; it is left
    # with what it has seen before and since.
    sheared = carried(keeps, 1.0, 0.04, ruts)
    assert sheared[0] == pytest.approx(unsheared[0])
    assert sheared[1] > 1.1 * unsheared[1]
    assert sheared[4] == pytest.approx(unsheared[4] + 0.05)


def test_wheel_above_its_rut_is_not_carried():
    # 3e5 Pa or so over 4e7 Pa/m: it springs back by some millimetres, not by 30.
    assert carried(SPRINGY, 1.0, 0.03, rut(0.06)) == (0.0, 0.0, 0.0, 0.0, 0.0)


def test_rut_fades_into_fresh_soil():
    for soil in (SPRINGY, DEAD, SPRINGY.model_copy(update={'elastic_modulus': 1e5})):
        fresh = carried(soil, 1.0, 0.05, UNTOUCHED, track=-1)
        assert carried(soil, 1.0, 0.05, rut(1e-9)) == pytest.approx(fresh, rel=1e-5)


def ruts_of(run, vehicle):
    """Mean sinkage of each axle at the end of a run."""
    tail = run.sinkage[-200:].mean(axis=0)
    sides = len(vehicle.axles[0].wheel_names)
    return tail.reshape(-1, sides).mean(axis=1)


def straight(axles, load=1500.0):
    """A vehicle of like wheels one behind the other, evenly loaded."""
    return Vehicle(
        chassis_mass=load * axles,
        chassis_cg_x=(axles - 1) / 2 * 1.5,
        chassis_cg_height=0.0,
        axles=[
            Axle(wheel_names=[f'w{k}'], x=1.5 * (axles - 1 - k), wheel=WHEEL) for k in range(axles)
        ],
    )


def test_each_wheel_of_three_goes_a_little_deeper_than_the_one_before():
    vehicle = straight(3)
    torque = np.full((801, 3), 1000.0)
    runs = [
        ruts_of(simulate(vehicle, SPRINGY, torque, 0.005, v0=1.5, multipass=way), vehicle)
        for way in (True, False)
    ]
    # On fresh soil they sink alike but for load transfer; in a rut, by less than the first on
    # top of it each.
    first, second, third = runs[0]
    assert first == pytest.approx(runs[1][0], rel=0.05)
    assert first < second < 1.6 * first
    assert second - first > third - second > 0


def test_rear_wheels_need_less_effort_in_ruts():
    torque = np.tile([1500.0, 1500.0, 5000.0, 5000.0], (1001, 1))
    ruts, fresh = (
        simulate(TRACTOR, SPRINGY, torque, 0.005, v0=1.0, omega0=[1 / 0.65] * 2 + [1 / 0.85] * 2,
                 multipass=way)
        for way in (True, False)
    )  # fmt: skip
    # Both start on fresh soil; the rear wheels reach the ruts after 2.4 m.
    assert ruts.v[100] == pytest.approx(fresh.v[100], rel=1e-3)
    resistance = [run.motion_resistance[-100:, 2:].mean() / run.load[-100:, 2:].mean()
                  for run in (ruts, fresh)]  # fmt: skip
    # They are wider and heavier than the front wheels, so that they yield again.
    assert resistance[0] < 0.95 * resistance[1]
    assert ruts.v[-1] > fresh.v[-1]


def test_reversing_leads_back_into_ones_own_rut():
    wheel = load_vehicle('single_wheel_rig')
    soil = load_soil('sandy_loam_chrono')
    torque = np.concatenate([np.full((400, 1), 600.0), np.full((1200, 1), -600.0)])
    run = simulate(wheel, soil, torque, 0.005)
    back = (run.x < 0.7 * run.x.max()) & (run.x > 0.3 * run.x.max()) & (run.v < -0.1)
    there = (run.x < 0.7 * run.x.max()) & (run.x > 0.3 * run.x.max()) & (run.v > 0.1)
    assert back.any()
    assert there.any()
    # Pressed before, it takes less to roll over it.
    assert np.abs(run.motion_resistance[back]).mean() < 0.7 * run.motion_resistance[there].mean()
    assert run.x[-1] < 0.0


def test_reverse_of_a_long_way_has_ruts_too():
    # Mirrored: driven backwards for longer than a ring, wheels that now follow meet ruts.
    vehicle = straight(2)
    torque = np.full((801, 2), 1000.0)
    forward = simulate(vehicle, SPRINGY, torque, 0.005, v0=3.0)
    backward = simulate(vehicle, SPRINGY, -torque, 0.005, v0=-3.0)
    assert abs(backward.x[-1]) > 2 * BEHIND
    assert backward.v == pytest.approx(-forward.v, abs=0.02 * forward.v.max())
    assert backward.sinkage[:, ::-1] == pytest.approx(forward.sinkage, abs=1e-3)
