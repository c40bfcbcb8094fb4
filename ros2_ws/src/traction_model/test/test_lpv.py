"""LPV models against the equations of motion, and what torque can control in them."""

import subprocess
import sys

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from traction_model.contact.contact import UNTOUCHED, Form, contact, equilibrium_sinkage
from traction_model.lpv.affine_model import AffineModel
from traction_model.lpv.controllability import controllability_rank
from traction_model.lpv.grid_model import GridModel
from traction_model.lpv.inverse_slip_model import InverseSlipLpvModel
from traction_model.lpv.polytope import Polytope
from traction_model.lpv.sampling import sampled
from traction_model.lpv.slip_dynamics import slip_dynamics
from traction_model.lpv.slip_model import SlipLpvModel
from traction_model.lpv.slip_slopes import wheel_speed
from traction_model.lpv.speed_model import SpeedLpvModel
from traction_model.simulation.drawbar import Drawbar
from traction_model.simulation.simulate import simulate
from traction_model.simulation.vehicle_dynamics import derivative, pack
from traction_model.simulation.wheel_forces import FORCE_COLUMNS, LOAD, UPWARD
from traction_model.soil.empirical import Brixius
from traction_model.soil.soil import Soil, load_soil, preset_soils
from traction_model.vehicle.coupling import Coupling, constraint_matrix
from traction_model.vehicle.vehicle import Axle, Vehicle, load_vehicle
from traction_model.vehicle.wheel import Wheel

MODELS = {'speed': SpeedLpvModel, 'slip': SlipLpvModel, 'inverse_slip': InverseSlipLpvModel}

# Agriculture 2024, 14(3), 499, Table 1; sinkage held at 0.15 m.
WHEEL = Wheel(radius=0.5, width=0.4, inertia=20)
MASS = 500.0
SINKAGE = 0.15
SAND = load_soil('paper_sand').packed(WHEEL)


def forces(slip, rim_speed):
    """Thrust, resistance and moment of the form with M = r*F, at a slip when driving."""
    v = (1 - slip) * rim_speed
    return contact(
        int(Form.BEKKER_WONG), v, rim_speed / WHEEL.radius, SINKAGE, 0.0, SAND,
        WHEEL.radius, WHEEL.width,
    )[1:]  # fmt: skip


def slip_rate(slip, rim_speed, torque, drawbar):
    """i' by the chain rule on i = 1 - v/(r*omega), from m*v' = F - R - D, J*omega' = T - M."""
    thrust, resistance, moment = forces(slip, rim_speed)
    v = (1 - slip) * rim_speed
    v_rate = (thrust - resistance - drawbar) / MASS
    rim_rate = WHEEL.radius * (torque - moment) / WHEEL.inertia
    return -v_rate / rim_speed + v * rim_rate / rim_speed**2


def stiffness(slip, rim_speed, h=1e-5):
    """C = dF/di by central differences."""
    return (forces(slip + h, rim_speed)[0] - forces(slip - h, rim_speed)[0]) / (2 * h)


@pytest.mark.parametrize('rim_speed', [0.3, 1.0, 10.0])
@pytest.mark.parametrize('slip', [0.02, 0.1, 0.2, 0.5])
def test_slip_dynamics_against_numerical_linearisation(slip, rim_speed):
    # In steady motion: torque balances the moment, drawbar the net thrust.
    thrust, resistance, moment = forces(slip, rim_speed)
    drawbar = thrust - resistance
    assert slip_rate(slip, rim_speed, moment, drawbar) == pytest.approx(0.0, abs=1e-12)
    h = 1e-5
    a = (
        slip_rate(slip + h, rim_speed, moment, drawbar)
        - slip_rate(slip - h, rim_speed, moment, drawbar)
    ) / (2 * h)
    b = slip_rate(slip, rim_speed, moment + 0.5, drawbar)
    b -= slip_rate(slip, rim_speed, moment - 0.5, drawbar)
    found = slip_dynamics(WHEEL, MASS, rim_speed, stiffness(slip, rim_speed), slip)
    assert found == pytest.approx((a, b), rel=1e-5)


def test_slip_dynamics_by_hand():
    # rim 2 m/s, C = 10 kN, slip 0.2: a = -1e4*(1/500 + 0.8*0.25/20)/2 = -1e4*0.012/2 = -60/s;
    # b = 0.8*0.5/(20*2) = 0.01 per N·m·s.
    assert slip_dynamics(WHEEL, MASS, 2.0, 1e4, 0.2) == pytest.approx((-60.0, 0.01))


def test_torque_gain_changes_tenfold_with_speed():
    slow = slip_dynamics(WHEEL, MASS, 0.5, 1e4, 0.2)[1]
    fast = slip_dynamics(WHEEL, MASS, 5.0, 1e4, 0.2)[1]
    assert slow / fast == pytest.approx(10.0)


@pytest.mark.parametrize('rim_speed', [0.3, 1.0, 3.0, 12.0])
@pytest.mark.parametrize('slip', [0.02, 0.1, 0.2, 0.5])
def test_with_slip_as_a_state_speed_can_be_controlled(slip, rim_speed):
    # x = [i, v]: torque drives slip, and thrust C*i drives speed.
    c = stiffness(slip, rim_speed)
    a, b = slip_dynamics(WHEEL, MASS, rim_speed, c, slip)
    controllability = control.ctrb(np.array([[a, 0.0], [c / MASS, 0.0]]), np.array([[b], [0.0]]))
    # Columns scaled to one: rank by angle, whatever the units.
    assert np.linalg.matrix_rank(controllability / np.abs(controllability).max(axis=0)) == 2


def test_in_the_papers_form_torque_does_not_reach_speed():
    # (31): x = [v, omega], u = T; tau and z enter v' as uncontrolled inputs.
    friction = 3.0
    state = np.array([[0.0, 0.0], [0.0, -friction / WHEEL.inertia]])
    controllability = control.ctrb(state, np.array([[0.0], [1 / WHEEL.inertia]]))
    assert np.linalg.matrix_rank(controllability) == 1
    assert np.all(controllability[0] == 0.0)


def test_sampled_against_the_scalar_solution():
    # i' = a*i + b*T with T held: exp(a*dt) and b*(exp(a*dt) - 1)/a.
    a_d, b_d = sampled(np.array([[-60.0]]), np.array([[0.01]]), 0.01)
    assert a_d[0, 0] == pytest.approx(np.exp(-0.6))
    assert b_d[0, 0] == pytest.approx(0.01 * (np.exp(-0.6) - 1) / -60)


def test_sampled_against_python_control():
    a = np.array([[-5.0, 2.0], [0.0, -10.0]])
    b = np.array([[0.0], [10.0]])
    expected = control.ss(a, b, np.eye(2), 0).sample(0.01)
    a_d, b_d = sampled(a, b, 0.01)
    assert a_d == pytest.approx(expected.A)
    assert b_d == pytest.approx(expected.B)


