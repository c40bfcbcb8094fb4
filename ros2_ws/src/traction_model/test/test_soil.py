"""Soils: the published presets, and what is wrong with a soil of one's own."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from traction_model.contact.contact import mean_mobilised, mobilised
from traction_model.definition import DefinitionError
from traction_model.soil.soil import (
    HUMP,
    RESIDUAL,
    SHEAR_LAW,
    SHEAR_MODULUS,
    Soil,
    load_soil,
    preset_soils,
    read_soils,
)
from traction_model.vehicle.wheel import Wheel

# Wong, Terramechanics and Off-Road Vehicle Engineering, 2009, as tabulated in the open
# literature: k_phi kN/m^(n+2), k_c kN/m^(n+1), n, c kPa, phi deg, K m.
PUBLISHED = {
    'dry_sand': (1528.43, 0.99, 1.1, 1.04, 28, 0.02),
    'sandy_loam_15': (1515.04, 5.27, 0.7, 1.72, 29, 0.02),
    'sandy_loam_22': (43.12, 2.56, 0.2, 1.38, 38, 0.02),
    'clayey_soil_38': (692.15, 13.19, 0.5, 4.14, 13, 0.02),
    'clayey_soil_55': (1262.53, 16.03, 0.7, 2.07, 10, 0.02),
    'heavy_clay_25': (1555.95, 12.7, 0.13, 68.95, 34, 0.006),
    'heavy_clay_40': (103.27, 1.84, 0.11, 20.69, 6, 0.03),
    'lete_sand': (5301, 102, 0.79, 1.3, 31.1, 0.012),
    'snow_us': (196.72, 4.37, 1.6, 1.03, 19.7, 0.03),
    'snow_sweden': (66.08, 10.55, 1.44, 6.0, 20.7, 0.03),
}


def shear_share(j, soil):
    """Share of the strength that a packed soil mobilises at a shear displacement in m."""
    y = j / soil[SHEAR_MODULUS]
    return mobilised(y, soil[SHEAR_LAW], soil[RESIDUAL], soil[HUMP])


SOIL = """
mine:
  cohesive_modulus: 990
  frictional_modulus: 1528430
  sinkage_exponent: 1.1
  cohesion: 1040
  friction_angle_deg: 28
  shear_deformation_modulus: 0.02
