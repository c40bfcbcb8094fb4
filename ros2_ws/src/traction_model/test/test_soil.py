"""Soils: the published presets, and what is wrong with a soil of one's own."""

import math

import pytest

from traction_model.definition import DefinitionError
from traction_model.soil import load_soil, preset_soils, read_soils
from traction_model.wheel import Wheel

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
    # Agriculture 2024, 14(3), 499, Table 1.
    soil = load_soil('paper_sand')
    wheel = Wheel(radius=0.5, width=0.4, inertia=20)
    assert soil.packed(wheel) == pytest.approx(
        [0.2e6, 1.1, 0, math.sqrt(1 / 3), 0.01, 3e4, math.inf, 0, 1, 0, 1, *[math.nan] * 6],
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


@pytest.mark.parametrize('name', ['mysoils.yaml', 'folder/mysoils.yml'])
def test_file_without_a_soils_name(name):
    with pytest.raises(
        DefinitionError, match=rf"'{name}': say which soil of the file, as in file\.yaml:name"
    ):
        load_soil(name)