@pytest.mark.parametrize(
    ('fault', 'reason'),
    [
        ({'mass': 0.0}, 'mass is out of range: 0.0'),
        ({'rim_speed': 0.0}, 'rim_speed is out of range: 0.0'),
        ({'rim_speed': float('nan')}, 'rim_speed is out of range: nan'),
        ({'slip_stiffness': -1.0}, 'slip_stiffness is out of range: -1.0'),
        ({'slip': 1.0}, 'slip is out of range: 1.0'),
        # When braking, slip is defined otherwise: this model does not hold.
        ({'slip': -0.1}, 'slip is out of range: -0.1'),
    ],
)
def test_out_of_range_is_named(fault, reason):
    point = {'mass': MASS, 'rim_speed': 1.0, 'slip_stiffness': 1e4, 'slip': 0.2, **fault}
    with pytest.raises(ValueError, match=reason):
        slip_dynamics(WHEEL, **point)


# The LPV model of a vehicle.

ALL_FORMS = pytest.mark.parametrize('form', list(Form))
N_WHEELS = pytest.mark.parametrize('n', [1, 2, 4, 6, 8])


# Soil that springs back, strengthens with width and loses strength as it is sheared.
PEAT = Soil(
    pressure_law='reece', cohesive_modulus=20, frictional_modulus=60, unit_weight=9000,
    sinkage_exponent=0.8, cohesion=1500, friction_angle=0.5, shear_law='kacigin_guskov',
    shear_deformation_modulus=0.02, residual_ratio=0.6, elastic_modulus=2e7,
)  # fmt: skip
# Each with a traction curve, for the empirical form.
SOILS = {
    name: soil.model_copy(update={'traction_curve': Brixius(mobility_number=30)})
    for name, soil in {**preset_soils(), 'peat': PEAT}.items()
}


def vehicle(n):
    """A vehicle of n wheels, every axle with wheels and grousers of its own."""
    axles = [
        Axle(
            wheel_names=tuple(f'w{j}' for j in range(2 * k, min(2 * k + 2, n))),
            x=3.0 - k,
            wheel=Wheel(
                radius=0.5 + 0.1 * k, width=0.3 + 0.05 * k, inertia=15 + 5 * k,
                viscous_friction=4 + k, mass=50, grouser_height=0.02 * k,
            ),
        )
        for k in range((n + 1) // 2)
    ]  # fmt: skip
    return Vehicle(
        chassis_mass=900 * n,
        chassis_cg_x=float(np.mean([axle.x for axle in axles])),
        chassis_cg_height=0.8,
        axles=axles,
        drag_area=3.0,
    )


def radii(of):
    return np.array([wheel.radius for wheel in of.wheels])


def motion(of, form, soil, v, omega, z, z_rate, torque, pull):
    """v' and omega' by the nonlinear equations of the simulation, on fresh soil."""
    n = len(of.wheels)
    model = pack(of, soil, form, 'dynamic', Drawbar(pull=pull), multipass=False)
    state = np.concatenate([[v, 0.0], omega, z, z_rate])
    forces = np.zeros((n, 7))
    rates = np.empty_like(state)
    torques, given = np.stack([torque, torque]), np.zeros((2, 3, n))
    choice = model.wheels.shape[0], model.form, model.mode
    derivative(0.0, state, torques, given, 0, 0.0, model, UNTOUCHED, forces, rates, *choice)
    return rates[0], rates[2 : 2 + n]


def held(of, v, pull):
    """D_x: drawbar, which fades out below 0.05 m/s, and air drag 1.2/2*C_d*A_f*v*|v|."""
    return pull * max(-1.0, min(1.0, v / 0.05)) + 0.6 * of.drag_area * v * abs(v)


def state_rates(kind, v, rim, v_rate, rim_rate):
    """Rates of slip or 1/slip by the chain rule on its definition."""
    driving = rim >= v
    # i = 1 - v/rim and i = rim/v - 1.
    rate = np.where(
        driving, -v_rate / rim + v * rim_rate / rim**2, rim_rate / v - rim * v_rate / v**2
    )
    slip = np.where(driving, 1 - v / rim, rim / v - 1)
    return rate if kind == 'slip' else -rate / slip**2


def lpv_rates(model, point, torque):
    found = model.matrices(point.rho)
    return found.A @ point.x + found.B @ torque + found.B_uc @ point.u_uc


@ALL_FORMS
@N_WHEELS
@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), soil=st.sampled_from(sorted(SOILS)))
def test_speed_states_reproduce_the_equations_of_motion(n, form, seed, soil):
    # Forward, backward, near standstill, wheels turning against the motion or off the ground.
    random = np.random.default_rng(seed)
    of, soil = vehicle(n), SOILS[soil]
    v = random.choice([0.0, 0.02, -0.02, 1.0, -1.0]) * random.uniform(1, 4)
    omega = (v + random.choice([0.0, 0.05, 1.0]) * random.uniform(-2, 2, n)) / radii(of)
    z, z_rate = random.uniform(1e-4, 0.06, n), random.uniform(-0.05, 0.05, n)
    torque, pull = random.uniform(-3000, 3000, n), random.uniform(0, 2000)
    model = SpeedLpvModel(of, form)
    point = model.at(v, omega, z, soil, sinkage_rate=z_rate, holding_force=held(of, v, pull))
    v_rate, omega_rate = motion(of, form, soil, v, omega, z, z_rate, torque, pull)
    assert lpv_rates(model, point, torque) == pytest.approx(
        [v_rate, *omega_rate], rel=1e-9, abs=1e-9
    )


@ALL_FORMS
@pytest.mark.parametrize('state', ['slip', 'inverse_slip'])
@N_WHEELS
@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), soil=st.sampled_from(sorted(SOILS)))
def test_slip_states_reproduce_the_equations_of_motion(n, state, form, seed, soil):
    random = np.random.default_rng(seed)
    of, soil = vehicle(n), SOILS[soil]
    v = random.uniform(0.06, 5)
    slip = random.choice([-1, 1], n) * random.uniform(0.011, 0.8, n)
    omega = wheel_speed(v, slip, radii(of))
    z, z_rate = random.uniform(1e-4, 0.06, n), random.uniform(-0.05, 0.05, n)
    torque, pull = random.uniform(-3000, 3000, n), random.uniform(0, 2000)
    model = MODELS[state](of, form)
    point = model.at(v, omega, z, soil, sinkage_rate=z_rate, holding_force=held(of, v, pull))
    v_rate, omega_rate = motion(of, form, soil, v, omega, z, z_rate, torque, pull)
    slip_rates = state_rates(state, v, radii(of) * omega, v_rate, radii(of) * omega_rate)
    assert point.x[1:] == pytest.approx(slip if state == 'slip' else 1 / slip, rel=1e-9)
    assert lpv_rates(model, point, torque) == pytest.approx(
        [v_rate, *slip_rates], rel=1e-9, abs=1e-9
    )


