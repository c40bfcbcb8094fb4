"""Closed loop: delays, noise from one seed, copies, the perfect estimator."""

import copy
import math

import numpy as np
import pytest

from traction_evaluation.closed_loop.closed_loop import DT, ClosedLoop, Drive, Sensors
from traction_evaluation.closed_loop.controllers import fixed_pi
from traction_evaluation.closed_loop.perfect_estimator import PerfectEstimator
from traction_evaluation.closed_loop.scenario import SCENARIOS, run_scenario
from traction_model.contact.contact import shear_deficit
from traction_model.simulation.drawbar import Drawbar
from traction_model.simulation.plant import Plant
from traction_model.simulation.sensors import RadarModel
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import load_vehicle

RIG = load_vehicle('single_wheel_rig')
TRACTOR = load_vehicle('tractor_4wd')
SAND = load_soil('paper_sand')
LOAM = load_soil('sandy_loam_chrono')
REQUEST = (1500.0, 1500.0, 5000.0, 5000.0)
NOISY = Sensors(500.0, RadarModel(0.05, latency=0.05), torque_noise=0.01)


def plant():
    """The tractor on loam, pulling, on the move."""
    return Plant(
        TRACTOR, LOAM, drawbar=Drawbar(0.0, 6000.0, 1.0), torque_time_constant=0.2, v0=2.0
    )


def loop(seed=1, control=True, perfect=False, sensors=NOISY):
    """Closed loop of the tractor, holding slip with a PI."""
    made = ClosedLoop(
        plant(), fixed_pi(0.8, 2.4).loop(0.0) if control else None, sensors, seed, perfect=perfect
    )
    if control:
        made.set_target(0.15)
    return made


def driven(each, seconds, request=REQUEST):
    for _ in range(round(seconds / DT)):
        each.step(request)
    return each.drive()


def same(first, second):
    return all(
        np.array_equal(getattr(first, name), getattr(second, name), equal_nan=True)
        for name in Drive.__dataclass_fields__
    )


def test_all_follows_from_the_seed():
    first, again, other = (driven(loop(seed), 1.0) for seed in (1, 1, 2))
    assert same(first, again)
    assert not np.array_equal(first.slip_estimate, other.slip_estimate)


def test_copy_goes_on_with_the_same_noise():
    one = loop()
    driven(one, 0.5)
    two = copy.deepcopy(one)
    assert same(driven(one, 0.5), driven(two, 0.5))
    # And it is independent: changes of the copy do not affect the first.
    before = one.drive()
    two.set_target(0.3)
    driven(two, 0.5)
    assert same(one.drive(), before)


@pytest.mark.parametrize(('delay', 'periods'), [(0.0, 0), (0.02, 2), (0.05, 5)])
def test_torque_arrives_after_the_delay(delay, periods):
    # No lag: shaft torque is the torque sent `periods` samples ago, and 0 before.
    rig = Plant(RIG, SAND, v0=2.0)
    each = ClosedLoop(rig, None, Sensors(), 1, delay=delay)
    shafts = []
    for k in range(8):
        each.step([100.0 * (k + 1)])
        shafts.append(float(rig.shaft_torque[0]))
    assert shafts == [100.0 * max(0, k + 1 - periods) for k in range(8)]


def test_without_control_wheels_get_what_is_asked_for():
    drive = driven(loop(control=False), 0.3)
    assert np.all(drive.command == REQUEST)
    assert np.all(np.isnan(drive.target))


def test_control_holds_true_slip_at_the_target():
    drive = driven(loop(perfect=True), 7.0)
    assert np.array_equal(drive.slip_estimate, drive.slip)
    assert np.abs(drive.slip[drive.t > 6.0] - 0.15).max() < 0.02
    assert np.all(drive.target == 0.15)


