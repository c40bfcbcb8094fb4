"""Motion against an independent solver, Chrono, and hand calculation."""

import json
import math
import os
import subprocess
import sys

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from traction_model.contact.contact import (
    EVERYWHERE,
    FREE,
    UNTOUCHED,
    Form,
    contact,
    equilibrium_sinkage,
    forces_at,
)
from traction_model.simulation.drawbar import Drawbar, drawbar_force
from traction_model.simulation.plant import Plant
from traction_model.simulation.simulate import simulate
from traction_model.simulation.vehicle_dynamics import initial_state
from traction_model.soil.empirical import Burckhardt
from traction_model.soil.soil import load_soil
from traction_model.soil.terrain import Terrain
from traction_model.vehicle.vehicle import load_vehicle

RIG = load_vehicle('single_wheel_rig')
TRACTOR = load_vehicle('tractor_4wd')
# With a curve for the empirical form.
CURVE = Burckhardt(c1=0.6, c2=12, c3=0.1, rolling_resistance=0.05)
SAND = load_soil('paper_sand').model_copy(update={'traction_curve': CURVE})
LOAM = load_soil('sandy_loam_chrono').model_copy(update={'traction_curve': CURVE})


def constant(torque, seconds, dt=0.005):
    """Samples of a constant torque per wheel."""
    return np.tile(np.asarray(torque, dtype=float), (round(seconds / dt) + 1, 1))


def tractor_motion(t, y, torque, soil, drawbar):
    """The tractor's equations of motion written out for two axles, from `contact` alone.

    y: v, four wheel speeds, four sinkages, four sinkage rates. Loads from the balance of
    moments about the rear axle's contact: front axle * wheelbase = m*g*x_cg - h_cg*m*v'
    - 0.5 m*drawbar - sum of (T - r*(F - R)); the last is what the wheels' pressure ahead of
    their centres makes up for.
    """
    v, omega, z, z_rate = y[0], y[1:5], y[5:9], y[9:13]
    wheelbase, hitch, cg_x, cg_height, mass = 2.4, 0.5, 3816 / 4440, 4266 / 4440, 4440.0
    radii = np.array([0.65, 0.65, 0.85, 0.85])
    widths = [0.4, 0.4, 0.5, 0.5]
    inertias = np.array([15.0, 15.0, 60.0, 60.0])
    carried = np.array([7798.95, 7798.95, 13979.25, 13979.25]) / 9.81
    forces = np.array(
        [
            contact(
                2,
                v,
                omega[j],
                z[j],
                z_rate[j],
                soil.packed(TRACTOR.wheels[j]),
                radii[j],
                widths[j],
            )
            for j in range(4)
        ]
    )
    upward, thrust, resistance, moment = forces.T
    net = thrust - resistance
    pull = min(1.0, max(-1.0, v / 0.05)) * min(1.0, t / drawbar.ramp)
    pull *= drawbar.pull + drawbar.pull_per_speed * abs(v)
    acceleration = (net.sum() - pull) / mass
    weight = mass * 9.81
    lift = weight * cg_x - cg_height * mass * acceleration - hitch * pull
    lift -= (torque - radii * net).sum()
    front = lift / wheelbase
    load = np.array([front / 2, front / 2, (weight - front) / 2, (weight - front) / 2])
    return np.concatenate(
        [[acceleration], (torque - moment) / inertias, z_rate, (load - upward) / carried]
    )


def test_tractor_against_independent_solver():
    torque = np.array([1500.0, 1500.0, 5000.0, 5000.0])
    drawbar = Drawbar(6000, 1500, 2.0)
    ours = simulate(TRACTOR, LOAM, constant(torque, 4.0), 0.005, drawbar=drawbar, multipass=False)
    rest = initial_state(TRACTOR, LOAM)
    start = np.concatenate([[0.0], rest[2:]])
    theirs = solve_ivp(
        tractor_motion, (0, 4), start, method='RK45', rtol=1e-8, atol=1e-10,
        t_eval=ours.t[::10], args=(torque, LOAM, drawbar),
    )  # fmt: skip
    assert theirs.success
    assert ours.v[::10] == pytest.approx(theirs.y[0], abs=1e-3 * theirs.y[0].max())
    for j in range(4):
        assert ours.omega[::10, j] == pytest.approx(
            theirs.y[1 + j], abs=1e-3 * theirs.y[1 + j].max()
        )
        assert ours.sinkage[::10, j] == pytest.approx(theirs.y[5 + j], abs=1e-4)


