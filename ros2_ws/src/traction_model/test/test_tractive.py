"""Tractive figures against published optima, the contact model, and the balance of power."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from traction_model.contact.contact import Form, contact
from traction_model.contact.tractive import (
    LARGEST_SLIP,
    greatest_pull_slip,
    optimum_slip,
    steady_contact,
    tractive_figures,
)
from traction_model.soil.empirical import Brixius, Burckhardt, Pacejka, fit_curve
from traction_model.soil.soil import load_soil, preset_soils
from traction_model.vehicle.vehicle import load_vehicle
from traction_model.vehicle.wheel import Wheel

TRACTOR = load_vehicle('tractor_4wd')
REAR = TRACTOR.wheels[-1]
LOAD = 12e3
LOAM = load_soil('sandy_loam_15')


# Optima of ASABE D497: slip and tractive efficiency by mobility number.
@pytest.mark.parametrize(
    ('mobility', 'slip', 'efficiency'),
    [(20, 0.113, 0.695), (30, 0.097, 0.746), (55, 0.085, 0.786), (80, 0.080, 0.800)],
)
def test_published_optimum_of_brixius(mobility, slip, efficiency):
    curve = Brixius(mobility_number=mobility)
    best = optimum_slip(curve, REAR, LOAD)
    assert best == pytest.approx(slip, abs=5e-4)
    figures = tractive_figures(curve, REAR, best, LOAD)
    assert figures.tractive_efficiency == pytest.approx(efficiency, abs=5e-4)


def test_figures_of_a_curve_by_hand():
    # Bn 30, s 0.1, W 10 kN: GTR 0.481200 and MRR 0.082462 (worked out in test_empirical):
    # TE = 0.9*(1 - 0.082462/0.481200) = 0.745769.
    figures = tractive_figures(Brixius(mobility_number=30), REAR, 0.1, 1e4)
    assert figures.gross_traction == pytest.approx(4812.00, abs=0.01)
    assert figures.motion_resistance == pytest.approx(824.62, abs=0.01)
    assert figures.net_traction == pytest.approx(3987.38, abs=0.02)
    assert figures.net_traction_ratio == pytest.approx(0.398738, abs=2e-6)
    assert figures.tractive_efficiency == pytest.approx(0.745769, abs=2e-6)


def test_figures_of_a_soil_are_the_contact_model_s():
    # Slip 0.2 at a rim speed of 2 m/s: v = 1.6 m/s, omega = 2/r.
    sinkage, thrust, resistance, moment = steady_contact(LOAM, REAR, 0.2, LOAD, speed=2.0)
    r, b = REAR.radius, REAR.width
    forces = contact(int(Form.CONTACT), 1.6, 2.0 / r, sinkage, 0.0, LOAM.packed(REAR), r, b)
    assert forces == pytest.approx((LOAD, thrust, resistance, moment), rel=2e-6)
    figures = tractive_figures(LOAM, REAR, 0.2, LOAD, speed=2.0)
    assert figures.gross_traction == pytest.approx(moment / r)
    assert figures.thrust == pytest.approx(thrust)
    assert figures.net_traction == pytest.approx(thrust - resistance)
    # The power put in is 2 m/s of gross traction, what comes out 1.6 m/s of net.
    assert figures.tractive_efficiency == pytest.approx(
        1.6 * figures.net_traction / (2.0 * figures.gross_traction)
    )


@pytest.mark.parametrize('form', [Form.PAPER, Form.BEKKER_WONG, Form.CONTACT])
@given(
    slip=st.floats(-1.0, 1.0),
    soil=st.sampled_from(sorted(preset_soils())),
    # The weakest soil carries 19.8 kN with the wheel sunk to its axle.
    load=st.floats(500.0, 19e3),
)
@settings(deadline=None, max_examples=150)
def test_finite_and_efficient_at_most_wholly(form, slip, soil, load):
    figures = tractive_figures(load_soil(soil), REAR, slip, load, form)
    for value in (*figures[2:], figures.motion_resistance, figures.motion_resistance_ratio):
        assert math.isfinite(value)
    assert 0.0 <= figures.tractive_efficiency <= 1.0 + 1e-9


@pytest.mark.parametrize('slip', [-1.0, -0.3, 0.0, 1.0])
def test_no_efficiency_where_nothing_is_pulled(slip):
    # Braked; rolling freely, where all torque goes into the soil; spinning at standstill.
    figures = tractive_figures(load_soil('paper_sand'), REAR, slip, LOAD)
    assert figures.tractive_efficiency == 0.0


def test_optimum_against_a_fine_scan():
    scan = np.linspace(1e-4, LARGEST_SLIP, 9000)
    figures = tractive_figures(LOAM, REAR, scan, LOAD)
    best = optimum_slip(LOAM, REAR, LOAD)
    assert best == pytest.approx(scan[np.argmax(figures.tractive_efficiency)], abs=1e-4)
    pull = greatest_pull_slip(LOAM, REAR, LOAD)
    assert pull == pytest.approx(scan[np.argmax(figures.net_traction)], abs=1e-4)
    # The best slip to work at lies below that of the greatest pull.
    assert best < pull


def test_greatest_pull_by_hand():
    # c1*c2*exp(-c2*s) = c3: s = ln(1.28*23.99/0.52)/23.99 = 0.170005.
    curve = Burckhardt(c1=1.28, c2=23.99, c3=0.52, rolling_resistance=0.02)
    assert greatest_pull_slip(curve, REAR, LOAD) == pytest.approx(0.170005, abs=1e-6)
    # A curve that only rises pulls most at the end.
    rising = Brixius(mobility_number=1e4)
    assert greatest_pull_slip(rising, REAR, LOAD) == LARGEST_SLIP


def test_no_optimum_where_a_wheel_cannot_pull():
    # Net traction is negative at every slip: 0.2 at most, less 0.3.
    curve = Burckhardt(c1=0.2, c2=10.0, c3=0.0, rolling_resistance=0.3)
    with pytest.raises(ValueError, match='net traction is not positive at any slip'):
        optimum_slip(curve, REAR, LOAD)


def test_vehicle_sums_its_wheels():
    slips = np.array([-0.2, 0.05, 0.15])
    whole = tractive_figures(LOAM, TRACTOR, slips)
    parts = [
        tractive_figures(LOAM, wheel, slips, float(load))
        for wheel, load in zip(TRACTOR.wheels, TRACTOR.static_loads(), strict=True)
    ]
    # 3600 + 2*120 + 2*300 = 4440 kg at 9.81 m/s^2.
    assert whole.load == pytest.approx(4440 * 9.81)
    for name in ('gross_traction', 'thrust', 'net_traction', 'motion_resistance'):
        total = sum(getattr(part, name) for part in parts)
        assert getattr(whole, name) == pytest.approx(total)
    # Power over power: all rims go at one speed, so forces weigh as powers.
    power_in = sum(part.gross_traction[2] for part in parts)
    power_out = sum(part.net_traction[2] * 0.85 for part in parts)
    assert whole.tractive_efficiency[2] == pytest.approx(power_out / power_in)
    best = optimum_slip(LOAM, TRACTOR)
    singles = [
        optimum_slip(LOAM, wheel, float(load))
        for wheel, load in zip(TRACTOR.wheels, TRACTOR.static_loads(), strict=True)
    ]
    assert min(singles) < best < max(singles)


@pytest.mark.parametrize('law', [Burckhardt, Pacejka])
@pytest.mark.parametrize('soil', ['sandy_loam_15', 'lete_sand', 'clayey_soil_38'])
def test_fit_of_a_soil(law, soil):
    slips = np.linspace(0.02, 0.9, 45)
    on_soil = tractive_figures(load_soil(soil), REAR, slips, LOAD)
    samples = slips, on_soil.net_traction_ratio, on_soil.gross_traction_ratio
    curve, fit = fit_curve(law, *samples)
    assert fit.net_rms < 0.02
    assert fit.gross_rms < 0.02
    # The figures of the curve are those of the soil but for the errors that the fit returns.
    on_curve = tractive_figures(curve, REAR, slips, LOAD)
    for name, most in (('net_traction', fit.net_max), ('gross_traction', fit.gross_max)):
        errors = getattr(on_curve, name) - getattr(on_soil, name)
        assert np.max(np.abs(errors)) == pytest.approx(most * LOAD)
    # One mobility number says less than four or five coefficients.
    assert fit.net_rms < fit_curve(Brixius, *samples)[1].net_rms


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ({'load': None}, 'load on the wheel must be above 0 N, got None'),
        ({'load': -1.0}, 'load on the wheel must be above 0 N'),
        ({'load': math.nan}, 'load on the wheel must be above 0 N'),
        ({'slip': 1.5}, 'slip must be a share'),
        ({'speed': 0.0}, 'speed must be above 0'),
        ({'wheel': TRACTOR}, 'brings its own loads'),
        ({'load': 1e9}, 'sunk to its axle'),
    ],
)
def test_names_what_is_wrong(arguments, message):
    usual = {'ground': LOAM, 'wheel': REAR, 'slip': 0.1, 'load': LOAD}
    with pytest.raises(ValueError, match=message):
        tractive_figures(**usual | arguments)


def test_a_heavier_wheel_sinks_deeper():
    wheel = Wheel(radius=0.5, width=0.4, inertia=20)
    sinkages = [steady_contact(LOAM, wheel, 0.1, load)[0] for load in (1e3, 3e3, 9e3)]
    assert sinkages == sorted(sinkages)
    assert sinkages[0] > 0
