"""Sweeps: definitions, draws, and figures on a motion whose figures are known."""

import math
import pickle

import numpy as np
import pytest
import yaml

from traction_model import Soil, Trajectory, load_soil, load_vehicle
from traction_model.definition import DefinitionError
from traction_model.simulation.sweep import (
    FIGURES,
    Draft,
    SimulatedDrive,
    TorqueProfile,
    figures,
    quantities,
    read_sweep,
    simulate_draws,
)


def content(**changes):
    """A short sweep of the single wheel, changed."""
    return {
        'vehicle': 'single_wheel_rig',
        'soil': 'sandy_loam_15',
        'drawbar': {'pull': 500},
        'torque': {'constant': 700},
        'duration': 1.0,
        'settle': 0.5,
        'initial_speed': 1.0,
        'draws': 8,
        'vary': {'soil.cohesion': {'relative': 0.5}},
    } | changes


@pytest.fixture
def define(tmp_path):
    """Write a definition: `define(draws=4)` gives its path."""

    def write(**changes):
        path = tmp_path / 'sweep.yaml'
        path.write_text(yaml.safe_dump(content(**changes)))
        return path

    return write


@pytest.mark.parametrize(
    ('changes', 'message'),
    [
        ({'vehicel': 'x'}, "vehicel: unknown key; did you mean 'vehicle'"),
        ({'vehicle': 'single_wheel_rg'}, "vehicle: unknown vehicle .* mean 'single_wheel_rig'"),
        ({'soil': 'sandy_loam_16'}, "soil: unknown soil .* mean 'sandy_loam_15'"),
        ({'soil': []}, 'soil: Value should have at least 1 item'),
        ({'soil': ['dry_sand', 'lete_sand']}, 'soil_starts: 2 soils need 1 starts, got 0'),
        ({'torque': {'constant': [1, 2]}}, 'torque.constant: expected one .* the 1 wheels, got 2'),
        ({'torque': {'ramp': {'to': 1, 'ovr': 1}}}, "torque.ramp.ovr: unknown key; .* 'over'"),
        ({'torque': {}}, 'torque: give exactly one of constant, ramp, steps'),
        ({'torque': {'steps': [{'at': 1, 'torque': 0}]}}, 'steps: times must start at 0'),
        ({'draws': 0}, 'draws: Input should be greater than or equal to 1, got 0'),
        ({'duration': float('nan')}, 'duration: Input should be a finite number'),
        ({'settle': 1.0}, 'settle: must be below duration, 1 s, got 1 s'),
        ({'dt': 0.1}, 'dt: Input should be less than or equal to 0.02'),
        ({'sampling': 'sobol', 'draws': 300}, 'draws: sobol .* such as 256 or 512, got 300'),
        ({'sampling': 'halton'}, "sampling: Input should be 'random', 'latin_hypercube' or"),
        ({'grade_deg': 50}, 'grade_deg: Input should be less than or equal to 45'),
        ({'vary': {}}, 'vary: Dictionary should have at least 1 item'),
        ({'vary': {'soil': {'relative': 1}}}, 'vary.soil'),
        ({'vary': {'cohesion': {'relative': 1}}}, 'no such quantity'),
        ({'vary': {'soil.cohesoin': {'relative': 1}}}, r"no such quantity.*mean 'soil\.cohesion'"),
        ({'vary': {'soil.friction_angle': {'relative': 0.1}}}, "as 'soil.friction_angle_deg'"),
        ({'vary': {'soil.unit_weight': {'relative': 0.1}}}, 'the soil has no such number'),
        ({'vary': {'torque': 0.2}}, r'vary\.torque: expected a distribution such as'),
        ({'vary': {'torque': {'relativ': 1}}}, r'vary\.torque: relativ: unknown key; .*relative'),
        (
            {'vary': {'soil.cohesion': {'uniform': [-1, 1]}}},
            'from -1 to 1 are not within 0 to inf',
        ),
        ({'vary': {'soil.friction_angle_deg': {'uniform': [0, 91]}}}, 'not within 0 to 90'),
        ({'vary': {'soil': {'choice': ['dry_snd']}}}, r"vary\.soil\.choice: .* mean 'dry_sand'"),
        ({'vary': {'soil': {'relative': 0.1}}}, r'vary\.soil: a whole soil needs choice'),
    ],
)
def test_a_definition_that_cannot_be_used_names_file_and_key(define, changes, message):
    path = define(**changes)
    with pytest.raises(DefinitionError, match=message) as refusal:
        read_sweep(path)
    assert str(refusal.value).startswith(f'{path}: ')