@pytest.mark.parametrize('form', list(Form))
def test_wheel_against_independent_solver(form):
    # Torque varies linearly between samples, for both.
    t = np.arange(0, 5.0025, 0.005)
    torque = 1200 + 400 * np.sin(3 * t)

    def motion(time, y):
        v, omega, z, z_rate = y
        load, thrust, resistance, moment = contact(
            int(form), v, omega, z, z_rate, SAND.packed(RIG.wheels[0]), 0.5, 0.4
        )
        fade = max(-1.0, min(1.0, v / 0.05))
        pull = fade * min(1.0, time / 2.0) * (600 + 300 * abs(v))
        return [
            (thrust - resistance - pull) / 500,
            (np.interp(time, t, torque) - moment) / 20,
            z_rate,
            9.81 - load / 500,
        ]

    z0 = equilibrium_sinkage(int(form), 0.0, 0.0, 4905.0, SAND.packed(RIG.wheels[0]), 0.5, 0.4)
    theirs = solve_ivp(
        motion, (0, 5), [0, 0, z0, 0], method='RK45', rtol=1e-8, atol=1e-10, max_step=0.005,
        t_eval=t[::10],
    )  # fmt: skip
    ours = simulate(RIG, SAND, torque[:, None], 0.005, form=form, drawbar=Drawbar(600, 300, 2.0))
    assert ours.v[::10] == pytest.approx(theirs.y[0], abs=1e-3 * np.abs(theirs.y[0]).max())
    assert ours.omega[::10, 0] == pytest.approx(theirs.y[1], abs=1e-3 * np.abs(theirs.y[1]).max())
    assert ours.sinkage[::10, 0] == pytest.approx(theirs.y[2], abs=1e-4)


SHORT_RUN = """
import json
import numpy as np
from traction_model import Burckhardt, Drawbar, Form, load_soil, load_vehicle, simulate
vehicle, soil = load_vehicle('tractor_4wd'), load_soil('sandy_loam_chrono')
soil = soil.model_copy(update={'traction_curve': Burckhardt(c1=0.6, c2=12, c3=0.1)})
torque = np.tile([1500.0, 1500.0, 5000.0, 5000.0], (21, 1))
runs = [
    simulate(vehicle, soil, torque, 0.005, form=form, sinkage=sinkage, v0=1.0,
             drawbar=Drawbar(6000, 1500, 0.05))
    for form in Form for sinkage in ('dynamic', 'equilibrium')
]
print(json.dumps([[run.v.tolist(), run.omega.tolist(), run.load.tolist()] for run in runs]))
"""


def test_kernels_give_the_same_as_plain_python():
    results = []
    for disabled in ('0', '1'):
        done = subprocess.run(
            [sys.executable, '-c', SHORT_RUN],
            env={**os.environ, 'NUMBA_DISABLE_JIT': disabled},
            capture_output=True,
            text=True,
            check=True,
        )
        results.append(json.loads(done.stdout))
    for compiled, plain in zip(*results, strict=True):
        for one, other in zip(compiled, plain, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-9)


def test_given_sinkage_carries_the_weight():
    # Sinkage grows by 0.02 m/s and 0.4 m/s^2: the soil carries m*(g - z'') = 500*9.41 N, and
    # all that normal stress does in the arc grows in proportion.
    t = 0.005 * np.arange(21.0)
    z = 0.1 + 0.02 * t + 0.2 * t**2
    run = simulate(
        RIG, SAND, np.full((21, 1), 100.0), 0.005, sinkage=z[:, None], v0=1.0, omega0=[2.5]
    )
    free = contact(2, 1.0, 2.5, 0.1, 0.02, SAND.packed(RIG.wheels[0]), 0.5, 0.4)
    scale = 500 * (9.81 - 0.4) / free[0]
    assert run.thrust[0, 0] == pytest.approx(scale * free[1], rel=1e-6)
    assert run.motion_resistance[0, 0] == pytest.approx(scale * free[2], rel=1e-6)
    assert run.soil_moment[0, 0] == pytest.approx(scale * free[3], rel=1e-6)