@ALL_FORMS
@pytest.mark.parametrize('state', ['speed', 'slip', 'inverse_slip'])
def test_a_known_load_is_imposed_as_the_simulation_does(state, form):
    # Sinkage given: the soil carries the wheels' loads, whatever pressure that takes.
    random = np.random.default_rng(5)
    of, n = vehicle(4), 4
    model = MODELS[state](of, form)
    nonlinear = pack(of, SOILS['peat'], form, 'given', Drawbar(), multipass=False)
    for _ in range(20):
        v, slip = random.uniform(0.2, 4), random.uniform(0.02, 0.6, n)
        omega = wheel_speed(v, slip, radii(of))
        given = np.array([random.uniform(0.02, 0.1, n), random.uniform(-0.05, 0.05, n), [0.0] * n])
        torque, found = random.uniform(0, 3000, n), np.zeros((n, FORCE_COLUMNS))
        found[:, LOAD] = of.static_loads()
        start = np.concatenate([[v, 0.0], omega, np.zeros(2 * n)])
        torques, sinkages = np.stack([torque, torque]), np.stack([given, given])
        rates = np.empty_like(start)
        choice = nonlinear.wheels.shape[0], nonlinear.form, nonlinear.mode
        derivative(
            0.0, start, torques, sinkages, 0, 0.0, nonlinear, UNTOUCHED, found, rates, *choice
        )
        expected, omega_rate = rates[0], rates[2 : 2 + n]
        if state == 'speed':
            expected = [expected, *omega_rate]
        else:
            rim = radii(of) * np.array([omega, omega_rate])
            expected = [expected, *state_rates(state, v, rim[0], expected, rim[1])]
        point = model.at(
            v, omega, given[0], SOILS['peat'], sinkage_rate=given[1], load=found[:, UPWARD],
            holding_force=held(of, v, 0.0),
        )  # fmt: skip
        assert lpv_rates(model, point, torque) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_a_wheel_off_the_ground_feels_no_soil():
    of = vehicle(2)
    for form in Form:
        model = SpeedLpvModel(of, form)
        point = model.at(1.0, [3.0, 3.0], [-0.1, 0.05], SOILS['dry_sand'])
        soil_on_first = model.matrices(point.rho).B_uc[:, :2] @ point.u_uc[:2]
        assert soil_on_first == pytest.approx([0, 0, 0])


RIG = Vehicle(
    chassis_mass=500,
    chassis_cg_x=0,
    chassis_cg_height=0.5,
    axles=[
        Axle(
            wheel_names=['wheel'],
            x=0,
            wheel=Wheel(radius=0.5, width=0.4, inertia=20, viscous_friction=2),
        )
    ],
)


def test_matrices_by_hand():
    # The paper's wheel, Table 1: A 0.224 m^2, K 0.01 m, n 1.1, W 4905 N, at 25 % slip.
    # A*(1 - K*b/(A*i)) = A - b*K/i = 0.224 - 0.4*0.01*4 = 0.208 m^2.
    # v' per tau 0.208/500; omega' per tau -0.5*0.208/20; v' per z -b*W/((n+1)*A*m).
    model = SpeedLpvModel(RIG, Form.PAPER)
    found = model.matrices(
        {
            'heading': 1,
            'sinkage_exponent': 1.1,
            'area': 0.224,
            'load': 4905,
            'shear_deformation_modulus': 0.01,
            'inverse_slip': 4,
        }
    )
    np.testing.assert_allclose(found.A, [[0, 0], [0, -0.1]])
    np.testing.assert_allclose(found.B, [[0], [0.05]])
    assert found.B_uc == pytest.approx(
        np.array(
            [
                [0.208 / 500, -0.4 * 4905 / (2.1 * 0.224) / 500, -1 / 500],
                [-0.5 * 0.208 / 20, 0, 0],
            ]
        )
    )
    assert np.array_equal(found.C, np.eye(2))
    assert np.array_equal(found.D, np.zeros((2, 1)))
    assert model.uncontrolled_names == ('tau_max_wheel', 'sinkage_wheel', 'holding_force')
    assert model.uncontrolled_units == ('Pa', 'm', 'N')


def test_the_forms_thrust_areas_agree_where_they_should():
    # `PAPER` from 1/i and K, `BEKKER_WONG` from kappa: with kappa = 1/y both are one.
    common = {'heading': 1, 'sinkage_exponent': 1.1, 'area': 0.2, 'load': 5000}
    paper = SpeedLpvModel(RIG, Form.PAPER)
    exact = SpeedLpvModel(RIG, Form.BEKKER_WONG)
    for inverse_slip in (-2.0, 1.5, 10.0):
        kappa = 0.01 * abs(inverse_slip) / 0.5  # K*|1/i|/l with l = A/b = 0.5 m
        mobilisation = np.sign(inverse_slip) * (1 - kappa)
        one = paper.matrices(
            {**common, 'shear_deformation_modulus': 0.01, 'inverse_slip': inverse_slip}
        )
        other = exact.matrices({**common, 'mobilisation': mobilisation})
        assert one.B_uc == pytest.approx(other.B_uc)
    # Where kappa would exceed 1 no thrust is left, rather than a reversed one.
    none = paper.matrices({**common, 'shear_deformation_modulus': 0.01, 'inverse_slip': 60})
    assert none.B_uc[0, 0] == 0.0


@ALL_FORMS
@pytest.mark.parametrize('state', ['speed', 'slip', 'inverse_slip'])
def test_units_agree(state, form):
    # Lengths in cm, masses in g: every matrix must change by the units of its rows and columns
    # alone. (29) as printed, without r and 1/J in its second row and b in its first, would not.
    cm, g = 100.0, 1000.0
    unit = {
        '1': 1.0, 'm': cm, 'm/s': cm, 'rad/s': 1.0, 'm^2': cm**2, 'N': g * cm, 'N·m': g * cm**2,
        'Pa': g / cm, 'N/m': g,
    }  # fmt: skip
    wheel = RIG.wheels[0]
    scaled = Vehicle(
        chassis_mass=500 * g, chassis_cg_x=0, chassis_cg_height=50,
        axles=[
            Axle(
                wheel_names=['wheel'], x=0,
                wheel=Wheel(
                    radius=wheel.radius * cm, width=wheel.width * cm,
                    inertia=wheel.inertia * g * cm**2,
                    viscous_friction=wheel.viscous_friction * g * cm**2,
                ),
            )
        ],
    )  # fmt: skip
    model, other = (MODELS[state](of, form) for of in (RIG, scaled))
    # Typical values, within the ranges of both.
    typical = {
        'heading': 1, 'sinkage_exponent': 1.1, 'area': 0.2, 'load': 500, 'inverse_slip': 3,
        'shear_deformation_modulus': 0.008, 'mobilisation': 0.7, 'moment_mobilisation': 0.65,
        'resistance_gradient': 5000, 'speed': 0.9, 'slip': 0.3, 'slip_stiffness': 8000,
        'moment_stiffness': 3900,
    }  # fmt: skip
    rho = {name: typical[name] for name in model.parameters}
    rho_scaled = {name: rho[name] * unit[entry.unit] for name, entry in model.parameters.items()}
    found, found_scaled = model.matrices(rho), other.matrices(rho_scaled)
    rows = np.array([unit[name] for name in model.state_units])
    disturbances = np.array([unit[name] for name in model.uncontrolled_units])
    for name, columns in (('A', rows), ('B', [g * cm**2]), ('B_uc', disturbances)):
        expected = getattr(found, name) * rows[:, None] / np.asarray(columns)
        assert getattr(found_scaled, name) == pytest.approx(expected, rel=1e-12), name