"""


def soil_file(folder, text):
    path = folder / 'soils.yaml'
    path.write_text(text)
    return path


def refusal(folder, text):
    with pytest.raises(DefinitionError) as refused:
        read_soils(soil_file(folder, text))
    return str(refused.value)


@pytest.mark.parametrize('name', PUBLISHED)
def test_preset_is_the_published_soil(name):
    k_phi, k_c, n, c, phi, k = PUBLISHED[name]
    soil = load_soil(name)
    assert soil.frictional_modulus == pytest.approx(1e3 * k_phi)
    assert soil.cohesive_modulus == pytest.approx(1e3 * k_c)
    assert soil.sinkage_exponent == n
    assert soil.cohesion == pytest.approx(1e3 * c)
    assert math.degrees(soil.friction_angle) == pytest.approx(phi)
    assert soil.shear_deformation_modulus == k
    assert soil.damping == 3e4


def test_soil_of_the_paper():
    # Agriculture 2024, 14(3), 499, Table 1; elastic modulus of the Chrono runs.
    soil = load_soil('paper_sand')
    wheel = Wheel(radius=0.5, width=0.4, inertia=20)
    assert soil.packed(wheel) == pytest.approx(
        [0.2e6, 1.1, 0, math.sqrt(1 / 3), 0.01, 3e4, 4e7, 0, 1, 0, 1, *[math.nan] * 6],
        nan_ok=True,
    )


def test_strength_is_mohr_coulombs():
    # Dry sand under 20 kPa: 1040 Pa + 20000 Pa*tan(28 deg) = 1040 + 20000*0.531709 Pa.
    assert load_soil('dry_sand').max_shear_stress(20e3) == pytest.approx(11674.2, abs=0.1)


def test_own_soil_from_a_file(tmp_path):
    path = soil_file(tmp_path, SOIL)
    assert load_soil(f'{path}:mine') == preset_soils()['dry_sand']


def test_source_may_be_noted(tmp_path):
    path = soil_file(tmp_path, SOIL + '  source: measured in spring\n')
    assert load_soil(f'{path}:mine') == preset_soils()['dry_sand']


@pytest.mark.parametrize(
    ('old', 'new', 'reason'),
    [
        ('cohesion:', 'cohesoin:', "cohesoin: unknown key; did you mean 'cohesion'?"),
        ('  cohesion: 1040\n', '', 'cohesion: missing'),
        ('cohesion: 1040', 'cohesion: high', "cohesion: Input should be a valid number, unable to "
         "parse string as a number, got 'high'"),
        ('cohesion: 1040', 'cohesion: .nan', 'cohesion: Input should be a finite number, got nan'),
        ('cohesion: 1040', 'cohesion: -1', 'greater than or equal to 0, got -1'),
        ('modulus: 0.02', 'modulus: 0', 'shear_deformation_modulus: Input should be greater than'),
        ('  friction_angle_deg: 28\n', '', 'friction_angle_deg: missing'),
        ('angle_deg: 28', 'angle: 0.5', 'friction_angle: give friction_angle_deg instead, in deg'),
        ('angle_deg: 28', 'angel_deg: 28',
         "friction_angel_deg: unknown key; did you mean 'friction_angle_deg'?"),
        ('deg: 28', 'deg: 90', 'friction_angle_deg: must be at least 0 and below 90, got 90'),
        ('deg: 28', 'deg: -1', 'friction_angle_deg: must be at least 0 and below 90, got -1'),
        ('deg: 28', 'deg: .nan', 'friction_angle_deg: must be at least 0 and below 90, got nan'),
        ('deg: 28', 'deg: steep', "must be at least 0 and below 90, got 'steep'"),
    ],
)  # fmt: skip
def test_fault_is_named_with_file_soil_and_key(tmp_path, old, new, reason):
    assert old in SOIL
    said = refusal(tmp_path, SOIL.replace(old, new))
    assert said.startswith(f'{tmp_path / "soils.yaml"}: mine: ')
    assert reason in said


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('mine: 3', 'mine: expected a mapping of soil parameters'),
        ('- mine', 'expected a mapping, found list'),
        ('', 'expected a mapping, found NoneType'),
        ('mine: {', 'not valid YAML'),
    ],
)
def test_file_that_holds_no_soils(tmp_path, text, reason):
    assert reason in refusal(tmp_path, text)


def test_file_that_is_not_there(tmp_path):
    with pytest.raises(DefinitionError, match=r'absent\.yaml: No such file'):
        load_soil(f'{tmp_path / "absent.yaml"}:mine')


def test_unknown_soil_names_the_nearest():
    with pytest.raises(
        DefinitionError, match=r"unknown soil 'dry_snad'; did you mean 'dry_sand'\?"
    ):
        load_soil('dry_snad')
    with pytest.raises(DefinitionError, match=r"unknown soil 'xyz'; there are: clayey_soil_38, "):
        load_soil('xyz')


def test_unknown_soil_of_a_file_names_the_file(tmp_path):
    soil_file(tmp_path, SOIL)
    with pytest.raises(DefinitionError, match=r"soils\.yaml: unknown soil 'min'; did you mean 'm"):
        load_soil('soils.yaml:min', tmp_path)


@pytest.mark.parametrize('name', ['mysoils.yaml', 'folder/mysoils.yml'])
def test_file_without_a_soils_name(name):
    with pytest.raises(
        DefinitionError, match=rf"'{name}': say which soil of the file, as in file\.yaml:name"
    ):
        load_soil(name)


WHEEL = Wheel(radius=0.5, width=0.4, inertia=20)
SAND = preset_soils()['dry_sand']


def test_bekkers_pressure_by_hand():
    # k = k_c/b + k_phi = 990/0.4 + 1528430 = 1530905 N/m^3.1; n 1.1.
    assert SAND.packed(WHEEL)[:2] == pytest.approx([1530905, 1.1])


def test_bernsteins_pressure_by_hand():
    # k*sqrt(z), whatever the width: 2e5*sqrt(0.04) = 4e4 Pa.
    soil = Soil(
        pressure_law='bernstein', frictional_modulus=2e5, cohesion=1e3, friction_angle=0.5,
        shear_deformation_modulus=0.02,
    )  # fmt: skip
    modulus, exponent = soil.packed(WHEEL)[:2]
    assert modulus * 0.04**exponent == pytest.approx(4e4)
    assert soil.sinkage_modulus(0.1) == soil.sinkage_modulus(1.0)


def test_reeces_pressure_by_hand():
    # (c*k_c' + gamma*b*k_phi')*(z/b)^n: at z = b 1e3*20 + 15e3*0.4*50 = 3.2e5 Pa, at z = b/2
    # 2^-0.8 = 0.574349 times that.
    soil = Soil(
        pressure_law='reece', cohesive_modulus=20, frictional_modulus=50, sinkage_exponent=0.8,
        unit_weight=15e3, cohesion=1e3, friction_angle=0.5, shear_deformation_modulus=0.02,
    )  # fmt: skip
    modulus, exponent = soil.packed(WHEEL)[:2]
    assert modulus * 0.4**exponent == pytest.approx(3.2e5)
    assert modulus * 0.2**exponent == pytest.approx(3.2e5 * 0.574349, rel=1e-6)


def sheared(law, residual=None):
    """A soil by a shear law, packed, K = 0.02 m."""
    return SAND.model_copy(update={'shear_law': law, 'residual_ratio': residual}).packed(WHEEL)


def test_janosi_and_hanamotos_law():
    soil = sheared('janosi_hanamoto')
    for j in (0.0, 1e-9, 0.01, 0.02, 0.5):
        assert shear_share(j, soil) == pytest.approx(1 - math.exp(-j / 0.02), rel=1e-6)


@pytest.mark.parametrize('residual', [0.1, 0.4, 0.6, 0.9])
def test_wong_and_preston_thomass_law(residual):
    # Their curve: tau/tau_max = K_r*(1 + (1/(K_r*(1 - 1/e)) - 1)*exp(1 - j/K))*(1 - exp(-j/K)).
    soil = sheared('wong_preston_thomas', residual)
    hump = 1 / (residual * (1 - 1 / math.e)) - 1
    for u in (0.0, 0.1, 0.5, 1.0, 3.0):
        expected = residual * (1 + hump * math.exp(1 - u)) * (1 - math.exp(-u))
        assert shear_share(u * 0.02, soil) == pytest.approx(expected, rel=1e-9)
    assert shear_share(0.0, soil) == 0.0
    assert shear_share(0.02, soil) == pytest.approx(1.0)
    assert shear_share(2.0, soil) == pytest.approx(residual)
    # The top lies near K and 1, not quite there: dg/du = 0 at exp(-u) = (h*e - 1)/(2*h*e).
    top = math.log(2 * hump * math.e / (hump * math.e - 1))
    values = [shear_share(u * 0.02, soil) for u in np.linspace(0, 10, 5001)]
    assert max(values) == pytest.approx(shear_share(top * 0.02, soil), rel=1e-6)
    assert 1.0 <= max(values) < 1.08


@pytest.mark.parametrize('residual', [0.05, 0.4, 0.6, 0.95])
def test_kacigin_and_guskovs_law(residual):
    # tau/tau_residual = (1 + f/cosh(j/K))*tanh(j/K), f such that residual over greatest is as
    # given: the greatest value of g is 1.
    soil = sheared('kacigin_guskov', residual)
    # f from g at any one place: here at j = K.
    f = (shear_share(0.02, soil) / residual / math.tanh(1) - 1) * math.cosh(1)
    for u in (0.0, 0.1, 0.5, 2.0, 5.0):
        expected = residual * math.tanh(u) * (1 + f / math.cosh(u))
        assert shear_share(u * 0.02, soil) == pytest.approx(expected, rel=1e-9)
    values = [shear_share(u * 0.02, soil) for u in np.linspace(0, 10, 20001)]
    assert max(values) == pytest.approx(1.0, abs=1e-6)
    assert shear_share(2.0, soil) == pytest.approx(residual)
    assert shear_share(1e6, soil) == pytest.approx(residual)


LAWS = st.one_of(
    st.just(sheared('janosi_hanamoto')),
    st.floats(0.01, 0.99).map(lambda ratio: sheared('wong_preston_thomas', ratio)),
    st.floats(0.01, 0.99).map(lambda ratio: sheared('kacigin_guskov', ratio)),
)


@given(soil=LAWS, y=st.floats(1e-6, 60.0))
def test_mean_of_what_is_mobilised(soil, y):
    expected = quad(
        lambda u: shear_share(u * soil[SHEAR_MODULUS], soil), 0, y, epsrel=1e-10, limit=200
    )[0]
    # Below y = 1e-4 the deficit's series leaves out y^2/6 = 2e-9, which humps multiply.
    assert mean_mobilised(y, soil) == pytest.approx(expected / y, rel=1e-6, abs=5e-8)


@given(soil=LAWS, j=st.floats(0.0, 1e6))
def test_no_shear_law_leaves_its_bounds(soil, j):
    assert 0.0 <= shear_share(j, soil) <= 1.08
    assert 0.0 <= mean_mobilised(j / 0.02, soil) <= 1.08


HUMPED = SOIL + '  shear_law: wong_preston_thomas\n  residual_ratio: 0.6\n'


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        (SOIL + '  residual_ratio: 0.6\n', 'residual_ratio goes with the shear_law wong_preston'),
        (HUMPED.replace('  residual_ratio: 0.6\n', ''), 'residual_ratio goes with the shear_law'),
        (HUMPED.replace('0.6', '1'), 'residual_ratio: Input should be less than 1, got 1'),
        (HUMPED.replace('wong_', 'wonk_'), "shear_law: Input should be 'janosi_hanamoto', 'wong"),
        (SOIL + '  unit_weight: 15000\n', 'unit_weight goes with the pressure_law reece'),
        (SOIL + '  pressure_law: reece\n', 'unit_weight goes with the pressure_law reece'),
        (SOIL + '  pressure_law: bernstein\n', 'bernstein takes frictional_modulus only'),
        (
            SOIL.replace('  sinkage_exponent: 1.1\n', ''),
            'sinkage_exponent is missing: bekker needs it',
        ),
        (SOIL + '  elastic_modulus: 0\n', 'elastic_modulus: Input should be greater than 0'),
        (SOIL + '  shear_memory: 1.5\n', 'shear_memory: Input should be less than or equal to 1'),
        # A curve is one of three: errors are those of the one that was meant.
        (
            SOIL + '  traction_curve: {mobilty_number: 30}\n',
            "traction_curve.mobilty_number: unknown key; did you mean 'mobility_number'?",
        ),
        (
            SOIL + '  traction_curve: {c1: 0.6, c2: 12, c33: 0.1}\n',
            "traction_curve.c33: unknown key; did you mean 'c3'?",
        ),
        (SOIL + '  traction_curve: {c1: 0.6, c2: 12}\n', 'traction_curve.c3: missing'),
        (
            SOIL + '  traction_curve: {c1: 0.6, c2: 12, c3: 5}\n',
            'traction_curve: c3 is 5.0, above',
        ),
        (
            SOIL + '  traction_curve: {mobility_number: -3}\n',
            'traction_curve.mobility_number: Input should be greater than 0, got -3',
        ),
        (SOIL + '  traction_curve: firm\n', 'traction_curve: Input should be a valid dictionary'),
    ],
)
def test_laws_that_do_not_fit_their_parameters(tmp_path, text, reason):
    said = refusal(tmp_path, text)
    assert said.startswith(f'{tmp_path / "soils.yaml"}: mine: ')
    assert reason in said


def test_laws_from_a_file(tmp_path):
    path = soil_file(tmp_path, HUMPED + '  traction_curve: {mobility_number: 30}\n')
    soil = load_soil(f'{path}:mine')
    assert (soil.shear_law, soil.residual_ratio) == ('wong_preston_thomas', 0.6)
    assert soil.traction_curve.mobility_number == 30