@pytest.mark.parametrize('sinkage', ['dynamic', 'equilibrium'])
def test_plant_steps_as_simulate_does(sinkage):
    torque = [1500.0, 1500.0, 5000.0, 5000.0]
    drawbar = Drawbar(6000, 1500, 0.0)
    run = simulate(
        TRACTOR, LOAM, constant(torque, 0.5, 1e-3), 1e-3, sinkage=sinkage, drawbar=drawbar
    )
    plant = Plant(TRACTOR, LOAM, sinkage=sinkage, drawbar=drawbar)
    for _ in range(50):
        plant.step(torque, 0.01)
    assert plant.t == pytest.approx(0.5)
    assert plant.v == pytest.approx(run.v[-1], rel=1e-6)
    assert plant.omega == pytest.approx(run.omega[-1], rel=1e-6)
    assert plant.x == pytest.approx(run.x[-1], rel=1e-6)
    assert plant.slip == pytest.approx(run.slip[-1], abs=1e-6)


def test_plant_starts_rolling_as_simulate_does():
    run = simulate(RIG, SAND, constant([300.0], 0.1, 1e-3), 1e-3, v0=2.0)
    plant = Plant(RIG, SAND, v0=2.0)
    assert plant.slip == [0.0]
    plant.step([300.0], 0.1)
    assert plant.v == pytest.approx(run.v[-1], rel=1e-9)
    assert plant.omega == pytest.approx(run.omega[-1], rel=1e-9)


def test_draft_that_changes_on_the_way_by_hand():
    # All else the same at the same instant: m*v' differs by the pull, but for what load it moves.
    speeds = []
    for pull in (0.0, 8880.0):
        plant = Plant(TRACTOR, LOAM, v0=2.0)
        plant.step([1000.0] * 4, 0.1)
        before = plant.v
        plant.drawbar = Drawbar(pull)
        assert plant.drawbar.pull == pull
        plant.step([1000.0] * 4, 1e-3)
        speeds.append((plant.v - before) / 1e-3)
    assert speeds[0] - speeds[1] == pytest.approx(8880.0 / 4440.0, rel=0.02)


def test_terrain_laid_ahead_on_the_way_is_as_if_it_had_been_there():
    soft = load_soil('soft_patch_chrono')
    terrain = Terrain([LOAM, soft], [3.0], [0.0, 0.05])
    laid, there = Plant(TRACTOR, LOAM, v0=2.0), Plant(TRACTOR, terrain, v0=2.0)
    laid.step([1500.0] * 4, 0.2)
    # The front wheels' contact has not reached 3.0 m yet.
    assert laid.x + 2.4 + 0.65 * math.sin(math.acos(1 - laid.sinkage[0] / 0.65)) < 3.0
    laid.terrain = terrain
    laid.step([1500.0] * 4, 1.5)
    there.step([1500.0] * 4, 0.2)
    there.step([1500.0] * 4, 1.5)
    assert there.x > 3.0
    np.testing.assert_array_equal(laid.state, there.state)


def test_soil_under_the_left_wheels_alone():
    # In the same state every wheel has the forces that it has where all is its soil.
    soft = load_soil('soft_patch_chrono')
    split, left, right = (
        Plant(TRACTOR, Terrain(soil), v0=2.0) for soil in ([(soft, LOAM)], soft, LOAM)
    )
    # But for the load: load transfer is the vehicle's.
    for name in ('thrust', 'motion_resistance', 'soil_moment', 'sinkage', 'upward_force'):
        forces = getattr(split, name)
        assert forces[[0, 2]] == pytest.approx(getattr(left, name)[[0, 2]], rel=1e-9)
        assert forces[[1, 3]] == pytest.approx(getattr(right, name)[[1, 3]], rel=1e-9)
    assert split.max_shear_stress[0] < 0.8 * split.max_shear_stress[1]
    with pytest.raises(ValueError, match='soils are given for 2 tracks, the vehicle runs in 1'):
        Plant(RIG, Terrain([(soft, LOAM)]))