def test_of_several_soils_and_axles_one_has_to_be_named(define):
    changes = {'vehicle': 'tractor_4wd', 'soil': ['dry_sand', 'lete_sand'], 'soil_starts': [5]}
    path = define(**changes, vary={'soil.cohesion': {'relative': 0.1}})
    with pytest.raises(DefinitionError, match=r'one of soil\.0\.cohesion, soil\.1\.cohesion'):
        read_sweep(path)
    path = define(
        **changes,
        vary={'soil.1.cohesion': {'choice': [7]}, 'vehicle.axles.0.wheel.radius': {'choice': [1]}},
    )
    sweep = read_sweep(path)
    scenario = sweep.scenario(sweep.draws()[0])
    assert [soil.cohesion for soil in scenario.soil] == [load_soil('dry_sand').cohesion, 7.0]
    assert [wheel.radius for wheel in scenario.vehicle.wheels] == [1.0, 1.0, 0.85, 0.85]


def test_vehicle_and_soil_files_lie_beside_the_definition(define, tmp_path, monkeypatch):
    vehicle = load_vehicle('single_wheel_rig').model_dump(mode='json') | {'chassis_mass': 321.0}
    (tmp_path / 'mine.yaml').write_text(yaml.safe_dump(vehicle))
    soil = load_soil('dry_sand').model_dump() | {'cohesion': 9.0, 'friction_angle_deg': 30}
    del soil['friction_angle']
    (tmp_path / 'soils.yaml').write_text(yaml.safe_dump({'own': soil}))
    path = define(vehicle='mine.yaml', soil='soils.yaml:own')
    (tmp_path / 'elsewhere').mkdir()
    monkeypatch.chdir(tmp_path / 'elsewhere')
    nominal = read_sweep(path).nominal
    assert nominal.vehicle.chassis_mass == 321.0
    assert nominal.soil[0].cohesion == 9.0


# All optional numbers of a soil given.
HUMPED = {
    'pressure_law': 'reece',
    'cohesive_modulus': 40.0,
    'frictional_modulus': 50.0,
    'unit_weight': 16e3,
    'shear_law': 'wong_preston_thomas',
    'residual_ratio': 0.7,
    'elastic_modulus': 4e7,
}


def known_of(vehicle, soil):
    nominal = SimulatedDrive(
        vehicle=load_vehicle(vehicle),
        soil=(soil,),
        drawbar=Draft(),
        grade_deg=0.0,
        initial_speed=0.0,
    )
    return quantities(nominal, ['dry_sand'])


def test_every_quantity_has_a_unit():
    soil = load_soil('dry_sand')
    humped = Soil.model_validate(soil.model_dump() | HUMPED)
    numbers = {name for name, value in humped if isinstance(value, float)}
    assert numbers == {
        name for name, field in Soil.model_fields.items() if 'float' in str(field.annotation)
    }
    for vehicle in ('single_wheel_rig', 'tractor_4wd'):
        for known in (known_of(vehicle, soil), known_of(vehicle, humped)):
            assert [name for name, q in known.items() if q.unit == '?'] == []
            assert [name for name, q in known.items() if not q.unit] == ['soil']


def test_units_of_moduli_follow_the_pressure_law():
    soil = load_soil('dry_sand')
    assert known_of('tractor_4wd', soil)['soil.frictional_modulus'].unit == 'N/m^(n+2)'
    humped = Soil.model_validate(soil.model_dump() | HUMPED)
    assert known_of('tractor_4wd', humped)['soil.frictional_modulus'].unit == '1'


def test_relative_draws_lie_within_and_have_the_right_mean(define):
    draws = read_sweep(define(draws=4000)).draws()
    values = np.array([draw.values['soil.cohesion'] for draw in draws])
    nominal = load_soil('sandy_loam_15').cohesion
    assert values.min() >= 0.5 * nominal
    assert values.max() <= 1.5 * nominal
    # A uniform distribution's deviation is its width over sqrt(12); that of the mean of 4000
    # draws is sqrt(4000) times less. Four of those are exceeded once in 16,000 seeds.
    deviation = nominal / math.sqrt(12.0)
    assert abs(values.mean() - nominal) < 4 * deviation / math.sqrt(4000)
    assert values.std() == pytest.approx(deviation, rel=0.05)


