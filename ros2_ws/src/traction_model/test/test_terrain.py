"""Terrain along a path: from code, from YAML, from CSV, and what is wrong with it."""

import math

import numpy as np
import pytest

from traction_model.definition import DefinitionError
from traction_model.soil.soil import Soil, load_soil
from traction_model.soil.terrain import Terrain, load_terrain, soil_row
from traction_model.vehicle.wheel import Wheel


def test_terrain_packs_soils_in_order():
    terrain = Terrain([load_soil('dry_sand'), load_soil('snow_us')], [15.0])
    assert terrain.starts.tolist() == [-np.inf, 15.0]
    wheel = Wheel(radius=0.5, width=0.4, inertia=20)
    np.testing.assert_array_equal(terrain.packed(wheel)[1], load_soil('snow_us').packed(wheel))
    alone = Terrain(load_soil('dry_sand'))
    assert alone.soils == (load_soil('dry_sand'),)


@pytest.mark.parametrize(
    ('count', 'starts', 'reason'),
    [
        (2, [], '2 soils need 1 starts, got 0'),
        (1, [3.0], '1 soils need 0 starts, got 1'),
        (3, [4.0, 4.0], r'must be finite and increase, got \[4.0, 4.0\] m'),
        (2, [math.nan], r'must be finite and increase, got \[nan\] m'),
        (2, [math.inf], r'must be finite and increase, got \[inf\] m'),
    ],
)
def test_terrain_that_does_not_fit(count, starts, reason):
    soils: list[Soil] = [load_soil('dry_sand')] * count
    with pytest.raises(ValueError, match=reason):
        Terrain(soils, starts)


@pytest.mark.parametrize(
    ('grades', 'reason'),
    [
        ([0.1], '2 soils need as many grades, got 1'),
        (np.array([0.1, 0.1, 0.1]), '2 soils need as many grades, got 3'),
        ([0.1, 0.9], r'grade must be within \+-pi/4 rad, got 0.9'),
        (math.nan, r'grade must be within \+-pi/4 rad, got nan'),
    ],
)
def test_grades_that_do_not_fit(grades, reason):
    with pytest.raises(ValueError, match=reason):
        Terrain([load_soil('dry_sand')] * 2, [5.0], grades)


def test_one_grade_is_that_of_the_whole_path():
    assert Terrain([load_soil('dry_sand')] * 2, [5.0], -0.1).grades.tolist() == [-0.1, -0.1]


def test_soil_row_is_that_of_the_last_start_passed():
    starts = np.array([-np.inf, 0.0, 2.0, 7.5])
    places = [-1e9, -1e-9, 0.0, 1.9, 2.0, 7.4, 7.5, 1e9]
    assert [soil_row(x, starts) for x in places] == [0, 0, 1, 1, 2, 2, 3, 3]


YAML = """
- {soil: dry_sand}
- {start: 12.5, soil: snow_us, grade: 0.05}
- {start: 30, soil: own.yaml:peat}
"""
CSV = """start,soil,grade
,dry_sand,
12.5,snow_us,0.05
30,own.yaml:peat,
"""
PEAT = """
peat: {frictional_modulus: 2e5, cohesive_modulus: 0, sinkage_exponent: 0.8, cohesion: 1000,
  friction_angle_deg: 20, shear_deformation_modulus: 0.05}
"""


@pytest.mark.parametrize(('name', 'text'), [('field.yaml', YAML), ('field.csv', CSV)])
def test_terrain_from_a_file(tmp_path, name, text):
    (tmp_path / 'own.yaml').write_text(PEAT)
    (tmp_path / name).write_text(text)
    terrain = load_terrain(tmp_path / name)
    peat = load_soil(f'{tmp_path}/own.yaml:peat')
    assert terrain.soils == (load_soil('dry_sand'), load_soil('snow_us'), peat)
    assert terrain.starts.tolist() == [-np.inf, 12.5, 30.0]
    assert terrain.grades.tolist() == [0.0, 0.05, 0.0]


def test_terrain_from_a_spreadsheet(tmp_path):
    # Some begin what they export as UTF-8 with U+FEFF.
    (tmp_path / 'field.csv').write_text('\ufeffstart,soil\r\n,dry_sand\r\n5,snow_us\r\n')
    assert load_terrain(tmp_path / 'field.csv').starts.tolist() == [-np.inf, 5.0]


@pytest.mark.parametrize(
    ('name', 'text', 'reason'),
    [
        (
            'a.csv',
            'start,soil\n,dry_sandd\n',
            r"a\.csv: line 2: soil: unknown soil 'dry_sandd'; did",
        ),
        ('a.csv', 'start,soill\n,dry_sand\n', r'a\.csv: line 2: soill: unknown key; did you mean'),
        ('a.csv', 'start,soil\n,dry_sand\nx,snow_us\n', r'a\.csv: line 3: start: .*number.*x'),
        ('a.csv', 'start,soil\n,dry_sand,3\n', r'a\.csv: line 2: more: unknown key'),
        ('a.csv', 'start,soil\n,dry_sand\n,snow_us\n', r'a\.csv: line 3: start: missing'),
        ('a.csv', '', r'a\.csv: no stretch in it'),
        ('a.yaml', 'soil: dry_sand', r'a\.yaml: expected a list, found dict'),
        ('a.yaml', '- dry_sand', r'a\.yaml: entry 1: .*dictionary'),
        ('a.yaml', '- {soil: dry_sand, grade: 1}', r'a\.yaml: entry 1: grade: '),
        ('a.yaml', '- soil: dry_sand\n- soil: snow_us', r'a\.yaml: entry 2: start: missing'),
        ('a.yaml', '[', r'a\.yaml: not valid YAML'),
        (
            'a.yaml',
            '- soil: dry_sand\n- {soil: snow_us, start: 5}\n- {soil: snow_us, start: 4}',
            r'a\.yaml: starts of soils must be finite and increase',
        ),
    ],
)
def test_terrain_file_that_is_wrong(tmp_path, name, text, reason):
    (tmp_path / name).write_text(text)
    with pytest.raises(DefinitionError, match=reason):
        load_terrain(tmp_path / name)


def test_missing_terrain_file(tmp_path):
    with pytest.raises(DefinitionError, match=r'none\.csv: No such file'):
        load_terrain(tmp_path / 'none.csv')


def test_soil_that_differs_across_the_path():
    sand, snow, clay = (load_soil(name) for name in ('dry_sand', 'snow_us', 'heavy_clay_25'))
    terrain = Terrain([sand, (snow, clay)], [5.0])
    assert terrain.n_tracks == 2
    assert Terrain([sand, snow], [5.0]).n_tracks is None
    assert [terrain.soil(row, track) for row in (0, 1) for track in (0, 1)] == [
        sand, sand, snow, clay,
    ]  # fmt: skip
    wheel = Wheel(radius=0.5, width=0.4, inertia=20)
    np.testing.assert_array_equal(terrain.packed(wheel, 0)[1], snow.packed(wheel))
    np.testing.assert_array_equal(terrain.packed(wheel, 1)[1], clay.packed(wheel))


@pytest.mark.parametrize('tracks', [(2, 3), (0,)])
def test_soils_across_the_path_that_do_not_fit(tracks):
    soils = [(load_soil('dry_sand'),) * count for count in tracks]
    with pytest.raises(ValueError, match='soils across the path are given for'):
        Terrain(soils, [5.0][: len(soils) - 1])