def test_shaft_torque_lags_behind_the_command():
    # First order: after one time constant 1 - exp(-1) of the step.
    plant = Plant(RIG, SAND, torque_time_constant=0.1)
    plant.step([500.0], 0.1)
    assert plant.shaft_torque == pytest.approx([500 * (1 - math.exp(-1))])


def test_engine_power_limits_all_torques_alike():
    plant = Plant(TRACTOR, LOAM, max_power=10e3, drawbar=Drawbar(6000, 1500))
    torque = np.array([1500.0, 1500.0, 5000.0, 5000.0])
    for _ in range(200):
        plant.step(torque, 0.01)
    # Each step goes by the wheel speeds it started from, 1 ms ago.
    assert plant.shaft_torque @ plant.omega == pytest.approx(10e3, rel=1e-3)
    assert plant.shaft_torque / torque == pytest.approx([plant.shaft_torque[0] / 1500] * 4)
    assert plant.shaft_torque[0] < 1500


def test_drawbar_by_hand():
    draft = (6000.0, 1500.0, 2.0)
    # Half of the ramp: (6000 + 1500*2)/2; all of it; backward motion is resisted, too;
    # at a fifth of 0.05 m/s, a fifth.
    assert drawbar_force(1.0, 2.0, *draft) == pytest.approx(4500)
    assert drawbar_force(5.0, 2.0, *draft) == pytest.approx(9000)
    assert drawbar_force(5.0, -2.0, *draft) == pytest.approx(-9000)
    assert drawbar_force(5.0, 0.01, *draft) == pytest.approx((6000 + 15) / 5)
    assert drawbar_force(5.0, 0.0, *draft) == 0.0


def resistance_of(plant):
    """External force on a vehicle without the soil, N."""
    soil = plant.gross_traction.sum() - plant.net_traction.sum()
    return plant.external_resistance - soil


def test_grade_by_hand():
    # 4440 kg*9.81*sin(0.1) = 43556.4*0.0998334 N = 4348.38 N hold it back, 9.81*sin(0.1) m/s^2.
    plant = Plant(TRACTOR, Terrain(LOAM, grades=0.1))
    assert resistance_of(plant) == pytest.approx(4348.38, abs=0.1)
    dt = 1e-5
    for grade in (0.0, 0.1, -0.2):
        run = simulate(
            TRACTOR, Terrain(LOAM, grades=grade), constant([0] * 4, 2 * dt, dt), dt, v0=2.0,
            sinkage='equilibrium',
        )  # fmt: skip
        net = (run.thrust - run.motion_resistance)[0].sum()
        acceleration = (run.v[1] - run.v[0]) / dt
        assert acceleration == pytest.approx(net / 4440 - 9.81 * math.sin(grade), abs=1e-3)
        # Wheels carry what presses on the slope.
        assert run.load[0].sum() == pytest.approx(4440 * 9.81 * math.cos(grade), rel=1e-6)


def test_load_moves_to_the_rear_uphill():
    # About the rear axle's contact, slope g: front*wheelbase = m*g*(x_cg*cos - h_cg*sin)
    # - h_cg*m*v' + sum of r*(F - R), without torque and drawbar. At 2 m/s and 0.1 rad the first
    # is 43556.4*(0.859459*0.995004 - 0.960811*0.0998334) = 33069.8 N·m.
    run = simulate(
        TRACTOR, Terrain(LOAM, grades=0.1), constant([0] * 4, 0.01), 0.005, v0=2.0,
        sinkage='equilibrium',
    )  # fmt: skip
    net = (run.thrust - run.motion_resistance)[0]
    acceleration = net.sum() / 4440 - 9.81 * math.sin(0.1)
    moment = 33069.8 - 0.960811 * 4440 * acceleration
    moment += net @ np.array([0.65, 0.65, 0.85, 0.85])
    assert run.load[0, :2].sum() == pytest.approx(moment / 2.4, rel=1e-3)


