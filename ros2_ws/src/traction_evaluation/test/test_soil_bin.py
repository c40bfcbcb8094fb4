"""Single wheel in a soil bin: measured drawbar against prediction and fit."""

import math
from pathlib import Path

import numpy as np
import pytest

from traction_evaluation.verification.soil_bin import (
    SAND_BED_WHEELS,
    Trials,
    compare,
    compare_sand_bed,
    predict,
    read_trials,
)
from traction_model.soil.empirical import rms
from traction_model.soil.soil import load_soil

TABLE = Path(__file__).resolve().parents[5] / 'shared' / 'data' / 'field' / 'single_wheel_sand.csv'
SAND = load_soil('pavlov_sand')
SAND_BED_WHEEL = SAND_BED_WHEELS['smooth']


@pytest.fixture(scope='module')
def sand_bed():
    if not TABLE.exists():
        pytest.skip('the trials on dry sand are not here: they may not be copied into the project')
    return compare_sand_bed(TABLE)


def test_sand_bed_is_fitted_within_a_twentieth_of_the_load(sand_bed):
    tested = [each.errors(each.fitted, each.tested_half) for each in sand_bed.values()]
    unfitted = [each.errors(each.unfitted, each.within) for each in sand_bed.values()]
    assert rms(np.concatenate(tested)) < 0.05
    for of_wheel in tested:
        assert rms(of_wheel) < 0.05
    # The published soil with full strength has far more pull than measured.
    assert rms(np.concatenate(unfitted)) > 5 * rms(np.concatenate(tested))


def test_sand_bed_beats_a_constant(sand_bed):
    # What the mean of the fitted half, the same at every slip, would predict.
    for each in sand_bed.values():
        measured = each.trials.drawbar_ratio
        constant = np.mean(measured[each.fitted_half]) - measured[each.tested_half]
        assert rms(each.errors(each.fitted, each.tested_half)) < 0.6 * rms(constant)


def test_sand_bed_parameters_are_physical(sand_bed):
    for each in sand_bed.values():
        assert 0.0 < each.strength_share < 1.0
        assert 1e-3 < each.shear_deformation_modulus < 0.05
    # Grousers grip the sand that slides along a smooth rim.
    assert sand_bed['grouser'].strength_share > sand_bed['smooth'].strength_share


def test_halves_are_alternate_and_apart(sand_bed):
    for each in sand_bed.values():
        assert not np.any(each.fitted_half & each.tested_half)
        assert np.array_equal(each.fitted_half | each.tested_half, each.within)
        assert abs(int(each.fitted_half.sum()) - int(each.tested_half.sum())) <= 1
        # Repeats of one slip fall into both halves.
        for nominal in (0.0, 0.5, 0.75, 0.9):
            repeats = np.abs(each.trials.slip - nominal) < 0.02
            assert np.any(each.fitted_half & repeats)
            assert np.any(each.tested_half & repeats)


def made_trials(soil):
    """Trials that the model itself makes on a soil, wheel of the sand bed, 20 to 30 N."""
    slip = np.linspace(-0.3, 0.9, 25)
    load = np.linspace(20.0, 30.0, 25)
    nothing = np.zeros(25)
    made = predict(Trials(slip, load, nothing, nothing), soil, SAND_BED_WHEEL)
    return Trials(slip, load, made.drawbar_ratio * load, made.sinkage)


def test_fit_finds_the_parameters_that_made_the_trials():
    # The sand with a third of its strength at the rim and K of 8 mm.
    third = math.atan(math.tan(SAND.friction_angle) / 3)
    weaker = SAND.model_copy(
        update={
            'cohesion': SAND.cohesion / 3,
            'friction_angle': third,
            'shear_deformation_modulus': 0.008,
        }
    )
    found = compare(made_trials(weaker), SAND, SAND_BED_WHEEL)
    assert found.strength_share == pytest.approx(1 / 3, rel=1e-4)
    assert found.shear_deformation_modulus == pytest.approx(0.008, rel=1e-4)
    assert rms(found.errors(found.fitted, found.tested_half)) < 1e-5
    # Sinkage follows from load and pressure alone.
    assert found.unfitted.sinkage == pytest.approx(found.fitted.sinkage)


def test_halves_do_not_look_at_the_measured_drawbar():
    trials = made_trials(SAND)
    other = trials._replace(drawbar=trials.drawbar[::-1])
    one = compare(trials, SAND, SAND_BED_WHEEL)
    two = compare(other, SAND, SAND_BED_WHEEL)
    assert np.array_equal(one.fitted_half, two.fitted_half)


def test_too_few_trials():
    trials = Trials(*(column[:3] for column in made_trials(SAND)))
    with pytest.raises(ValueError, match=r'^0 trials within 0 to 0\.9 slip'):
        compare(trials, SAND, SAND_BED_WHEEL)


HEADER = 'wheel,slip,drawbar,vertical_load,sinkage\n'


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('wheel,slip,drawbar,sinkage\n', 'column vertical_load is missing'),
        (HEADER + 'smooth,0.1,1,25,0.01\nsmooth,much,1,25,0.01\n', 'line 3: could not convert'),
        (HEADER + 'smooth,1.1,1,25,0.01\n', 'line 2: slip must be a share'),
        (HEADER + 'smooth,0.1,nan,25,0.01\n', 'line 2: numbers must be finite'),
        (HEADER + 'smooth,0.1,1,0,0.01\n', 'vertical_load above 0'),
        (HEADER + 'smooth,0.1,1\n', 'line 2'),
    ],
)
def test_a_faulty_table_is_named(tmp_path, text, message):
    table = tmp_path / 'trials.csv'
    table.write_text(text)
    with pytest.raises(ValueError, match=message):
        read_trials(table)


def test_missing_wheel_is_named(tmp_path):
    table = tmp_path / 'trials.csv'
    table.write_text(HEADER + 'smooth,0.1,1,25,0.01\n')
    with pytest.raises(ValueError, match="no trials of the wheel 'grouser'"):
        compare_sand_bed(table)