@ALL_FORMS
def test_simulated_as_the_plant_is(form):
    # The LPV model, rho taken at each instant, integrated by scipy beside `simulate`.
    soil, sinkage, torque, dt, samples = SOILS['paper_sand'], 0.08, 900.0, 2e-3, 501
    run = simulate(
        RIG, soil, np.full((samples, 1), torque), dt, form=form,
        sinkage=np.full((samples, 1), sinkage), v0=0.8, omega0=[2.0],
    )  # fmt: skip
    model = SpeedLpvModel(RIG, form)

    def rates(_, x):
        return lpv_rates(
            model, model.at(x[0], x[1:], [sinkage], soil, load=RIG.static_loads()), [torque]
        )

    end = solve_ivp(rates, (0, dt * (samples - 1)), [0.8, 2.0], rtol=1e-8, atol=1e-8).y[:, -1]
    assert end == pytest.approx([run.v[-1], run.omega[-1, 0]], rel=1e-5)
    # It has moved, so that there is something to compare.
    assert abs(run.v[-1] - 0.8) > 0.05


# Coupled wheels.

TRACTOR = load_vehicle('tractor_4wd')
# Rear differential locked, front axle driven from the rear with a lead of 2 %, its differential
# open: radii 0.85 and 0.65 m.
FOUR_WHEEL_DRIVE = (
    Coupling(('rl',), ('rr',)),
    Coupling(('rl', 'rr'), ('fl', 'fr'), 1.02 * 0.85 / 0.65),
)


def test_constraint_matrix_by_hand():
    # Wheels a, b, c: b = 2*a locks the axle, (a + b)/2 = c/3 drives the other: c = 4.5*a.
    names = ('a', 'b', 'c')
    P, free = constraint_matrix(
        names, [Coupling(('a',), ('b',), 2.0), Coupling(('a', 'b'), ('c',), 3.0)]
    )
    assert free == (0,)
    np.testing.assert_allclose(P, [[1], [2], [4.5]])
    # One open differential: of (a + b)/2 = c the last wheel follows.
    P, free = constraint_matrix(names, [Coupling(('a', 'b'), ('c',))])
    assert free == (0, 1)
    np.testing.assert_allclose(P, [[1, 0], [0, 1], [0.5, 0.5]])


def test_lumped_inertia_by_hand():
    # Both axles locked to one another at ratio k: J = 2*60 + 2*k^2*15 about the rear axle;
    # torque on a front wheel counts k times.
    k = 1.02 * 0.85 / 0.65
    everything = (*FOUR_WHEEL_DRIVE, Coupling(('fl',), ('fr',)))
    model = SpeedLpvModel(TRACTOR, Form.BEKKER_WONG, couplings=everything)
    # The first wheel, fl, is the one that is left: its speed is k times that of the rear.
    assert model.state_names == ('v', 'omega_fl')
    J = 120 + 30 * k**2
    B = model.matrices(model.sample(1)[0]).B
    assert B[1] == pytest.approx(np.array([k, k, 1, 1]) * k / J)
    assert np.all(B[0] == 0)


def constrained_motion(model, form, soils, v, omega, z, torque, force):
    """v' and omega' with the couplings' torques as Lagrange multipliers, from `contact`."""
    of = model.vehicle
    names, wheels = of.wheel_names, of.wheels
    found = np.array(
        [
            contact(int(form), v, omega[j], z[j], 0.0, soils[j].packed(w), w.radius, w.width)
            for j, w in enumerate(wheels)
        ]
    )
    G = np.array([coupling.equation(names) for coupling in model.couplings])
    n, k = len(wheels), len(G)
    friction = np.array([wheel.viscous_friction for wheel in wheels])
    J = np.diag([wheel.inertia for wheel in wheels])
    matrix = np.block([[J, G.T], [G, np.zeros((k, k))]])
    _, thrust, resistance, moment = found.T
    drive = torque - friction * omega - moment
    solution = np.linalg.solve(matrix, np.concatenate([drive, np.zeros(k)]))
    return (np.sum(thrust - resistance) - force) / of.mass, solution[:n]


@ALL_FORMS
@pytest.mark.parametrize('state', ['speed', 'slip', 'inverse_slip'])
@pytest.mark.parametrize(
    'couplings', [FOUR_WHEEL_DRIVE[:1], FOUR_WHEEL_DRIVE[1:], FOUR_WHEEL_DRIVE]
)
def test_coupled_wheels_against_lagrange_multipliers(couplings, state, form):
    model = MODELS[state](TRACTOR, form, couplings=couplings)
    random = np.random.default_rng(7)
    # Left and right on different soil, so that the couplings carry torque.
    soils = [SOILS[name] for name in ('sandy_loam_15', 'clayey_soil_38') * 2]
    for _ in range(20):
        v = random.uniform(0.5, 3)
        free = v * random.uniform(1.1, 1.3, len(model.independent))
        omega = model.constraint @ (free / radii(TRACTOR)[list(model.independent)])
        z = random.uniform(0.01, 0.08, 4)
        torque = random.uniform(0, 6000, 4)
        v_rate, omega_rate = constrained_motion(
            model, form, soils, v, omega, z, torque, force=3000.0
        )
        point = model.at(v, omega, z, soils, holding_force=3000.0)
        own = list(model.independent)
        rates = omega_rate[own]
        if state != 'speed':
            radius = radii(TRACTOR)[own]
            rates = state_rates(state, v, radius * omega[own], v_rate, radius * rates)
        assert lpv_rates(model, point, torque) == pytest.approx(
            [v_rate, *rates], rel=1e-9, abs=1e-9
        )
        if state == 'speed':
            # Outputs are all wheels' speeds.
            assert model.matrices(point.rho).C @ point.x == pytest.approx([v, *omega])