def test_air_drag_by_hand():
    # 1.2 kg/m^3/2 * 3 m^2 * (20 m/s)^2 = 720 N.
    vehicle = TRACTOR.model_copy(update={'drag_area': 3.0})
    fast = simulate(vehicle, LOAM, constant([0] * 4, 0.01), 0.005, v0=20.0)
    slower = simulate(TRACTOR, LOAM, constant([0] * 4, 0.01), 0.005, v0=20.0)
    difference = (fast.v[-1] - slower.v[-1]) / 0.01
    assert difference == pytest.approx(-720 / 4440, rel=0.02)


@pytest.mark.parametrize('form', list(Form))
@pytest.mark.parametrize('vehicle', [RIG, TRACTOR], ids=['rig', 'tractor'])
def test_at_rest_stays_at_rest(form, vehicle):
    soil = SAND if vehicle is RIG else LOAM
    run = simulate(
        vehicle, soil, constant([0.0] * len(vehicle.wheels), 2.0), 0.005, form=form,
        drawbar=Drawbar(5000, 1000),
    )  # fmt: skip
    assert np.all(np.abs(run.v) < 1e-9)
    assert np.all(np.abs(run.omega) < 1e-9)
    # It neither sinks nor rises, and the soil carries each wheel's static load.
    assert run.sinkage[-1] == pytest.approx(run.sinkage[0], abs=1e-6)
    assert run.load[-1] == pytest.approx(vehicle.static_loads(), rel=1e-6)


def test_coasting_vehicle_comes_to_rest():
    run = simulate(TRACTOR, LOAM, constant([0.0] * 4, 8.0), 0.005, v0=3.0)
    assert np.max(run.v) == 3.0
    # In proportion to its speed below 0.05 m/s, and so to nothing soon.
    assert abs(run.v[-1]) < 1e-9
    assert np.all(np.abs(run.omega[-1]) < 1e-8)


SHEAR_LAWS = [
    ('janosi_hanamoto', None),
    ('wong_preston_thomas', 0.3),
    ('wong_preston_thomas', 0.6),
    ('kacigin_guskov', 0.4),
]
# The closed form with the shear law in it, the arc, and the two to which it means nothing.
VARIANTS = [
    *((form, *law) for form in (Form.BEKKER_WONG, Form.CONTACT) for law in SHEAR_LAWS),
    (Form.PAPER, *SHEAR_LAWS[0]),
    (Form.EMPIRICAL, *SHEAR_LAWS[0]),
]


def turns(values):
    """Number of sign changes among rates above a micrometre per second."""
    signs = np.sign(values[np.abs(values) > 1e-6])
    return int(np.count_nonzero(np.diff(signs)))


def kinetic_energy(run):
    """J, of the rig: 500 kg and 20 kg*m^2."""
    return 250 * run.v**2 + 10 * run.omega[:, 0] ** 2


@pytest.mark.parametrize('soil', [SAND, LOAM], ids=['sand', 'loam'])
@pytest.mark.parametrize(('form', 'law', 'residual'), VARIANTS)
def test_wheel_comes_to_rest_without_chatter(form, law, residual, soil):
    soil = soil.model_copy(update={'shear_law': law, 'residual_ratio': residual})
    run = simulate(RIG, soil, constant([0.0], 2.0), 0.005, form=form, v0=0.5, drawbar=Drawbar(500))
    # Nothing but soil and draft act: it only slows down, all the way, and stands in the end.
    assert np.all(np.diff(kinetic_energy(run)) <= 1e-9)
    assert turns(run.v) == 0
    assert abs(run.v[-1]) < 1e-4
    z = run.sinkage[-1, 0]
    # The paper's form has no thrust, and so no friction, up to a slip of K/l; at standstill that
    # is a rim speed of K/l*0.05 m/s.
    free = soil.shear_deformation_modulus / math.sqrt(z - z * z) * 0.05 / 0.5
    assert abs(run.omega[-1, 0]) < (1.001 * free if form == Form.PAPER else 1e-3)


@pytest.mark.parametrize(('form', 'law', 'residual'), VARIANTS)
def test_reversal_goes_through_standstill_once(form, law, residual):
    soil = LOAM.model_copy(update={'shear_law': law, 'residual_ratio': residual})
    torque = np.concatenate([constant([500.0], 1.0), constant([-500.0], 3.0)])
    run = simulate(RIG, soil, torque, 0.005, form=form)
    assert run.v.max() > 0.3
    assert run.v[-1] < -0.3
    assert turns(run.v) == 1
    assert turns(run.omega[:, 0]) == 1