def test_estimate_is_near_the_truth_with_good_sensors():
    drive = driven(loop(sensors=Sensors(0.0, RadarModel(0.01))), 4.0)
    late = drive.t > 2.0
    assert np.sqrt(np.mean((drive.slip_estimate - drive.slip)[late] ** 2)) < 0.02


def test_true_stiffness_is_the_slope_of_the_thrust_curve():
    tractor = plant()
    tractor.step([2000.0, 2000.0, 6000.0, 6000.0], 1.0)
    truth = PerfectEstimator(tractor)
    assert truth.slip.tolist() == tractor.slip
    for j, wheel in enumerate(TRACTOR.wheels):
        length = wheel.radius * math.acos(1 - tractor.sinkage[j] / wheel.radius)

        def thrust(slip, j=j, length=length, width=wheel.width):
            # tau_max*A*(1 - kappa), equation (19).
            y = abs(slip) * length / LOAM.shear_deformation_modulus
            return tractor.max_shear_stress[j] * width * length * (1 - shear_deficit(y))

        slope = (thrust(tractor.slip[j] + 1e-6) - thrust(tractor.slip[j] - 1e-6)) / 2e-6
        assert truth.slip_stiffness[j] == pytest.approx(slope, rel=1e-4)
    # On a wheel in steady motion the soil turns against the shaft with its torque.
    assert truth.gross_traction[2] * 0.85 == pytest.approx(tractor.soil_moment[2])


def test_work_and_energy_by_hand():
    # 100 N at 2 m/s for 1 s, of which the second half counts: 100 J, from 150 W: 75 J.
    k = np.ones(100)
    drive = Drive(
        t=DT * np.arange(100.0), v=2 * k, x=k, v_estimate=k, net_traction=100 * k,
        shaft_power=150 * k, target=k, rim_speed=k[:, None], slip=k[:, None],
        slip_estimate=k[:, None], command=k[:, None],
    )  # fmt: skip
    assert drive.efficiency(0.5 - DT / 2) == pytest.approx((100.0, 75.0))


@pytest.mark.parametrize(
    ('fault', 'reason'),
    [
        ({'torque_noise': -0.1}, 'torque_noise must be at least 0, got -0.1'),
        ({'torque_noise': math.nan}, 'torque_noise must be at least 0, got nan'),
        ({'radar_period': 0.0}, 'radar_period must be above 0 s, got 0.0'),
    ],
)
def test_what_sensors_refuse(fault, reason):
    with pytest.raises(ValueError, match=reason):
        Sensors(**fault)


@pytest.mark.parametrize('delay', [-0.01, math.nan])
def test_what_a_loop_refuses(delay):
    with pytest.raises(ValueError, match='delay must be'):
        ClosedLoop(Plant(RIG, SAND), None, Sensors(), 1, delay=delay)


def test_scenarios_do_what_they_say():
    drives = {name: run_scenario(name, TRACTOR, None) for name in SCENARIOS}
    for name, drive in drives.items():
        happens = SCENARIOS[name].happens
        assert drive.t[-1] == pytest.approx(SCENARIOS[name].duration - DT)
        # Equal until the disturbance, except for the request, which is always too large.
        if name != 'torque_steps':
            before = drive.t < happens
            assert np.array_equal(drive.v[before], drives['slope'].v[: before.sum()])
            assert drive.slip[-1].min() > 0.5
    split = drives['split_soil']
    late = split.t > 4.0
    assert np.all(split.slip[late, 2] > split.slip[late, 3])
    assert drives['slope'].slip[:, 0] == pytest.approx(drives['slope'].slip[:, 1], abs=1e-9)
    # 10 degrees uphill take 9.81*sin(10 degrees) = 1.70 m/s^2 off.
    slowed = np.diff(drives['slope'].v)[round(3.5 / DT)] / DT
    level = np.diff(drives['split_soil'].v)[round(2.9 / DT)] / DT
    assert level - slowed > 1.0
    with pytest.raises(ValueError, match="unknown scenario 'sope'"):
        run_scenario('sope', TRACTOR, None)