def test_locked_axle_moves_as_one_wheel_of_lumped_inertia():
    # Two wheels locked, torque on one of them only, beside one wheel of twice the width,
    # inertia and friction: with k_c = 0 soil does not care for width.
    half = Wheel(radius=0.5, width=0.2, inertia=10, viscous_friction=1)
    pair = Vehicle(
        chassis_mass=500, chassis_cg_x=0, chassis_cg_height=0.5,
        axles=[Axle(wheel_names=['left', 'right'], x=0, wheel=half)],
    )  # fmt: skip
    soil, sinkage, torque, dt, samples = SOILS['paper_sand'], 0.08, 900.0, 2e-3, 501
    assert soil.cohesive_modulus == 0
    run = simulate(
        RIG, soil, np.full((samples, 1), torque), dt, sinkage=np.full((samples, 1), sinkage),
        v0=0.8, omega0=[2.0],
    )  # fmt: skip
    model = SpeedLpvModel(pair, couplings=[Coupling(('left',), ('right',))])

    def rates(_, x):
        point = model.at(x[0], [x[1], x[1]], [sinkage, sinkage], soil, load=pair.static_loads())
        return lpv_rates(model, point, [torque, 0.0])

    end = solve_ivp(rates, (0, dt * (samples - 1)), [0.8, 2.0], rtol=1e-8, atol=1e-8).y[:, -1]
    assert end == pytest.approx([run.v[-1], run.omega[-1, 0]], rel=1e-5)


@pytest.mark.parametrize(
    ('couplings', 'reason'),
    [
        ([(('rl',), ('rx',))], "unknown wheel 'rx'; there are: fl, fr, rl, rr"),
        ([(('rl',), ('rr',)), (('rr',), ('rl',))], 'follows from the other couplings'),
        ([(('rl',), ('rr',)), (('rr',), ('rl',), 2.0)], "hold wheel 'rl' still"),
        ([(('rl',), ('rl',))], "wheel 'rl' is named twice"),
        ([(('rl',), ('rr',), 0.0)], 'ratio of a coupling must be finite and not 0'),
        ([(('rl',), ('rr',), float('nan'))], 'ratio of a coupling must be finite and not 0'),
        ([(('rl',), ())], 'following wheels of a coupling must be a tuple of at least one'),
        ([('rl', ('rr',))], 'leading wheels of a coupling must be a tuple of at least one'),
    ],
)
def test_faulty_couplings_are_named(couplings, reason):
    with pytest.raises(ValueError, match=reason):
        SpeedLpvModel(TRACTOR, couplings=[Coupling(*coupling) for coupling in couplings])


def test_wheel_speeds_against_a_coupling_are_named():
    model = SpeedLpvModel(TRACTOR, couplings=FOUR_WHEEL_DRIVE[:1])
    with pytest.raises(ValueError, match=r"omega of wheel 'rr' is 3 rad/s, .* make it 2"):
        model.at(1.0, [2, 2, 2, 3], [0.05] * 4, SOILS['dry_sand'])


# Representations.


def operation(of, form, state, count=40, soil='sandy_loam_15'):
    """The model with the ranges of a day's work: 5 to 40 % slip, 2 to 8 cm, 0.5 to 3 m/s."""
    model = MODELS[state](of, form)
    random = np.random.default_rng(3)
    n = model.n_wheels
    met = []
    for _ in range(count):
        v = random.uniform(0.5, 3)
        omega = wheel_speed(v, random.uniform(0.05, 0.4, n), radii(of))
        met.append(model.at(v, omega, random.uniform(0.02, 0.08, n), SOILS[soil]).rho)
    return model.narrowed(met), met


@ALL_FORMS
@N_WHEELS
def test_speed_states_are_affine_in_their_terms(n, form):
    model, met = operation(vehicle(n), form, 'speed')
    affine = AffineModel.fit(model)
    assert len(affine.names) == n * (3 if form == Form.CONTACT else 2)
    assert affine.error([*met, *model.sample(50, seed=1)]) < 1e-12


@ALL_FORMS
def test_affine_in_rho_itself_has_an_error_that_is_stated(form):
    model, _ = operation(vehicle(2), form, 'speed')
    affine = AffineModel.fit(model, 'schedule')
    samples = model.sample(50, seed=1)
    # The entries are products of parameters: affine they are not, though nearly so over less.
    whole = affine.error(samples)
    assert 1e-3 < whole < 1.0
    half = model.narrowed(samples[:3])
    assert AffineModel.fit(half, 'schedule').error(half.sample(50, seed=1)) < whole
    # By its definition, on the entry that is worst.
    worst = max(
        np.max(np.abs([getattr(affine.matrices(rho), name)[index]
                       - getattr(model.matrices(rho), name)[index] for rho in samples]))
        / np.max(np.abs([getattr(model.matrices(rho), name)[index] for rho in samples]))
        for name in ('A', 'B', 'B_uc')
        for index in np.ndindex(getattr(affine.constant, name).shape)
        if any(getattr(model.matrices(rho), name)[index] for rho in samples)
    )  # fmt: skip
    assert whole == pytest.approx(worst)


@ALL_FORMS
@pytest.mark.parametrize('coordinates', ['terms', 'schedule'])
def test_polytope_is_its_affine_model(coordinates, form):
    model, met = operation(vehicle(2), form, 'speed')
    affine = AffineModel.fit(model, coordinates)
    polytope = Polytope(affine)
    vertices = list(polytope.vertices())
    for rho in (*met[:10], *model.sample(10, seed=2)):
        weights = polytope.weights(rho)
        assert len(weights) == len(polytope) == len(vertices)
        assert np.all(weights >= 0)
        assert weights.sum() == pytest.approx(1.0, abs=1e-12)
        expected, found = affine.matrices(rho), polytope.matrices(rho)
        for name in ('A', 'B', 'B_uc'):
            combined = sum(
                weight * getattr(vertex, name)
                for weight, vertex in zip(weights, vertices, strict=True)
            )
            size = np.abs(getattr(expected, name)).max()
            assert combined == pytest.approx(getattr(expected, name), rel=1e-9, abs=1e-12 * size)
            assert getattr(found, name) == pytest.approx(combined, rel=1e-12, abs=1e-15)
    samples = model.sample(20, seed=4)
    assert polytope.error(samples) == pytest.approx(affine.error(samples), rel=1e-6, abs=1e-12)


