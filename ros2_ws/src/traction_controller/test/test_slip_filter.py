"""The slip filter: sources, wild and late readings, latency, standstill, radii, bad input."""

import copy
import math

import numpy as np
import pytest

from traction_controller.estimation.slip_filter import (
    EstimatorNoise,
    SlipFilter,
    Source,
)
from traction_model.slip import slip
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import load_vehicle


def test_soil_parameters_come_with_their_variances():
    estimation = fresh()
    assert np.isnan(estimation.sinkage).all()
    # At rest on the nominal soil: K = 0.01 m, its logarithm unknown by 0.1*0.6.
    assert estimation.shear_deformation_modulus == pytest.approx([0.01])
    assert estimation.shear_deformation_modulus_variance == pytest.approx([(0.01 * 0.06) ** 2])
    moving = driving(2.0)
    assert 0.1 < moving.sinkage[0] < 0.3
    assert 0 < moving.sinkage_variance[0] < 0.01


def test_source_follows_the_radar():
    estimation = fresh()
    assert estimation.source is Source.WHEEL
    estimation.wheel_states(0.0, [2.0], [500.0])
    estimation.radar(0.0, 0.9, 0.0025)
    assert estimation.source is Source.BLENDED
    for k in range(1, 61):
        estimation.wheel_states(0.01 * k, [2.0], [500.0])
    # radar_timeout is 0.5 s.
    assert estimation.source is Source.WHEEL


def fresh():
    return SlipFilter(load_vehicle('single_wheel_rig'), load_soil('paper_sand'))


def driving(seconds=1.0):
    """At 1 m/s of rim and 0.9 m/s over ground."""
    estimation = fresh()
    for k in range(round(100 * seconds)):
        estimation.wheel_states(0.01 * k, [2.0], [800.0])
        if k % 10 == 0:
            estimation.radar(0.01 * k, 0.9, 0.0025)
    return estimation


def snapshot(estimation):
    return (
        estimation.t, estimation.v, estimation.v_variance, estimation.external_resistance,
        estimation.slip.tolist(), estimation.slip_variance.tolist(), estimation.valid.tolist(),
        estimation.gross_traction.tolist(), estimation.max_shear_stress.tolist(),
        estimation.source,
    )  # fmt: skip


@pytest.mark.parametrize(
    ('bad', 'reason'),
    [
        (lambda e: e.wheel_states(1.0, [math.nan], [1.0]), "wheel speed of wheel 'wheel' is nan"),
        (lambda e: e.wheel_states(1.0, [1.0], [math.inf]), "shaft torque of wheel 'wheel' is inf"),
        (lambda e: e.wheel_states(1.0, [1.0, 2.0], [1.0]),
         'expected a wheel speed for each of 1 wheels, got 2'),
        (lambda e: e.wheel_states(1.0, [1.0], []), 'a shaft torque for each of 1 wheels, got 0'),
        (lambda e: e.wheel_states(0.3, [1.0], [1.0]), 'time runs backwards: 0.300000 s after 0'),
        (lambda e: e.wheel_states(math.nan, [1.0], [1.0]), 'of measurement is not finite: nan'),
        (lambda e: e.radar(1.0, math.nan, 0.01), 'radar reading nan m/s with variance 0.01'),
        (lambda e: e.radar(1.0, 0.9, -0.1), 'with variance -0.1 m\\^2/s\\^2 is not usable'),
        (lambda e: e.radar(1.0, 0.9, math.inf), 'variance inf'),
        (lambda e: e.radar(math.nan, 0.9, 0.01), 'time of measurement is not finite: nan'),
    ],
)  # fmt: skip
def test_bad_reading_is_named_and_nothing_taken_in(bad, reason):
    estimation = driving()
    before = snapshot(estimation)
    with pytest.raises(ValueError, match=reason):
        bad(estimation)
    assert snapshot(estimation) == before
    # And it continues without a trace of it.
    other = driving()
    for e in (estimation, other):
        e.wheel_states(1.0, [2.0], [800.0])
    assert snapshot(estimation) == snapshot(other)