@pytest.mark.parametrize('sampling', ['latin_hypercube', 'sobol'])
def test_stratified_samplings_put_one_draw_into_each_stratum(define, sampling):
    sweep = read_sweep(
        define(
            sampling=sampling,
            draws=64,
            vary={'torque': {'uniform': [0, 64]}, 'initial_speed': {'uniform': [0, 64]}},
        )
    )
    for name in ('torque', 'initial_speed'):
        strata = sorted(int(draw.values[name]) for draw in sweep.draws())
        assert strata == list(range(64))


def test_draws_follow_from_the_seed_and_more_of_them_keep_the_first(define):
    path = define()
    draws = read_sweep(path).draws()
    assert draws == read_sweep(path).draws()
    assert draws == pickle.loads(pickle.dumps(read_sweep(path))).draws()
    assert draws == read_sweep(path, draws=100).draws()[:8]
    assert draws != read_sweep(path, seed=2).draws()
    assert [draw.number for draw in draws] == list(range(8))


def test_what_is_drawn_is_what_is_simulated(define):
    vary = {
        'soil.friction_angle_deg': {'choice': [30]},
        'vehicle.chassis_mass': {'choice': [400]},
        'drawbar.pull': {'choice': [123]},
        'grade_deg': {'choice': [5]},
        'torque': {'choice': [1.5]},
    }
    sweep = read_sweep(define(vary=vary))
    scenario = sweep.scenario(sweep.draws()[0])
    assert scenario.soil[0].friction_angle == pytest.approx(math.pi / 6)
    assert scenario.vehicle.chassis_mass == 400.0
    assert scenario.drawbar.pull == 123.0
    assert scenario.grade_deg == 5.0
    assert scenario.torque == 1.5
    assert scenario.soil[0].cohesion == load_soil('sandy_loam_15').cohesion


def test_a_soil_that_is_drawn_is_what_its_numbers_are_relative_to(define):
    # The order in the file does not matter.
    vary = {
        'soil.cohesion': {'relative': 1e-9},
        'soil': {'choice': ['dry_sand', 'heavy_clay_25']},
    }
    sweep = read_sweep(define(vary=vary))
    names = set()
    for draw in sweep.draws():
        names.add(draw.values['soil'])
        soil = load_soil(draw.values['soil'])
        assert draw.values['soil.cohesion'] == pytest.approx(soil.cohesion)
        drawn = sweep.scenario(draw).soil[0]
        assert drawn.frictional_modulus == soil.frictional_modulus
        assert drawn.cohesion == draw.values['soil.cohesion']
    assert names == {'dry_sand', 'heavy_clay_25'}


def test_torque_profiles():
    t = np.array([0.0, 0.5, 1.0, 2.0])
    constant = TorqueProfile(constant=[1, 2])
    assert constant.samples(t, 2).tolist() == [[1, 2]] * 4
    ramp = TorqueProfile(ramp={'start': [2, 0], 'to': [4, 100], 'over': 1})
    assert ramp.samples(t, 2).tolist() == [[2, 0], [3, 50], [4, 100], [4, 100]]
    steps = TorqueProfile(steps=[{'at': 0, 'torque': 1}, {'at': 1, 'torque': [3, 4]}])
    assert steps.samples(t, 2).tolist() == [[1, 1], [1, 1], [3, 4], [3, 4]]


def motion(v, omega, slip):
    """Ten seconds of one wheel of radius 0.5 m; sinks 0.2 m at first, 0.05 m from 2 s on."""
    t = np.linspace(0.0, 10.0, 1001)
    column = np.ones((len(t), 1))
    return Trajectory(
        t=t,
        v=np.full(len(t), v),
        x=v * t,
        omega=omega * column,
        slip=slip * column,
        sinkage=np.where(t < 2.0, 0.2, 0.05)[:, None],
        load=4905.0 * column,
        thrust=column,
        motion_resistance=column,
        soil_moment=column,
    )