def test_ends_of_the_terms_bound_all_samples():
    # 1/slip of either sign: the thrust area's extremes lie at slip -1 and 1, within the range.
    model = SpeedLpvModel(
        RIG, Form.PAPER,
        ranges={
            'inverse_slip': (-20, 20), 'area': (0.15, 0.19), 'load': (4000, 6000),
            'heading': (1, 1), 'sinkage_exponent': (0.7, 1.2),
            'shear_deformation_modulus': (0.01, 0.02),
        },
    )  # fmt: skip
    affine = AffineModel.fit(model)
    # A - b*K*|1/i| = 0.19 - 0.4*0.01*1 = 0.186 m^2 at most, either way.
    assert affine.names == ('thrust_area_wheel', 'resistance_gradient_wheel')
    assert affine.high[0] == pytest.approx(0.186)
    assert affine.low[0] == pytest.approx(-0.186)
    samples = model.sample(500)
    assert Polytope(affine).error(samples[:50]) < 1e-12
    inverse = np.array([rho['inverse_slip'][0] for rho in samples])
    assert inverse.min() < -1
    assert inverse.max() > 1
    assert np.all(np.abs(inverse) >= 1)
    # Even in slip: half of the slips are between 0.05 and 0.525.
    assert np.mean(np.abs(inverse) > 1 / 0.525) == pytest.approx(0.5, abs=0.1)


def test_polytopes_have_a_limit_and_a_box():
    model, _ = operation(vehicle(8), Form.CONTACT, 'speed', count=4)
    with pytest.raises(ValueError, match=r'24 coordinates vary, a polytope takes at most 16'):
        Polytope(AffineModel.fit(model))
    model, _ = operation(RIG, Form.CONTACT, 'speed')
    polytope = Polytope(AffineModel.fit(model))
    beyond = SpeedLpvModel(RIG, Form.CONTACT).schedule(
        area=0.09, mobilisation=-0.5, moment_mobilisation=0.3, resistance_gradient=1e3
    )
    affine = polytope.affine
    with pytest.raises(ValueError, match=r'^mobilisation is -0.5, out of its range'):
        polytope.weights(beyond)
    with pytest.raises(ValueError, match=r'^mobilisation_wheel is -0.5, outside the polytope'):
        Polytope(AffineModel.fit(model, 'schedule')).weights(beyond)
    with pytest.raises(ValueError, match='corner must be 0 to 7, got 8'):
        polytope.corner(8)
    with pytest.raises(ValueError, match='coordinate moment_area_wheel is not finite'):
        affine.at([0.1, np.nan, 1e3])
    with pytest.raises(ValueError, match='coordinates must be 3'):
        affine.at([0.1, 0.1])
    with pytest.raises(ValueError, match="unknown coordinates 'term'; did you mean 'terms'"):
        AffineModel.fit(model, 'term')
    with pytest.raises(ValueError, match='3 coordinates need more samples than 3'):
        AffineModel.fit(model, samples=model.sample(3))


GRID_SLIP = (0.05, 0.4)
GRID_SINKAGE = (0.02, 0.08)
GRID_SPEED = (0.5, 3.0)


def grid(form, state, points, of=RIG):
    return GridModel(
        MODELS[state](of, form), SOILS['sandy_loam_15'],
        np.linspace(*GRID_SLIP, points), np.linspace(*GRID_SINKAGE, points),
        np.linspace(*GRID_SPEED, 4),
    )  # fmt: skip


@ALL_FORMS
@pytest.mark.parametrize('state', ['speed', 'slip', 'inverse_slip'])
def test_grid_is_exact_on_its_points_and_converges_between(state, form):
    coarse = grid(form, state, 5)
    model = coarse.model
    for slip, sinkage, v in ((0.05, 0.02, 0.5), (0.4, 0.08, 3.0), (0.225, 0.05, 0.5)):
        point = model.at(v, wheel_speed(v, [slip], [0.5]), [sinkage], coarse.soil)
        expected, found = model.matrices(point.rho), coarse.matrices(v, [slip], [sinkage])
        for name in ('A', 'B', 'B_uc'):
            assert getattr(found, name) == pytest.approx(getattr(expected, name), rel=1e-9)
    error, finer = coarse.error(), grid(form, state, 13).error()
    # Where the thrust of `PAPER` sets in its stiffness jumps: no grid follows a jump.
    if form != Form.PAPER or state == 'speed':
        assert finer < 0.6 * error
    assert 0 < error < 1.0


def test_grid_of_several_wheels():
    # Each wheel at a grid point of its own: exact.
    of = vehicle(4)
    several = grid(Form.CONTACT, 'speed', 5, of)
    slip = several.axes['slip'][[0, 1, 4, 2]]
    sinkage = several.axes['sinkage'][[3, 0, 2, 1]]
    v = several.axes['speed'][1]
    point = several.model.at(v, wheel_speed(v, slip, radii(of)), sinkage, several.soil)
    expected = several.model.matrices(point.rho)
    found = several.matrices(v, slip, sinkage)
    assert found.B_uc == pytest.approx(expected.B_uc, rel=1e-9)
    np.testing.assert_allclose(found.A, expected.A, rtol=1e-12)
    assert 0 < several.error() < 0.1


@pytest.mark.parametrize(
    ('call', 'reason'),
    [
        (lambda g: g.matrices(1.0, [0.5], [0.05]), "slip at wheel 'wheel' is 0.5, outside"),
        (lambda g: g.matrices(1.0, [0.1], [np.nan]), "sinkage at wheel 'wheel' is nan, outside"),
        (lambda g: g.matrices(9.0, [0.1], [0.05]), "speed at wheel 'wheel' is 9, outside"),
        (lambda g: g.matrices(1.0, [0.1, 0.1], [0.05]), r'slip must have shape \(1,\)'),
        (lambda g: GridModel(g.model, g.soil, [0.2], [0.1, 0.2], [1, 2]), 'slip of a grid must'),
        (
            lambda g: GridModel(g.model, g.soil, [0.1, 0.2], [0.1, 0.6], [1, 2]),
            'sinkage of a grid must lie within',
        ),
        (
            lambda g: GridModel(g.model, g.soil, [0.1, 0.2], [0.1, 0.2], [2, 1]),
            'speed of a grid must be at least 2 increasing',
        ),
    ],
)
def test_faults_at_grids_are_named(call, reason):
    with pytest.raises(ValueError, match=reason):
        call(grid(Form.BEKKER_WONG, 'speed', 2))


# Slip as a state.