def test_a_radar_that_jumps_is_not_believed():
    estimation = driving(2.0)
    for k in range(200, 500):
        t = 0.01 * k
        estimation.wheel_states(t, [2.0], [800.0])
        if k % 10 == 0:
            # From 0.9 to 5 m/s in 0.1 s, at a rim of 1 m/s.
            assert not estimation.radar(t, 5.0, 0.0025)
    assert estimation.v == pytest.approx(0.9, abs=0.3)
    # Back where it was, and trusted at once.
    estimation.wheel_states(5.0, [2.0], [800.0])
    assert estimation.radar(5.0, 0.9, 0.0025)


def test_a_radar_that_departs_slowly_shows_an_error_of_the_model():
    estimation = driving(2.0)
    for k in range(200, 500):
        t = 0.01 * k
        estimation.wheel_states(t, [2.0], [800.0])
        if k % 10 == 0:
            # Down by 0.3 m/s within a second: the soil gives way.
            speed = 0.9 - 0.3 * min(1.0, t - 2.0)
            estimation.radar(t, speed, 0.0025)
    assert estimation.v == pytest.approx(0.6, abs=0.05)


def test_stamps_must_advance():
    estimation = driving(2.0)
    for _ in range(1000):
        with pytest.raises(ValueError, match=r'stamp does not advance: 1\.990000 s again'):
            estimation.wheel_states(1.99, [2.0], [800.0])
    estimation.radar(1.99, 0.9, 0.0025)
    with pytest.raises(ValueError, match=r'stamp of radar does not advance: 1\.990000 s again'):
        estimation.radar(1.99, 0.9, 0.0025)
    # Nothing of it is kept: a second of readings at 100 Hz.
    assert len(estimation._readings) <= 102


def test_one_wild_reading_changes_nothing():
    estimation = driving(2.0)
    v = estimation.v
    assert not estimation.radar(1.98, 9.0, 0.0025)
    assert estimation.v == v
    assert estimation.radar(1.99, v, 0.0025)


def test_wild_readings_that_do_not_agree_are_never_believed():
    estimation = driving(2.0)
    for k in range(200, 300):
        estimation.wheel_states(0.01 * k, [2.0], [800.0])
        if k % 10 == 0:
            # 6 m/s apart: more than five deviations of 0.07 m/s and 5 m/s^2 for 0.1 s.
            assert not estimation.radar(0.01 * k, 5.0 if k % 20 else 11.0, 0.0025)
    assert estimation.v == pytest.approx(0.9, abs=0.2)


def test_latency_is_taken_off_the_stamp():
    timely = driving(1.0)
    late = SlipFilter(load_vehicle('single_wheel_rig'), load_soil('paper_sand'), radar_latency=0.1)
    gnss = SlipFilter(load_vehicle('single_wheel_rig'), load_soil('paper_sand'), gnss_latency=0.1)
    for k in range(100):
        for estimation, sensor in ((late, late.radar), (gnss, gnss.gnss)):
            estimation.wheel_states(0.01 * k, [2.0], [800.0])
            if k % 10 == 0 and k >= 10:
                # Delivered and stamped 100 ms after `driving` measured it.
                assert sensor(0.01 * k, 0.9, 0.0025)
    # That of 0.9 s is yet to come.
    assert late.radar(1.0, 0.9, 0.0025)
    assert gnss.gnss(1.0, 0.9, 0.0025)
    for estimation in (late, gnss):
        assert estimation.v == pytest.approx(timely.v, abs=1e-6)
        assert estimation.v_variance == pytest.approx(timely.v_variance, rel=1e-6)


def test_blind_radar_reads_nothing():
    estimation = SlipFilter(
        load_vehicle('single_wheel_rig'), load_soil('paper_sand'), radar_min_speed=0.5
    )
    for k in range(100):
        estimation.wheel_states(0.01 * k, [2.0], [800.0])
        before = snapshot(estimation)
        # Zero below its least speed: not a standing vehicle.
        assert not estimation.radar(0.01 * k, 0.0, 0.0025)
        assert snapshot(estimation) == before
    assert estimation.source is Source.WHEEL
    assert estimation.radar(0.99, 0.9, 0.0025)
    assert estimation.source is Source.BLENDED


