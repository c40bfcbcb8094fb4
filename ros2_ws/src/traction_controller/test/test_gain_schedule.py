"""Gain schedule against an independent LQR solver, by its poles, and by its table."""

import control
import numpy as np
import pytest

from traction_controller.synthesis.gain_schedule import ControlWeights, GainSchedule, lqi_gains
from traction_model.lpv.slip_dynamics import slip_dynamics
from traction_model.vehicle.vehicle import GRAVITY, load_vehicle

REAR = load_vehicle('tractor_4wd').wheels[3]
LOAD = 13979.25  # N, see traction_model/test/test_vehicle.py
LAG, DT = 0.1, 0.01
WEIGHTS = ControlWeights(slip=0.05, integral_time=0.5, torque=0.3)


@pytest.fixture(scope='module')
def schedule():
    return GainSchedule(REAR, LOAD, 0.2, LAG, DT, WEIGHTS)


def plant(rim_speed, stiffness):
    """Sampled model of slip, shaft torque and integral of the slip error, SI units."""
    a, b = slip_dynamics(REAR, LOAD / GRAVITY, rim_speed, stiffness, 0.2)
    continuous = control.ss(
        [[a, b, 0], [0, -1 / LAG, 0], [-1, 0, 0]], [[0], [1 / LAG], [0]], np.eye(3), 0
    )
    sampled = continuous.sample(DT)
    return sampled.A, sampled.B


@pytest.mark.parametrize('rim_speed', [0.3, 1.5, 12.0])
@pytest.mark.parametrize('relative_stiffness', [0.2, 4.0, 50.0])
def test_gains_against_dlqr_in_si_units(rim_speed, relative_stiffness):
    # Cost (i/i_s)^2 + (z/(i_s*t_s))^2 + (u/u_s)^2 with i_s = 0.05, t_s = 0.5 s and
    # u_s = 0.3*load*r; dlqr's u = -K*x with x = [i, T, z], lqi_gains' u = -k0*i - k1*T + k2*z.
    stiffness = relative_stiffness * LOAD
    a, b = plant(rim_speed, stiffness)
    torque = 0.3 * LOAD * REAR.radius
    q = np.diag([1 / 0.05**2, 1e-9 / torque**2, 1 / (0.05 * 0.5) ** 2])
    expected = control.dlqr(a, b, q, [[1 / torque**2]])[0][0]
    model = slip_dynamics(REAR, LOAD / GRAVITY, rim_speed, stiffness, 0.2)
    found = lqi_gains(*model, LAG, DT, WEIGHTS, torque)
    assert found[0] == pytest.approx(expected[0], rel=1e-4, abs=1e-3 * torque)
    assert found[1] == pytest.approx(expected[1], rel=1e-4, abs=1e-6)
    assert found[2] == pytest.approx(-expected[2], rel=1e-4)


def test_gains_have_the_least_cost():
    # Any other gains cost more, summed up over 20 s from a slip of 0.1.
    a, b = plant(1.5, 4 * LOAD)
    torque = 0.3 * LOAD * REAR.radius
    model = slip_dynamics(REAR, LOAD / GRAVITY, 1.5, 4 * LOAD, 0.2)
    best = lqi_gains(*model, LAG, DT, WEIGHTS, torque) * [1, 1, -1]

    def cost(gains):
        x, total = np.array([0.1, 0.0, 0.0]), 0.0
        for _ in range(2000):
            u = -gains @ x
            total += (x[0] / 0.05) ** 2 + (x[2] / 0.025) ** 2 + (u / torque) ** 2
            x = a @ x + b[:, 0] * u
        return total

    least = cost(best)
    for entry in range(3):
        for factor in (0.9, 1.1):
            other = best.copy()
            other[entry] *= factor
            assert cost(other) > least


def spectral_radius(gains, rim_speed, stiffness):
    a, b = plant(rim_speed, stiffness)
    slip_gain, torque_gain, integral_gain = gains
    closed = a - b @ np.array([[slip_gain, torque_gain, -integral_gain]])
    return np.max(np.abs(np.linalg.eigvals(closed)))


def test_closed_loop_is_stable_at_every_grid_point(schedule):
    for p, rim_speed in enumerate(schedule.rim_speeds):
        for q, stiffness in enumerate(schedule.stiffnesses):
            assert spectral_radius(schedule.gains[p, q], rim_speed, stiffness) < 1.0


def test_closed_loop_is_stable_between_grid_points(schedule):
    random = np.random.default_rng(1)
    for _ in range(300):
        rim_speed = np.exp(random.uniform(np.log(0.3), np.log(12.0)))
        stiffness = LOAD * np.exp(random.uniform(np.log(0.2), np.log(50.0)))
        gains = schedule.at(rim_speed, stiffness)
        assert spectral_radius(gains, rim_speed, stiffness) < 1.0


def test_closed_loop_bears_a_stiffness_misjudged_threefold(schedule):
    for rim_speed in (0.5, 1.5, 5.0):
        for stiffness in LOAD * np.array([1.0, 4.0, 15.0]):
            for factor in (1 / 3, 3.0):
                gains = schedule.at(rim_speed, factor * stiffness)
                assert spectral_radius(gains, rim_speed, stiffness) < 1.0


def test_grid_points_are_met_exactly(schedule):
    for p, rim_speed in enumerate(schedule.rim_speeds):
        for q, stiffness in enumerate(schedule.stiffnesses):
            assert schedule.at(rim_speed, stiffness) == pytest.approx(
                schedule.gains[p, q], rel=1e-9
            )


def test_linear_over_logarithms_between(schedule):
    # At the geometric mean of four corners, their mean.
    v = np.sqrt(schedule.rim_speeds[2] * schedule.rim_speeds[3])
    c = np.sqrt(schedule.stiffnesses[5] * schedule.stiffnesses[6])
    expected = schedule.gains[2:4, 5:7].mean(axis=(0, 1))
    assert schedule.at(v, c) == pytest.approx(expected)
    assert schedule.at(-v, c) == schedule.at(v, c)


@pytest.mark.parametrize(
    ('rim_speed', 'relative_stiffness', 'corner'),
    [
        (0.0, 0.0, (0, 0)),
        (0.1, 1e6, (0, -1)),
        (100.0, 0.01, (-1, 0)),
        (1e9, 1e9, (-1, -1)),
    ],
)
def test_clamped_outside(schedule, rim_speed, relative_stiffness, corner):
    found = schedule.at(rim_speed, relative_stiffness * LOAD)
    assert found == pytest.approx(schedule.gains[corner])


@pytest.mark.parametrize('fault', ['slip', 'integral_time', 'torque'])
@pytest.mark.parametrize('value', [0.0, -1.0, float('nan'), float('inf')])
def test_weights_refuse(fault, value):
    with pytest.raises(ValueError, match=f'weight {fault} must be above 0, got'):
        ControlWeights(**{fault: value})


@pytest.mark.parametrize('fault', ['load', 'lag', 'dt'])
def test_schedule_refuses(fault):
    arguments = {'load': LOAD, 'lag': LAG, 'dt': DT, fault: 0.0}
    with pytest.raises(ValueError, match=f'{fault} must be above 0, got 0.0'):
        GainSchedule(REAR, slip=0.2, **arguments)