@pytest.mark.parametrize('form', [Form.PAPER, Form.BEKKER_WONG])
@pytest.mark.parametrize('slip', [-0.3, 0.15, 0.3, 0.6])
def test_slip_states_against_numerical_linearisation(slip, form):
    # In steady motion, without friction, A is the Jacobian: forces of the closed forms depend
    # on slip alone, and the slopes of slip multiply rates that are zero.
    of = RIG.model_copy(update={'axles': (RIG.axles[0].model_copy(update={'wheel': WHEEL}),)})
    sand = SOILS['paper_sand']
    z, none = np.array([SINKAGE]), np.zeros(1)
    model = SlipLpvModel(of, form)

    def rates(v, slip, torque, pull):
        omega = wheel_speed(v, [slip], [0.5])
        v_rate, omega_rate = motion(of, form, sand, v, omega, z, none, torque, pull)
        return np.array([v_rate, state_rates('slip', v, 0.5 * omega, v_rate, 0.5 * omega_rate)[0]])

    v = 1.2
    omega = wheel_speed(v, [slip], [0.5])
    _, thrust, resistance, moment = contact(int(form), v, omega[0], SINKAGE, 0.0, SAND, 0.5, 0.4)
    # No pull backward where braking: what is missing goes in as a constant.
    torque = np.array([moment])
    net = thrust - resistance

    def steady(v, slip):
        return rates(v, slip, torque, 0.0) - [net / MASS, 0.0] + [
            0.0, net / MASS * (1 - slip if slip >= 0 else 1 / (1 + slip))
            / (v if slip >= 0 else v / (1 + slip) ** 2),
        ]  # fmt: skip

    h = 1e-5
    jacobian = np.column_stack(
        [
            (steady(v + h, slip) - steady(v - h, slip)) / (2 * h),
            (steady(v, slip + h) - steady(v, slip - h)) / (2 * h),
        ]
    )
    found = model.matrices(model.at(v, omega, z, sand).rho).A
    assert found == pytest.approx(jacobian, rel=1e-4, abs=1e-4 * np.abs(jacobian).max())


@pytest.mark.parametrize('slip', [0.02, 0.1, 0.3])
def test_slip_states_agree_with_the_model_of_the_controller(slip):
    # One wheel, M = r*F: a and b of `slip_dynamics`, which holds for changes.
    model = SlipLpvModel(RIG, Form.BEKKER_WONG)
    rim = 2.0
    v = (1 - slip) * rim
    point = model.at(v, [rim / 0.5], [SINKAGE], SOILS['paper_sand'])
    found = model.matrices(point.rho)
    stiffness = point.rho['slip_stiffness'][0]
    a, b = slip_dynamics(RIG.wheels[0], MASS, rim, stiffness, slip)
    assert found.A[1, 1] == pytest.approx(a, rel=1e-6)
    assert found.B[1, 0] == pytest.approx(b, rel=1e-12)
    assert found.A[0, 1] == pytest.approx(stiffness / MASS)


def test_inverse_slip_makes_the_papers_thrust_linear():
    # F = tau*(A - b*K/i): as a state 1/i has the constant slope -tau*b*K, and at 1/i = 0 all
    # strength is mobilised.
    model = InverseSlipLpvModel(RIG, Form.PAPER)
    soil = SOILS['paper_sand']
    area = 0.4 * np.sqrt(2 * 0.5 * SINKAGE - SINKAGE**2)
    pressure = soil.frictional_modulus * SINKAGE**soil.sinkage_exponent
    strength = soil.max_shear_stress(pressure)
    for slip in (0.1, 0.3, 0.8):
        point = model.at(1.0, wheel_speed(1.0, [slip], [0.5]), [SINKAGE], soil)
        assert point.u_uc[0] == pytest.approx(strength * area, rel=1e-6)
        assert model.matrices(point.rho).A[0, 1] == pytest.approx(
            -strength * 0.4 * soil.shear_deformation_modulus / 500, rel=1e-6
        )


# Controllability.


def in_equilibrium(model, form, soil, v, slip):
    """Operating point at which each wheel has sunk in as its static load asks."""
    of = model.vehicle
    omega = wheel_speed(v, np.full(model.n_wheels, slip), radii(of))
    sinkage = [
        equilibrium_sinkage(
            int(form), v, speed, load, soil.packed(wheel), wheel.radius, wheel.width
        )
        for speed, load, wheel in zip(omega, of.static_loads(), of.wheels, strict=True)
    ]
    return model.at(v, omega, sinkage, soil)


OPERATING_GRID = [
    (v, slip) for v in (0.1, 0.3, 1.0, 3.0, 10.0) for slip in (0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 0.9)
]


@ALL_FORMS
@pytest.mark.parametrize('state', ['slip', 'inverse_slip'])
@pytest.mark.parametrize('n', [1, 4, 8])
def test_slip_states_and_speed_are_controllable_on_the_whole_grid(n, state, form):
    model = MODELS[state](vehicle(n), form)
    for soil in (SOILS[name] for name in ('sandy_loam_15', 'snow_us', 'heavy_clay_25')):
        for v, slip in OPERATING_GRID:
            rho = in_equilibrium(model, form, soil, v, slip).rho
            # The rank that the structure has: torque reaches every slip, and slips reach v
            # unless no thrust changes with slip. `PAPER` has none below y = 1.
            reached = np.any(rho['slip_stiffness'] != 0)
            assert reached or (form == Form.PAPER and slip < 0.2)
            assert model.controllability_rank(rho) == n + (1 if reached else 0)
            if form != Form.PAPER:
                assert np.all(rho['slip_stiffness'] > 0)


@ALL_FORMS
@N_WHEELS
def test_in_speed_states_torque_does_not_reach_speed(n, form):
    model = SpeedLpvModel(vehicle(n), form)
    for v, slip in OPERATING_GRID:
        rho = in_equilibrium(model, form, SOILS['sandy_loam_15'], v, slip).rho
        assert model.controllability_rank(rho) == n
        found = model.matrices(rho)
        reach = control.ctrb(found.A, found.B)
        assert np.all(reach[0] == 0)


def test_coupled_wheels_leave_speed_controllable_by_slip():
    model = SlipLpvModel(TRACTOR, couplings=FOUR_WHEEL_DRIVE)
    soil = SOILS['sandy_loam_15']
    for v in (0.3, 1.0, 3.0):
        for slip in (0.05, 0.1, 0.3):
            free = wheel_speed(v, [slip] * 2, radii(TRACTOR)[list(model.independent)])
            rho = model.at(v, model.constraint @ free, [0.05] * 4, soil).rho
            assert model.controllability_rank(rho) == 3 == len(model.state_names)


def test_rank_whatever_the_units():
    # A chain of integrators with units that span 12 decades, and one state out of reach.
    A = np.diag([1e-6, 1e-6], k=-1) + np.diag([0.0, 0.0, -1.0])
    B = np.array([[1e6], [0.0], [0.0]])
    assert controllability_rank(A, B) == 3
    apart = np.zeros((4, 4))
    apart[:3, :3] = A
    apart[3, 3] = -5.0
    assert controllability_rank(apart, np.vstack([B, [[0.0]]])) == 3
    assert controllability_rank(A, np.zeros((3, 1))) == 0
    # Two equal lags in parallel from one input: only their sum is reached.
    assert controllability_rank(-np.eye(2), np.array([[1.0], [2.0]])) == 1


# Systems for others.