@pytest.mark.parametrize(('form', 'law', 'residual'), VARIANTS)
def test_wheel_left_on_a_slope_goes_down_if_at_all(form, law, residual):
    # 0.02 of its weight pulls: less than the soil's resistance, which fades out below 0.05 m/s,
    # so that the wheel creeps, and no faster than that.
    soil = LOAM.model_copy(update={'shear_law': law, 'residual_ratio': residual})
    run = simulate(RIG, Terrain(soil, grades=0.02), constant([0.0], 2.0), 0.005, form=form)
    assert np.all(run.v <= 1e-9)
    assert -0.05 < run.v[-1] < 0.0
    assert np.all(np.diff(run.x) <= 1e-12)
    assert run.v[-1] == pytest.approx(run.v[-50], rel=0.2, abs=1e-3)


def test_spinning_on_the_spot_is_slowed_down_by_soil():
    # Held by its draft: the wheel turns, and the soil stops it.
    run = simulate(RIG, SAND, constant([0.0], 1.0), 0.005, omega0=[6.0], drawbar=Drawbar(1e5))
    assert np.all(np.diff(kinetic_energy(run)) <= 1e-9)
    assert abs(run.omega[-1, 0]) < 0.1


def test_slope_is_that_of_the_place():
    # Level, then 0.1 rad up from 1 m, then 0.05 rad down from 2 m: at every sample
    # m*v' = F - R - m*g*sin(grade), and the wheel carries m*g*cos(grade).
    terrain = Terrain([LOAM] * 3, [1.0, 2.0], [0.0, 0.1, -0.05])
    dt = 1e-3
    run = simulate(RIG, terrain, constant([400.0], 1.5, dt), dt, v0=2.0)
    grade = np.select([run.x < 1.0, run.x < 2.0], [0.0, 0.1], -0.05)
    assert set(grade) == {0.0, 0.1, -0.05}
    net = (run.thrust - run.motion_resistance)[:, 0]
    expected = net / 500 - 9.81 * np.sin(grade)
    # Not where a step goes over a change of slope, nor while the wheel finds its slip.
    same = grade[:-1] == grade[1:]
    same[:20] = False
    measured = np.diff(run.v) / dt
    middle = (expected[:-1] + expected[1:]) / 2
    assert measured[same] == pytest.approx(middle[same], abs=0.05)
    assert run.load[:, 0] == pytest.approx(500 * 9.81 * np.cos(grade), rel=1e-9)


def test_load_transfer_follows_the_slope_of_the_place():
    # As in `test_load_moves_to_the_rear_uphill`, where m*g*(x_cg*cos - h_cg*sin) is 33069.8 N·m
    # at 0.1 rad, and level 43556.4*0.859459 = 37434.9 N·m; the slope is that of the rear axle.
    terrain = Terrain([LOAM] * 2, [1.0], [0.0, 0.1])
    run = simulate(
        TRACTOR, terrain, constant([0] * 4, 1.0), 0.005, v0=2.0, sinkage='equilibrium'
    )  # fmt: skip
    radii = np.array([0.65, 0.65, 0.85, 0.85])
    assert run.x[-1] > 1.2
    for k in (0, -1):
        grade, moment = (0.0, 37434.9) if k == 0 else (0.1, 33069.8)
        net = (run.thrust - run.motion_resistance)[k]
        moment -= 0.960811 * 4440 * (net.sum() / 4440 - 9.81 * math.sin(grade))
        moment += net @ radii
        assert run.load[k, :2].sum() == pytest.approx(moment / 2.4, rel=1e-3)


