"""Steps of tachometers found from readings: counts, decimals, jitter; readings without steps."""

import math

import numpy as np
import pytest

from traction_controller.estimation.tachometer import Tachometers

DT = 0.01


class Counter:
    """A wheel that speeds up by 1 rad/s^2 to 4 rad/s, and the pulses that come of it."""

    def __init__(self, pulses, start=0.0):
        self.pulse = 2.0 * math.pi / pulses
        self.omega = start
        self.angle = 0.0
        self.counted = 0

    def read(self, dt=DT):
        """Pulses since the last reading over their time, rad/s."""
        self.omega = min(self.omega + dt, 4.0)
        self.angle += self.omega * dt
        before, self.counted = self.counted, math.floor(self.angle / self.pulse)
        return (self.counted - before) * self.pulse / dt


def follow(tachometers, readings, dt=DT):
    for k, reading in enumerate(readings, 1):
        tachometers.update(k * dt, np.array([reading]))
    return tachometers


@pytest.mark.parametrize('start', [0.0, 3.0])
@pytest.mark.parametrize('pulses', [60, 200, 400, 1000, 4000])
def test_pulses_are_found_from_counts(pulses, start):
    counter = Counter(pulses, start)
    found = follow(Tachometers(1), [counter.read() for _ in range(300)])
    assert found.pulses_per_turn == pytest.approx(pulses, rel=1e-9)
    assert found.step[0] == pytest.approx(2.0 * math.pi / (pulses * DT))
    assert found.pulse[0] == pytest.approx(2.0 * math.pi / pulses)


@pytest.mark.parametrize(
    ('pulses', 'period'),
    # Slow telemetry, too: at 1 Hz a step of 60 pulses is 0.1 rad/s.
    [(60, 0.02), (100, 0.1), (60, 1.0)],
)
def test_other_periods(pulses, period):
    counter = Counter(pulses)
    found = follow(Tachometers(1), [counter.read(period) for _ in range(200)], period)
    assert found.pulses_per_turn == pytest.approx(pulses, rel=1e-9)


def test_three_decimals_and_single_precision():
    counter = Counter(400)
    readings = [counter.read() for _ in range(300)]
    found = follow(Tachometers(1), [round(reading, 3) for reading in readings])
    assert found.pulses_per_turn == pytest.approx(400, rel=1e-3)
    found = follow(Tachometers(1), [float(np.float32(reading)) for reading in readings])
    assert found.pulses_per_turn == pytest.approx(400, rel=1e-6)


def test_stamps_that_jitter_leave_the_counted_angle_alone():
    counter, tachometers = Counter(400), Tachometers(1)
    random = np.random.default_rng(1)
    counted = 0.0
    for k in range(1, 2001):
        tachometers.update(k * DT + random.uniform(-0.002, 0.002), np.array([counter.read()]))
        counted += tachometers.counted[0]
    # The mean of 1000 periods is known to 4 ms of 10 s.
    assert tachometers.pulses_per_turn == pytest.approx(400, rel=1e-3)
    assert counted == pytest.approx(counter.angle, rel=5e-3)


def test_a_driver_that_divides_by_the_time_from_stamp_to_stamp():
    counter, tachometers = Counter(400), Tachometers(1)
    random = np.random.default_rng(2)
    t = 0.0
    for _ in range(1000):
        dt = DT * random.uniform(0.7, 1.3)
        t += dt
        tachometers.update(t, np.array([counter.read(dt)]))
    assert tachometers.pulse[0] == pytest.approx(2.0 * math.pi / 400, rel=1e-9)
    # Whole pulses, whatever the time was.
    pulses = tachometers.counted[0] / tachometers.pulse[0]
    assert pulses == pytest.approx(round(pulses), abs=1e-6)


@pytest.mark.parametrize('noise', [0.0, 0.005])
@pytest.mark.parametrize('step', [0.0, 1 / 256 / 3.6 / 0.65])
def test_readings_without_steps_that_matter(noise, step):
    # As they are, or in steps of 1/256 km/h on a wheel of 0.65 m.
    random = np.random.default_rng(3)
    readings = [
        min(3.0, math.sqrt(0.01 * k)) + noise * random.standard_normal() for k in range(1, 2000)
    ]
    if step:
        readings = [step * round(reading / step) for reading in readings]
    found = follow(Tachometers(1), readings)
    assert found.step[0] == found.pulse[0] == found.pulses_per_turn == 0.0


def test_a_steady_reading_proves_nothing():
    found = follow(Tachometers(1), [*np.sqrt(np.linspace(0.0, 9.0, 100)), *[3.0] * 1000])
    assert found.step[0] == 0.0


def test_glitches_leave_the_step_as_it_is():
    counter, tachometers = Counter(400), Tachometers(1)
    for k in range(1, 1000):
        reading = counter.read()
        tachometers.update(k * DT, np.array([123.456 if k % 100 == 0 else reading]))
    assert tachometers.pulses_per_turn == pytest.approx(400)


def test_another_tachometer_is_found_again():
    tachometers = Tachometers(1)
    for count, pulses in enumerate((400, 1000)):
        counter = Counter(pulses)
        for k in range(1000):
            tachometers.update((1000 * count + k) * DT, np.array([counter.read()]))
        assert tachometers.pulses_per_turn == pytest.approx(pulses)


def test_a_gap_is_counted_by_nobody():
    tachometers = follow(Tachometers(1, 400.0), [1.0] * 10)
    tachometers.update(0.1 + 0.3, np.array([1.0]))
    assert tachometers.counted[0] == pytest.approx(0.3)
    assert tachometers.step[0] == pytest.approx(2.0 * math.pi / 400 / DT)


def test_backward_counts_are_counts():
    found = follow(Tachometers(1), [0.0, 1.5, 0.0, -1.5, 0.0, 1.5, 0.0, 3.0])
    assert found.step[0] == 1.5
    assert found.counted[0] == pytest.approx(3.0 * DT)


@pytest.mark.parametrize('pulses', [-1.0, math.nan, math.inf])
def test_pulses_that_cannot_be(pulses):
    with pytest.raises(ValueError, match='tachometer_pulses must be at least 0'):
        Tachometers(1, pulses)


@pytest.mark.parametrize('noise', [0.0, 0.002])
def test_steps_of_a_bus_do_not_matter_from_standstill_on(noise):
    # 1/256 km/h on a wheel of 0.65 m, 50 Hz, stamped on arrival; the first readings are few steps.
    step = 1 / 256 / 3.6 / 0.65
    random = np.random.default_rng(4)
    tachometers = Tachometers(1)
    for k in range(1, 2000):
        omega = 0.0002 * k + noise * random.standard_normal()
        stamp = 0.02 * k + random.uniform(-0.001, 0.001)
        tachometers.update(stamp, np.array([step * round(omega / step)]))
        assert tachometers.pulses_per_turn == 0.0