def test_combined_inputs():
    model = SpeedLpvModel(vehicle(2), Form.CONTACT)
    found = model.matrices(model.sample(1)[0])
    A, B, C, D = found.combined()
    assert A is found.A
    assert C is found.C
    u, u_uc = np.array([1.0, 2.0]), np.arange(5.0)
    assert B @ np.concatenate([u, u_uc]) == pytest.approx(found.B @ u + found.B_uc @ u_uc)
    assert D.shape == (3, 7)
    assert not D.any()


@pytest.mark.parametrize('state', ['speed', 'slip', 'inverse_slip'])
def test_python_control_takes_the_model(state):
    model = MODELS[state](vehicle(2), Form.CONTACT)
    rho = model.sample(1)[0]
    found = model.matrices(rho)
    system = model.to_control(rho)
    assert isinstance(system, control.StateSpace)
    assert np.array_equal(system.A, found.A)
    assert np.array_equal(system.B, found.B)
    assert system.state_labels == list(model.state_names)
    assert system.input_labels == list(model.input_names)
    everything = model.to_control(rho, combined=True)
    assert np.array_equal(everything.B, np.hstack([found.B, found.B_uc]))
    assert everything.input_labels == [*model.input_names, *model.uncontrolled_names]
    # Kalman filters of speed states see everything from the tachometers and the radar.
    assert np.linalg.matrix_rank(control.obsv(found.A, found.C)) == len(found.A)


def test_without_python_control_the_package_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, 'control', None)
    model = SpeedLpvModel(RIG)
    with pytest.raises(ImportError, match=r'pip install .traction_model\[control\]'):
        model.to_control(model.sample(1)[0])


def test_importing_the_package_leaves_costly_libraries_alone():
    done = subprocess.run(
        [sys.executable, '-c', 'import traction_model, sys; print(*sys.modules)'],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    loaded = set(done.stdout.split())
    assert 'traction_model.lpv.model' in loaded
    assert loaded.isdisjoint({'control', 'scipy.linalg', 'scipy.interpolate', 'matplotlib'})


# Faults.

FITTING = {'area': 0.1, 'mobilisation': 0.5, 'moment_mobilisation': 0.5, 'resistance_gradient': 1}


@pytest.mark.parametrize(
    ('fault', 'reason'),
    [
        ({'aera': 0.1}, "unknown scheduling parameter 'aera'; did you mean 'area'"),
        ({'area': [0.1, 0.1, 0.1]}, r'area must be one number or 2, got shape \(3,\)'),
        ({'area': [0.1, -0.1]}, r"area of wheel 'w1' is -0.1 m\^2, out of its range"),
        ({'mobilisation': 4}, "mobilisation of wheel 'w0' is 4, out of its range -3 to 3"),
        ({'area': float('nan')}, 'area must be finite'),
        ({'area': None}, "scheduling parameter 'area' .* is missing"),
    ],
)
def test_faulty_schedules_are_named(fault, reason):
    values = {**FITTING, **fault}
    values = {name: value for name, value in values.items() if value is not None}
    model = SpeedLpvModel(vehicle(2))
    with pytest.raises(ValueError, match=reason):
        model.schedule(**values)
    with pytest.raises(ValueError, match=reason):
        model.matrices(values)


def test_faulty_models_are_named():
    with pytest.raises(ValueError, match="unknown scheduling parameter 'load'"):
        SpeedLpvModel(RIG, ranges={'load': (0, 1)})
    for low, high in ((0.1, 0.05), (0.1, 5.0)):
        with pytest.raises(ValueError, match='range of area must increase and lie within'):
            SpeedLpvModel(RIG, ranges={'area': (low, high)})
    with pytest.raises(ValueError, match='no schedules to span a range'):
        SpeedLpvModel(RIG).narrowed([])
    with pytest.raises(KeyError, match="unknown scheduling parameter 'aera'"):
        SpeedLpvModel(RIG).sample(1)[0]['aera']


@pytest.mark.parametrize(
    ('fault', 'reason'),
    [
        ({'v': float('nan')}, 'v must be finite'),
        ({'holding_force': float('inf')}, 'holding_force must be finite'),
        ({'omega': [1.0]}, r'omega must have shape \(2,\), got \(1,\)'),
        ({'sinkage': [0.1, float('nan')]}, 'sinkage must be finite'),
        ({'load': [1.0]}, r'load must have shape \(2,\), got \(1,\)'),
        ({'load': [1.0, -1.0]}, 'load must be at least 0 N'),
        ({'sinkage': [0.1, 0.6]}, "sinkage of wheel 'w1' is 0.6 m, above its radius 0.5 m"),
        ({'soil': [SOILS['dry_sand']] * 3}, 'soil must be one or 2, got 3'),
        (
            {'soil': Soil(
                cohesive_modulus=0, frictional_modulus=1e6, sinkage_exponent=1, cohesion=0,
                friction_angle=0, shear_deformation_modulus=0.01,
            )},
            None,
        ),
    ],
)  # fmt: skip
def test_faulty_states_of_motion_are_named(fault, reason):
    state = {
        'v': 1.0, 'omega': [2.5, 2.5], 'sinkage': [0.05, 0.05], 'soil': SOILS['dry_sand'],
        **fault,
    }  # fmt: skip
    model = SpeedLpvModel(vehicle(2))
    if reason is None:
        # Soil without any strength shears without any force: nothing to schedule, all exact.
        assert np.all(model.at(**state).rho['mobilisation'] == 0)
        return
    with pytest.raises(ValueError, match=reason):
        model.at(**state)


def test_a_curve_is_asked_for():
    for state in ('speed', 'slip'):
        with pytest.raises(ValueError, match='form empirical needs soils with a traction_curve'):
            MODELS[state](RIG, Form.EMPIRICAL).at(1.0, [2.5], [0.05], PEAT)
    with pytest.raises(ValueError, match='form empirical needs soils with a traction_curve'):
        GridModel(SpeedLpvModel(RIG, Form.EMPIRICAL), PEAT, [0.1, 0.2], [0.01, 0.02], [1, 2])


def test_slip_states_know_their_limits():
    soil = SOILS['dry_sand']
    slow = SlipLpvModel(RIG)
    with pytest.raises(ValueError, match=r'speed is 0.01 m/s, out of its range 0.05 to 100'):
        slow.at(0.01, [0.1], [0.05], soil)
    with pytest.raises(ValueError, match=r'slip of wheel|slip is 1|slip.* out of its range'):
        slow.at(0.06, [50.0], [0.05], soil)
    rolling = InverseSlipLpvModel(RIG)
    with pytest.raises(ValueError, match='inverse_slip must be finite'):
        rolling.at(1.0, [2.0], [0.05], soil)
    # 1/i = rim/(rim - v) = 1.001/0.001.
    with pytest.raises(ValueError, match='inverse_slip is 1001, out of its range -100 to 100'):
        rolling.at(1.0, [2.002], [0.05], soil)