@pytest.fixture
def scenario():
    return SimulatedDrive(
        vehicle=load_vehicle('single_wheel_rig'),
        soil=(load_soil('dry_sand'),),
        drawbar=Draft(pull=500.0, pull_per_speed=100.0),
        grade_deg=0.0,
        initial_speed=0.0,
    )


def test_figures_of_a_steady_drive(scenario):
    # 1 m/s at 2.5 rad/s, radius 0.5 m: slip 0.2. Draft 500 N + 100 N·s/m · 1 m/s = 600 N.
    # From 2 s to 10 s: 600 N · 8 m = 4800 J out, 400 N·m · 2.5 rad/s · 8 s = 8000 J in.
    row = figures(motion(1.0, 2.5, 0.2), np.full((1001, 1), 400.0), scenario, 2.0)
    assert row == {
        'slip_mean': pytest.approx(0.2),
        'slip_p95': pytest.approx(0.2),
        'slip_max': pytest.approx(0.2),
        'final_speed': 1.0,
        'distance': pytest.approx(10.0),
        'sinkage_max': 0.05,
        'drawbar_work': pytest.approx(4800.0),
        'energy_in': pytest.approx(8000.0),
        'tractive_efficiency': pytest.approx(0.6),
        'immobilised': False,
    }
    assert list(row) == list(FIGURES)


@pytest.mark.parametrize(
    ('v', 'omega', 'immobilised'),
    [(0.05, 2.0, True), (-0.3, 2.0, True), (0.05, 0.5, False), (0.2, 2.0, False)],
)
def test_immobilised_is_a_vehicle_that_stands_while_wheels_turn(scenario, v, omega, immobilised):
    # Rim speed 1.0 or 0.25 m/s.
    row = figures(motion(v, omega, 0.9), np.full((1001, 1), 100.0), scenario, 2.0)
    assert row['immobilised'] is immobilised


def test_figures_that_are_not_defined_are_none(scenario):
    row = figures(motion(0.0, 0.0, 0.0), np.zeros((1001, 1)), scenario, 2.0)
    assert row['slip_mean'] is row['slip_p95'] is row['slip_max'] is None
    assert row['tractive_efficiency'] is None


def test_a_motion_that_is_not_finite_is_no_result(scenario):
    with pytest.raises(ArithmeticError, match='not finite'):
        figures(motion(math.nan, 2.0, 0.2), np.zeros((1001, 1)), scenario, 2.0)


def test_energy_that_goes_in_is_at_least_what_comes_out(define):
    sweep = read_sweep(define(drawbar={'pull': 300, 'pull_per_speed': 100}))
    rows = simulate_draws(sweep, sweep.draws())
    assert [row['error'] for row in rows] == [''] * 8
    assert all(0.0 < row['tractive_efficiency'] < 1.0 for row in rows)
    # Draft is 300 N + 100 N·s/m · v, and speed stays between 1 m/s and the final one.
    for row in rows:
        speeds = sorted([1.0, row['final_speed']])
        force = [300.0 + 100.0 * v for v in speeds]
        covered = row['distance'] - 0.5 * np.array(speeds[::-1])
        assert force[0] * covered[0] <= row['drawbar_work'] <= force[1] * covered[1]


def test_a_draw_that_fails_is_a_row_that_says_why(define):
    vary = {'vehicle.chassis_cg_x': {'choice': [0.9, -2.0]}}
    sweep = read_sweep(define(vehicle='tractor_4wd', vary=vary, sampling='sobol'))
    rows = simulate_draws(sweep, sweep.draws())
    for row in rows:
        # Behind the rear axle it lifts the front wheels.
        lifted = row['vehicle.chassis_cg_x'] < 0
        assert ('the centre of gravity lifts a wheel' in row['error']) == lifted
        assert (row['final_speed'] is None) == lifted
    assert sum(row['error'] != '' for row in rows) == 4


def test_a_fault_of_the_program_is_a_row_that_names_it(define, monkeypatch):
    def fail(*args, **kwargs):
        raise ZeroDivisionError('x')

    monkeypatch.setattr('traction_model.simulation.sweep.simulate', fail)
    sweep = read_sweep(define())
    [row] = simulate_draws(sweep, sweep.draws()[:1])
    assert row['error'] == 'ZeroDivisionError: x'
    assert row['slip_mean'] is None