def test_radar_of_another_clock_is_refused_and_a_radar_alone_is_not_used():
    estimation = driving(1.0)
    with pytest.raises(ValueError, match=r'\+0\.610 s off the wheels in time'):
        estimation.radar(1.6, 0.9, 0.0025)
    # 20 ms ahead is a common clock offset: accepted, without effect on the wheels.
    assert estimation.radar(1.01, 0.9, 0.0025)
    estimation.wheel_states(1.0, [2.0], [800.0])
    alone = fresh()
    assert not alone.radar(0.0, 3.0, 0.0025)
    assert alone.t is None


def test_radar_that_states_no_variance_gets_the_nominal_one():
    stated, silent = driving(1.0), driving(1.0)
    stated.radar(1.0, 0.95, stated.radar_variance)
    silent.radar(1.0, 0.95, 0.0)
    assert snapshot(stated) == snapshot(silent)


@pytest.mark.parametrize('rate', [20.0, 50.0, 100.0])
def test_torque_that_only_spins_the_wheel_up_is_no_thrust(rate):
    # T = J*omega' with omega' = 3 rad/s^2, J = 20 kg*m^2: 60 N·m, nothing left for the soil.
    estimation = fresh()
    for k in range(40):
        estimation.wheel_states(k / rate, [3.0 * k / rate], [60.0])
    # Left over of the first reading, which knows no acceleration: 60/0.5 N, fading out with
    # the filter's 40 ms.
    assert estimation.gross_traction[0] == pytest.approx(
        120.0 * math.exp(-39 / rate / 0.04), abs=1e-6
    )


def tractor_at(speed):
    """A tractor rolling at a speed for 2 s, its radar at 20 Hz."""
    estimation = SlipFilter(load_vehicle('tractor_4wd'), load_soil('sandy_loam_chrono'))
    rolling = [speed / wheel.radius for wheel in estimation.vehicle.wheels]
    for k in range(200):
        estimation.wheel_states(0.01 * k, rolling, [0.0] * 4)
        if k % 5 == 0:
            estimation.radar(0.01 * k, speed, 0.0025)
    return estimation, rolling


def test_locked_wheels_are_not_taken_for_standstill():
    estimation, _ = tractor_at(3.8)
    for k in range(200, 300):
        # Sliding on at 3.8 m/s, on brakes.
        estimation.wheel_states(0.01 * k, [0.0] * 4, [-4000.0] * 4)
        if k % 5 == 0:
            estimation.radar(0.01 * k, 3.8, 0.0025)
    assert estimation.v == pytest.approx(3.8, abs=0.3)
    assert estimation.slip.tolist() == [-1.0] * 4
    assert all(estimation.valid)


def test_one_dead_tachometer_does_not_stop_the_others():
    estimation, rolling = tractor_at(3.0)
    for k in range(200, 300):
        estimation.wheel_states(0.01 * k, [0.0, *rolling[1:]], [0.0] * 4)
        if k % 5 == 0:
            estimation.radar(0.01 * k, 3.0, 0.0025)
    assert estimation.v == pytest.approx(3.0, abs=0.1)
    assert np.abs(estimation.slip[1:]).max() < 0.05


def test_after_a_gap_nothing_is_known():
    estimation = driving(2.0)
    estimation.wheel_states(3600.0, [2.0], [800.0])
    other = fresh()
    other.wheel_states(3600.0, [2.0], [800.0])
    assert snapshot(estimation) == snapshot(other)


def test_estimation_that_starts_on_slipping_wheels_believes_the_radar():
    # 46 m/s of rim at 30 % slip, as wheel_low_slip after a second: 14 m/s off rolling.
    estimation = fresh()
    estimation.wheel_states(0.0, [92.0], [1570.0])
    assert estimation.radar(0.0, 32.2, 0.0025)
    assert estimation.v == pytest.approx(32.2, abs=0.1)


def test_standstill_is_known_and_not_valid():
    estimation = fresh()
    for k in range(100):
        estimation.wheel_states(0.01 * k, [0.0], [0.0])
    assert estimation.v == pytest.approx(0.0, abs=1e-9)
    assert estimation.valid.tolist() == [False]
    assert estimation.slip.tolist() == [0.0]
    # (0.02 m/s)^2 per reading and the walk in between: far below 0.5 m/s.
    assert math.sqrt(estimation.v_variance) < 0.05
    assert estimation.v_valid