def test_wheel_rolls_over_a_change_of_soil_without_a_jump():
    soft = load_soil('paper_sand_soft')
    over, alone = (
        simulate(RIG, terrain, constant([800.0], 1.5), 0.005, v0=3.0)
        for terrain in (Terrain([SAND, soft], [1.5]), SAND)
    )
    # As on sand alone until the wheel touches the soft one, then deeper, by and by.
    before, after = over.x < 0.9, over.x > 2.3
    assert before.any()
    assert after.any()
    assert over.sinkage[before] == pytest.approx(alone.sinkage[before], abs=1e-9)
    assert over.sinkage[after].mean() > 1.2 * alone.sinkage[after].mean()
    assert np.max(np.abs(np.diff(over.sinkage[:, 0]))) < 5e-3


def test_start_from_a_given_sinkage():
    run = simulate(
        RIG, SAND, constant([100.0], 0.05), 0.005, v0=1.0, sinkage0=[0.12], sinkage_rate0=[0.1]
    )
    load, thrust, resistance, moment = contact(
        2, 1.0, 2.0, 0.12, 0.1, SAND.packed(RIG.wheels[0]), 0.5, 0.4
    )
    forces = run.thrust[0, 0], run.motion_resistance[0, 0], run.soil_moment[0, 0]
    assert forces == pytest.approx((thrust, resistance, moment))
    # m*z'' = m*g - N: z = 0.12 + 0.1*t + (g - N/m)*t^2/2.
    expected = 0.12 + 0.1 * 0.005 + (9.81 - load / 500) * 0.005**2 / 2
    assert run.sinkage[0, 0] == 0.12
    assert run.sinkage[1, 0] == pytest.approx(expected, abs=2e-5)


def test_shear_counted_by_whole_steps():
    start = {'v0': 1.0, 'omega0': [2.3], 'sinkage0': [0.15]}
    runs = [
        simulate(RIG, SAND, constant([100.0], 0.05), 0.005, shear_step=step, **start)
        for step in (0.0, 1e-3)
    ]
    soils = SAND.packed(RIG.wheels[0]).reshape(1, -1)
    for run, step in zip(runs, (0.0, 1e-3), strict=True):
        _, thrust, _, moment, _ = forces_at(
            2, 1.0, 2.3, 0.15, 0.0, 0.0, soils, EVERYWHERE, 0.5, 0.4, -1, UNTOUCHED, FREE, step
        )
        assert (run.thrust[0, 0], run.soil_moment[0, 0]) == pytest.approx((thrust, moment))
    # It does nothing to a wheel that stands.
    still = forces_at(
        2, 0.0, 0.0, 0.15, 0.0, 0.0, soils, EVERYWHERE, 0.5, 0.4, -1, UNTOUCHED, FREE, 1e-3
    )
    assert still[1:4] == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert runs[0].thrust[0, 0] != pytest.approx(runs[1].thrust[0, 0], rel=1e-4)


def test_reverse_is_forward_mirrored_for_a_single_wheel():
    torque = constant([1500.0], 3.0)
    drawbar = Drawbar(700, 300, 1.0)
    forward = simulate(RIG, SAND, torque, 0.005, drawbar=drawbar)
    backward = simulate(RIG, SAND, -torque, 0.005, drawbar=drawbar)
    assert backward.v == pytest.approx(-forward.v, abs=1e-9)
    assert backward.slip == pytest.approx(forward.slip, abs=1e-9)


def test_soil_changes_where_the_wheel_is():
    # Front wheels stand 2.4 m ahead of the rear axle: on the patch that begins at 2 m.
    soft = load_soil('soft_patch_chrono')
    split = Plant(TRACTOR, Terrain([LOAM, soft], [2.0]))
    loam, patch = Plant(TRACTOR, LOAM), Plant(TRACTOR, soft)
    for plant in (split, loam, patch):
        plant.step([0.0] * 4, 1e-3)
    assert split.sinkage[:2] == pytest.approx(patch.sinkage[:2])
    assert split.sinkage[2:] == pytest.approx(loam.sinkage[2:])


def test_max_shear_stress_by_hand():
    # c + W/(b*r*acos(1 - z/r))*tan(phi) from the plant's own load and sinkage at rest.
    plant = Plant(RIG, SAND)
    plant.step([0.0], 1e-3)
    z = plant.sinkage[0]
    area = 0.4 * 0.5 * math.acos(1 - z / 0.5)
    assert plant.max_shear_stress == pytest.approx([4905 / area * math.tan(math.pi / 6)], rel=1e-3)


