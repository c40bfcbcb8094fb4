"""Empirical curves against their printed formulas, and fits against curves that are known."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydantic import ValidationError

from traction_model.soil.empirical import (
    CURVE_COLUMNS,
    Brixius,
    Burckhardt,
    Law,
    Pacejka,
    curve_ratios,
    fit_curve,
)

SLIPS = st.floats(-1.0, 1.0)
RATIOS = st.floats(0.0, 1.0)


@st.composite
def burckhardts(draw):
    c1 = draw(st.floats(0.01, 2.0))
    c2 = draw(st.floats(0.1, 100.0))
    fall = draw(RATIOS) * c1 * (1 - math.exp(-c2))
    return Burckhardt(c1=c1, c2=c2, c3=fall, rolling_resistance=draw(RATIOS))


BRIXIUS = st.builds(Brixius, mobility_number=st.floats(0.1, 1000.0))
PACEJKA = st.builds(
    Pacejka,
    stiffness_factor=st.floats(0.1, 50.0),
    shape_factor=st.floats(1.0, 2.0),
    peak_factor=st.floats(0.01, 2.0),
    curvature_factor=st.floats(-10.0, 1.0),
    rolling_resistance=RATIOS,
)
CURVES = st.one_of(BRIXIUS, burckhardts(), PACEJKA)


def test_brixius_by_hand():
    # Bn 30, s 0.1: 1 - exp(-3) = 0.950213, 1 - exp(-0.75) = 0.527633;
    # GTR = 0.88*0.950213*0.527633 + 0.04 = 0.481200;
    # MRR = 1/30 + 0.04 + 0.05/sqrt(30) = 0.082462.
    curve = Brixius(mobility_number=30)
    assert curve.gross_traction_ratio(0.1) == pytest.approx(0.481200, abs=1e-6)
    assert curve.motion_resistance_ratio(0.1) == pytest.approx(0.082462, abs=1e-6)
    assert curve.net_traction_ratio(0.1) == pytest.approx(0.481200 - 0.082462, abs=2e-6)


def test_burckhardt_by_hand():
    # Dry asphalt, c = (1.28, 23.99, 0.52), at s 0.15: 1.28*(1 - exp(-3.5985)) - 0.078
    # = 1.28*0.972635 - 0.078 = 1.166973. Its peak lies where c1*c2*exp(-c2*s) = c3,
    # s = ln(59.0523)/23.99 = 0.170005.
    curve = Burckhardt(c1=1.28, c2=23.99, c3=0.52, rolling_resistance=0.01)
    assert curve.gross_traction_ratio([0.15, -0.15]) == pytest.approx(
        [1.166973, -1.166973], abs=1e-6
    )
    assert curve.motion_resistance_ratio([0.15, -0.15]) == pytest.approx([0.01, 0.01])
    scan = np.linspace(0, 1, 100001)
    assert scan[np.argmax(curve.gross_traction_ratio(scan))] == pytest.approx(0.170005, abs=2e-5)


def test_pacejka_by_hand():
    # B 10, C 1.9, D 1, E 0.97 at s 0.1: x = 1, atan 1 = 0.785398;
    # 1 - 0.97*(1 - 0.785398) = 0.791836; atan = 0.669743; sin(1.9*0.669743) = 0.955842.
    curve = Pacejka(stiffness_factor=10, shape_factor=1.9, peak_factor=1, curvature_factor=0.97)
    assert curve.gross_traction_ratio(0.1) == pytest.approx(0.955842, abs=1e-6)
    # The initial slope is B*C*D = 19.
    assert curve.gross_traction_ratio(1e-6) / 1e-6 == pytest.approx(19, rel=1e-4)


def test_mobility_number_by_hand():
    # CI 900 kPa, b 0.47 m, d 1.75 m, W 20 kN: CI*b*d/W = 37.0125;
    # delta/h = 0.08/0.4 = 0.2: 1 + 5*0.2 = 2; 1 + 3*0.47/1.75 = 1.805714;
    # Bn = 37.0125*2/1.805714 = 40.9949.
    curve = Brixius.from_tyre(
        cone_index=900e3, width=0.47, diameter=1.75, load=20e3, section_height=0.4, deflection=0.08
    )
    assert curve.mobility_number == pytest.approx(40.9949, abs=1e-4)


@pytest.mark.parametrize(
    ('name', 'value'),
    [
        ('cone_index', 0.0),
        ('width', -0.1),
        ('diameter', math.inf),
        ('load', 0.0),
        ('section_height', math.nan),
        ('deflection', 0.5),
    ],
)
def test_mobility_number_names_what_is_wrong(name, value):
    tyre = {
        'cone_index': 900e3,
        'width': 0.47,
        'diameter': 1.75,
        'load': 20e3,
        'section_height': 0.4,
        'deflection': 0.08,
    }
    with pytest.raises(ValueError, match=f'^{name} is out of range'):
        Brixius.from_tyre(**tyre | {name: value})


@given(CURVES, SLIPS)
def test_finite_and_bounded(curve, slip):
    gross, resistance = curve_ratios(curve.packed(), slip)
    # The most that each formula allows: 0.88 + 0.04, c1, D.
    most = {Law.BRIXIUS: 0.92, Law.BURCKHARDT: curve.packed()[1], Law.PACEJKA: curve.packed()[3]}
    assert abs(gross) <= most[Law(int(curve.packed()[0]))] * (1 + 1e-12)
    assert 0.0 <= resistance < math.inf


@given(CURVES, SLIPS)
def test_odd_about_the_traction_at_no_slip(curve, slip):
    # Burckhardt and Pacejka have none at no slip; Brixius has the 0.04 of rolling.
    at_rest, _ = curve_ratios(curve.packed(), 0.0)
    assert at_rest == (0.04 if isinstance(curve, Brixius) else 0.0)
    driven, resists = curve_ratios(curve.packed(), slip)
    braked, resists_too = curve_ratios(curve.packed(), -slip)
    assert driven - at_rest == pytest.approx(at_rest - braked, abs=1e-12)
    assert resists == resists_too


@given(CURVES, SLIPS, st.floats(1e-9, 1e-3))
def test_continuous(curve, slip, step):
    # No curve is steeper anywhere than this: c1*c2; 0.88*7.5, and 0.5/sqrt(Bn) of
    # resistance; B*C*D, times 1 + |E| where E bends the curve up.
    _, first, second, third, fourth, _ = curve.packed()
    if isinstance(curve, Brixius):
        slope = 0.88 * 7.5 + 0.5 / math.sqrt(first)
    elif isinstance(curve, Burckhardt):
        slope = first * second + third
    else:
        slope = first * second * third * (1 + abs(fourth))
    assume(slip + step <= 1.0)
    here = np.array(curve_ratios(curve.packed(), slip))
    there = np.array(curve_ratios(curve.packed(), slip + step))
    assert np.all(np.abs(there - here) <= slope * step * (1 + 1e-9) + 1e-12)


@given(BRIXIUS, SLIPS, SLIPS)
def test_brixius_grows_with_slip(curve, one, other):
    less, more = sorted((one, other))
    gross = curve.gross_traction_ratio([less, more])
    assert gross[0] <= gross[1]


@given(st.floats(1.0, 500.0), st.floats(1.0, 100.0), st.floats(0.0, 1.0))
def test_firmer_soil_pulls_better(mobility, more, slip):
    softer = Brixius(mobility_number=mobility)
    firmer = Brixius(mobility_number=mobility + more)
    assert firmer.net_traction_ratio(slip) > softer.net_traction_ratio(slip)


@given(CURVES, SLIPS)
def test_never_creates_energy(curve, slip):
    # With rim speed 1 driving and ground speed 1 braking: gross*rim >= net*ground.
    rim, ground = min(1.0, 1.0 + slip), min(1.0, 1.0 - slip)
    gross, resistance = curve_ratios(curve.packed(), slip)
    assert gross * rim >= (gross - resistance) * ground - 1e-12


@given(CURVES)
def test_packed(curve):
    assert curve.packed().shape == (CURVE_COLUMNS,)
    assert Law(int(curve.packed()[0])).name == type(curve).__name__.upper()


@pytest.mark.parametrize('slip', [1.0001, -2.0, math.nan, math.inf])
def test_refuses_what_is_no_slip(slip):
    with pytest.raises(ValueError, match='slip must be a share from -1'):
        Brixius(mobility_number=30).gross_traction_ratio([0.1, slip])


@pytest.mark.parametrize(
    ('law', 'coefficients', 'key'),
    [
        (Brixius, {'mobility_number': 0.0}, 'mobility_number'),
        (Brixius, {'mobility_number': math.nan}, 'mobility_number'),
        (Burckhardt, {'c1': 0.5, 'c2': 10.0, 'c3': -0.1}, 'c3'),
        (Burckhardt, {'c1': 0.5, 'c2': 10.0, 'c3': 0.6}, 'pushed along'),
        (
            Pacejka,
            {
                'stiffness_factor': 1,
                'shape_factor': 2.1,
                'peak_factor': 1,
                'curvature_factor': 0,
            },
            'shape_factor',
        ),
    ],
)
def test_refuses_curves_that_make_no_sense(law, coefficients, key):
    with pytest.raises(ValidationError, match=key):
        law(**coefficients)


KNOWN = [
    Brixius(mobility_number=23.0),
    Burckhardt(c1=0.7, c2=6.0, c3=0.15, rolling_resistance=0.08),
    Pacejka(
        stiffness_factor=6.0,
        shape_factor=1.3,
        peak_factor=0.65,
        curvature_factor=-0.4,
        rolling_resistance=0.07,
    ),
]


@pytest.mark.parametrize('known', KNOWN)
@pytest.mark.parametrize('with_gross', [False, True])
def test_fit_finds_the_curve_that_made_the_samples(known, with_gross):
    slips = np.linspace(-0.6, 0.9, 31)
    gross = known.gross_traction_ratio(slips) if with_gross else None
    curve, fit = fit_curve(type(known), slips, known.net_traction_ratio(slips), gross)
    assert fit.net_max < 1e-6
    assert curve.model_dump() == pytest.approx(known.model_dump(), rel=1e-3)
    if with_gross:
        assert fit.gross_max < 1e-6
    else:
        assert fit.gross_rms is None
        assert fit.gross_max is None


@pytest.mark.parametrize('law', [Burckhardt, Pacejka, Brixius])
def test_fit_returns_its_errors_and_is_the_least(law):
    # Samples with noise of a known seed: the errors are recomputed here, and no curve near
    # by, each coefficient changed by 1 %, has a smaller sum of squares.
    slips = np.linspace(0.02, 0.9, 40)
    samples = KNOWN[1].net_traction_ratio(slips)
    samples = samples + np.random.default_rng(3).normal(0, 0.02, slips.size)
    curve, fit = fit_curve(law, slips, samples)
    errors = curve.net_traction_ratio(slips) - samples
    assert fit.net_rms == pytest.approx(np.sqrt(np.mean(errors**2)))
    assert fit.net_max == pytest.approx(np.max(np.abs(errors)))
    for name, value in curve.model_dump().items():
        for factor in (0.99, 1.01):
            try:
                other = law(**curve.model_dump() | {name: value * factor})
            except ValidationError:
                continue  # beyond a limit that the fit keeps
            changed = other.net_traction_ratio(slips) - samples
            assert np.sum(changed**2) >= np.sum(errors**2) * (1 - 1e-6)


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ((Brixius, [0.1, 0.2], [0.3]), 'net_traction_ratio must be one number per slip'),
        ((Brixius, [0.1, 0.2], [0.3, math.nan]), 'net_traction_ratio holds what is not'),
        ((Brixius, [0.1, 1.2], [0.3, 0.4]), 'slip must be a share'),
        ((Brixius, [0.1], [0.3], [0.3, 0.4]), 'gross_traction_ratio must be one number'),
        ((Burckhardt, [0.1, 0.2, 0.3], [0.3, 0.4, 0.4]), '4 coefficients: 3 samples'),
    ],
)
def test_fit_names_what_is_wrong(arguments, message):
    with pytest.raises(ValueError, match=message):
        fit_curve(*arguments)


def test_fit_refuses_what_is_no_law():
    with pytest.raises(TypeError, match='Brixius, Burckhardt or Pacejka'):
        fit_curve('pacejka', [0.1], [0.2])