def test_reset_restores_the_initial_state():
    estimation = driving(2.0)
    estimation.reset()
    assert snapshot(estimation) == snapshot(fresh())


@pytest.mark.parametrize('fault', ['acceleration', 'speed', 'soil', 'strength', 'nominal', 'slip'])
def test_noise_refuses(fault):
    with pytest.raises(ValueError, match=f'noise {fault} must be above 0, got -1.0'):
        EstimatorNoise(**{fault: -1.0})


@pytest.mark.parametrize('fault', ['min_speed', 'radar_timeout'])
def test_estimation_refuses(fault):
    with pytest.raises(ValueError, match=f'{fault} must be above 0, got 0.0'):
        SlipFilter(load_vehicle('single_wheel_rig'), load_soil('paper_sand'), **{fault: 0.0})


@pytest.mark.parametrize(
    ('fault', 'value'),
    [('radar_latency', 0.6), ('gnss_latency', math.nan), ('radar_min_speed', -0.1)],
)
def test_estimation_refuses_what_sensors_cannot_be(fault, value):
    with pytest.raises(ValueError, match=f'{fault} must be 0 to'):
        SlipFilter(load_vehicle('single_wheel_rig'), load_soil('paper_sand'), **{fault: value})


def test_other_rolling_radius_moves_rim_slip_and_thrust():
    estimation = driving(2.0)
    other = copy.deepcopy(estimation)
    [omega] = estimation.rim_speed / 0.5
    moment = 0.5 * estimation.gross_traction
    other.set_rolling_radius([0.49])
    assert other.rolling_radius.tolist() == [0.49]
    assert other.rim_speed == pytest.approx([0.49 * omega])
    assert other.slip == pytest.approx([slip(other.v, 0.49 * omega)])
    assert other.gross_traction == pytest.approx(moment / 0.49)
    # A change of 2 % resets the soil factors.
    assert other.max_shear_stress_variance > estimation.max_shear_stress_variance
    # A copy's radius is its own, and stays over a reset.
    assert estimation.rolling_radius.tolist() == [0.5]
    other.reset()
    assert other.rolling_radius.tolist() == [0.49]
    near = copy.deepcopy(estimation)
    near.set_rolling_radius([0.498])
    assert near.max_shear_stress.tolist() == estimation.max_shear_stress.tolist()
    assert near.max_shear_stress_variance == pytest.approx(estimation.max_shear_stress_variance)


@pytest.mark.parametrize(
    ('radius', 'reason'),
    [
        ([0.0], r'rolling radius must be above 0 m, got \[0.0\]'),
        ([math.nan], "rolling radius of wheel 'wheel' is nan"),
        ([0.5, 0.5], 'expected a rolling radius for each of 1 wheels, got 2'),
    ],
)
def test_rolling_radius_refuses(radius, reason):
    estimation = driving(1.0)
    before = snapshot(estimation)
    with pytest.raises(ValueError, match=reason):
        estimation.set_rolling_radius(radius)
    assert snapshot(estimation) == before
    assert estimation.rolling_radius.tolist() == [0.5]


def test_mobilisation_is_thrust_over_strength():
    estimation = driving(2.0)
    assert estimation.strength_known.all()
    # Strength is tau_max over the contact area b*l, l = r*acos(1 - z/r), with the sinkage z at
    # which the nominal soil carries the wheel at rest: mean pressure W/(b*l) gives it back.
    soil = load_soil('paper_sand')
    [load] = load_vehicle('single_wheel_rig').static_loads()
    stress = float(SlipFilter(load_vehicle('single_wheel_rig'), soil).max_shear_stress[0])
    area = load * math.tan(soil.friction_angle) / (stress - soil.cohesion)
    strength = float(estimation.max_shear_stress[0]) * area
    assert estimation.mobilisation == pytest.approx(float(estimation.gross_traction[0]) / strength)
    assert 0.0 < estimation.mobilisation < 1.0
