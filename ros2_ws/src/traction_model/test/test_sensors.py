"""Sensor models: what a real tachometer and radar do to the truth."""

import math

import numpy as np
import pytest

from traction_model.simulation.sensors import Radar, RadarModel, Tachometer


def test_tachometer_counts_pulses():
    # 100 pulses a turn, 10 ms: steps of 2*pi/(100*0.01) = 6.283 rad/s. At 10 rad/s,
    # 10*100/(2*pi) = 159.2 pulses a second come, so 1 or 2 in 10 ms.
    tachometer = Tachometer(1, 100)
    readings = [tachometer.read([10.0], 0.01)[0] for _ in range(1000)]
    step = 2 * math.pi
    assert {round(reading / step) for reading in readings} == {1, 2}
    # What a period misses the next one has: over 10 s at most one pulse is missing.
    assert np.mean(readings) == pytest.approx(10.0, abs=step / 1000)


def test_tachometer_averages_out_for_every_wheel_and_backward():
    tachometer = Tachometer(2, 60)
    t = np.arange(0, 10, 0.01)
    truth = np.column_stack([5 + 3 * np.sin(t), -2 - np.cos(2 * t)])
    error = np.array([tachometer.read(row, 0.01) for row in truth]) - truth
    # Summed errors never exceed one pulse: 2*pi/60 rad, of which 10 ms make 10.5 rad/s.
    assert np.all(np.abs(np.cumsum(error, axis=0)) * 0.01 <= 2 * math.pi / 60 + 1e-9)


def test_ideal_tachometer_gives_the_truth():
    truth = np.array([1.23456, -7.0])
    reading = Tachometer(2, 0).read(truth, 0.01)
    assert np.array_equal(reading, truth)
    reading[0] = 9.0
    assert truth[0] == 1.23456


@pytest.mark.parametrize('pulses', [-1, math.nan, math.inf])
def test_tachometer_refuses(pulses):
    with pytest.raises(ValueError, match='pulses_per_turn must be at least 0'):
        Tachometer(1, pulses)


def errors(radar, speed=3.0, count=4000):
    for k in range(count):
        radar.measure(0.1 * k, speed)
    return np.array([value - speed for _, value in radar.deliver(0.1 * count)])


def test_radar_noise():
    found = errors(Radar(RadarModel(noise=0.05), seed=1))
    # 4000 readings: the mean within 4*0.05/sqrt(4000) = 0.0032, the deviation within
    # 4*0.05/sqrt(2*4000) = 0.0022.
    assert len(found) == 4000
    assert np.mean(found) == pytest.approx(0.0, abs=0.0032)
    assert np.std(found) == pytest.approx(0.05, abs=0.0022)
    # White: neighbours correlate by less than 4/sqrt(4000).
    assert abs(np.corrcoef(found[1:], found[:-1])[0, 1]) < 0.064


def test_radar_bias_is_an_error_of_scale():
    found = errors(Radar(RadarModel(noise=0.0, bias=-0.02), seed=1), speed=5.0, count=3)
    assert found == pytest.approx([-0.1] * 3)


def test_radar_is_blind_when_slow():
    radar = Radar(RadarModel(noise=0.0, min_speed=0.2), seed=1)
    radar.measure(0.0, 0.19)
    assert radar.deliver(0.0) == []
    radar.measure(0.1, -0.2)
    assert radar.deliver(0.1) == [(0.1, -0.2)]


def test_radar_latency_does_not_wait_for_the_next_measurement():
    # Measured every 50 ms, asked every 10 ms: each reading comes 30 ms after it was measured.
    radar = Radar(RadarModel(noise=0.0, latency=0.03), seed=1)
    delivered = {}
    for k in range(12):
        if k % 5 == 0:
            radar.measure(0.01 * k, 1.0 + k)
        delivered[k] = radar.deliver(0.01 * k)
    assert [k for k in delivered if delivered[k]] == [3, 8]
    assert delivered[3] == [(0.0, 1.0)]
    assert delivered[8] == [(pytest.approx(0.05), 6.0)]


def test_radar_latency_beyond_its_period():
    # Measured at 0, 0.1, 0.2 s; due 0.25 s later, so at 0.25, 0.35, 0.45 s, in that order.
    radar = Radar(RadarModel(noise=0.0, latency=0.25), seed=1)
    for k in range(3):
        radar.measure(0.1 * k, 1.0 + k)
    assert radar.deliver(0.24) == []
    assert [speed for _, speed in radar.deliver(0.36)] == [1.0, 2.0]
    assert [speed for _, speed in radar.deliver(0.45)] == [3.0]


def test_radar_repeats_itself_with_its_seed():
    def run(seed):
        return errors(Radar(RadarModel(), seed), count=50).tolist()

    assert run(7) == run(7)
    assert run(7) != run(8)


def test_radar_noise_does_not_depend_on_what_it_saw():
    # Blind or not, reading number k has the same noise: runs stay comparable.
    radar, blind = Radar(RadarModel(), 3), Radar(RadarModel(), 3)
    for k in range(5):
        radar.measure(0.1 * k, 2.0)
        blind.measure(0.1 * k, 2.0 if k == 4 else 0.0)
    assert blind.deliver(0.4) == radar.deliver(0.4)[4:]


@pytest.mark.parametrize(
    ('fault', 'reason'),
    [
        ({'noise': -0.1}, 'radar noise must be at least 0, got -0.1'),
        ({'noise': math.nan}, 'radar noise must be at least 0, got nan'),
        ({'bias': -1.5}, 'radar bias must be at least -1, got -1.5'),
        ({'min_speed': -1}, 'radar min_speed must be at least 0'),
        ({'latency': math.inf}, 'radar latency must be at least 0, got inf'),
    ],
)
def test_radar_refuses(fault, reason):
    with pytest.raises(ValueError, match=reason):
        RadarModel(**fault)