def test_slip_is_not_valid_at_standstill():
    plant = Plant(RIG, SAND)
    assert plant.slip_valid == [False]
    for _ in range(100):
        plant.step([1500.0], 0.01)
    assert plant.slip_valid == [True]


def refused(reason, **arguments):
    values = {'torque': constant([100.0] * 4, 0.05), 'dt': 0.005, **arguments}
    with pytest.raises(ValueError, match=reason):
        simulate(TRACTOR, LOAM, values.pop('torque'), values.pop('dt'), **values)


def test_what_simulate_refuses():
    spoilt = constant([100.0] * 4, 0.05)
    spoilt[7, 2] = math.nan
    refused(r'torque must have shape \(samples, 4\), got \(11, 3\)', torque=np.zeros((11, 3)))
    refused(r'torque must have shape \(samples, 4\), got \(4,\)', torque=np.zeros(4))
    refused(r'torque must have shape \(samples, 4\), got \(1, 4\)', torque=np.zeros((1, 4)))
    refused('torque of wheel 2 is not finite at sample 7', torque=spoilt)
    refused('dt must be above 0 and at most 0.02 s, got 0.05', dt=0.05)
    refused('dt must be above 0 and at most 0.02 s, got nan', dt=math.nan)
    refused("sinkage must be 'dynamic', 'equilibrium' or samples, got 'deep'", sinkage='deep')
    refused('sinkage has 5 samples, torque has 11', sinkage=np.zeros((5, 4)))
    refused(
        'sinkage needs at least 11 samples, got 5',
        torque=np.zeros((5, 4)),
        sinkage=np.zeros((5, 4)),
    )
    refused('shear_step must be at least 0 s, got -1', shear_step=-1)
    refused(r'sinkage0 must have shape \(4,\), got \(2,\)', sinkage0=[0.1, 0.1])
    refused(
        'x0, v0, omega0, sinkage0 and sinkage_rate0 must be finite, got 0.0 m, nan m/s',
        v0=math.nan,
    )
    refused(r'omega0 must have shape \(4,\), got \(2,\)', omega0=[1.0, 2.0])
    # A number for every wheel, not one that is spread over all.
    refused(r'omega0 must have shape \(4,\), got \(\)', omega0=1.0)


@pytest.mark.parametrize(
    ('argument', 'reason'),
    [
        ({'sinkage': 'given'}, "sinkage must be 'dynamic' or 'equilibrium', got 'given'"),
        ({'torque_time_constant': -0.1}, 'torque_time_constant must be at least 0 s, got -0.1'),
        ({'max_power': 0.0}, 'max_power must be above 0 W, got 0.0'),
        ({'step_size': 0.0}, 'step_size must be above 0 and at most 0.01 s, got 0.0'),
        ({'v0': math.nan}, 'v0 must be finite, got nan m/s'),
    ],
)
def test_what_a_plant_refuses(argument, reason):
    with pytest.raises(ValueError, match=reason):
        Plant(TRACTOR, LOAM, **argument)


def test_what_a_step_refuses():
    plant = Plant(TRACTOR, LOAM)
    for torque in ([1.0], [1.0, 2.0, 3.0, math.nan], 5.0):
        with pytest.raises(ValueError, match='torque must be 4 finite numbers, got'):
            plant.step(torque, 0.01)
    for duration in (0.0, -0.01, math.nan, math.inf):
        with pytest.raises(ValueError, match='duration must be above 0 s, got'):
            plant.step([0.0] * 4, duration)
    assert plant.t == 0.0


@pytest.mark.parametrize(
    ('fault', 'reason'),
    [
        ({'pull': math.inf}, 'drawbar pull must be finite, got inf'),
        ({'pull_per_speed': -1.0}, 'pull_per_speed must be finite and at least 0, got -1.0'),
        ({'pull_per_speed': math.nan}, 'drawbar pull_per_speed must be finite'),
        ({'ramp': math.inf}, 'drawbar ramp must be finite'),
    ],
)
def test_what_a_drawbar_refuses(fault, reason):
    with pytest.raises(ValueError, match=reason):
        Drawbar(**fault)
