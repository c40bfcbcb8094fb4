"""Warning of immobilisation: in time for stalling and digging in, no false alarms."""

import math

import numpy as np
import pytest

from traction_controller.estimation.immobilisation import (
    Immobilisation,
    Level,
    Reason,
    WarningLimits,
)
from traction_controller.estimation.slip_filter import SlipFilter
from traction_model.simulation.drawbar import Drawbar
from traction_model.simulation.plant import Plant
from traction_model.simulation.sensors import Radar, RadarModel
from traction_model.soil.soil import load_soil
from traction_model.soil.terrain import Terrain
from traction_model.vehicle.vehicle import GRAVITY, load_vehicle

TRACTOR = load_vehicle('tractor_4wd')
LOAM, SOFT = load_soil('sandy_loam_chrono'), load_soil('soft_patch_chrono')
STANDS = WarningLimits().min_speed


def watch(vehicle):
    """A warning for a vehicle."""
    return Immobilisation([wheel.radius for wheel in vehicle.wheels], vehicle.mass * GRAVITY)


def drive_into_soft_patch(torque, pull, start, estimated):
    """Drive the tractor from loam into a soft patch at constant torque and draft.

    Returns (time, ground speed, level, reason, time left) of every 10 ms until 2 s after it
    stands, and when that is.
    """
    plant = Plant(
        TRACTOR, Terrain([LOAM, SOFT], [start]), drawbar=Drawbar(pull, 1800.0, 2.0),
        torque_time_constant=0.2, max_power=150e3,
    )  # fmt: skip
    warning, estimation = watch(TRACTOR), SlipFilter(TRACTOR, LOAM)
    radar = Radar(RadarModel(latency=0.1), seed=1)
    rows, stood = [], math.inf
    while plant.t < min(25.0, stood + 2.0):
        plant.step(np.array(torque) * min(1.0, plant.t + 0.01), 0.01)
        v = plant.v
        if estimated:
            estimation.wheel_states(plant.t, plant.omega, plant.shaft_torque)
            if len(rows) % 10 == 0:
                radar.measure(plant.t, plant.v)
            for t, reading in radar.deliver(plant.t):
                estimation.radar(t, reading, 0.05**2)
            v = estimation.v
        warning.step(plant.t, v, plant.omega, plant.shaft_torque)
        rows.append((plant.t, plant.v, warning.level, warning.reason, warning.time_left))
        if plant.t > 3.0 and plant.v < STANDS:
            stood = min(stood, plant.t)
    return rows, stood


# Torque a wheel, front and rear; draft; where the soft patch begins.
STALLS = [
    pytest.param((1500, 1500, 5200, 5200), 11000.0, 12.0, id='stalls'),
    pytest.param((1500, 1500, 5200, 5200), 10000.0, 12.0, id='stalls-slowly'),
    pytest.param((1200, 1200, 7000, 7000), 14000.0, 10.0, id='stalls-slipping'),
    pytest.param((1200, 1200, 8500, 8500), 16500.0, 10.0, id='digs-in'),
    pytest.param((1000, 1000, 9500, 9500), 17500.0, 8.0, id='digs-in-fast'),
]


@pytest.mark.parametrize('estimated', [False, True], ids=['true-speed', 'estimated-speed'])
@pytest.mark.parametrize(('torque', 'pull', 'start'), STALLS)
def test_warns_a_second_before_it_stands(torque, pull, start, estimated, capsys, request):
    rows, stood = drive_into_soft_patch(torque, pull, start, estimated)
    assert math.isfinite(stood)
    warned = [t for t, _, level, _, _ in rows if level >= Level.WARNING]
    first = warned[0]
    _, v, _, reason, left = next(row for row in rows if row[0] == first)
    with capsys.disabled():
        print(
            f'\n{request.node.callspec.id}: warned {stood - first:.2f} s before, at {v:.2f} m/s: '
            f'{reason.value}, {left:.2f} s left',
            end='',
        )
    assert stood - first >= 1.0
    # Not before there is anything to warn of.
    assert v > 2 * STANDS
    assert first > 3.0
    # It stays until the end, when it is stuck.
    assert all(level >= Level.WARNING for t, _, level, _, _ in rows if t >= first)
    assert rows[-1][2] is Level.IMMOBILISED
    assert rows[-1][3] is Reason.STUCK


def test_digging_in_is_told_from_stalling():
    reasons = {}
    for torque, pull, start in (case.values for case in STALLS):
        rows, _ = drive_into_soft_patch(torque, pull, start, False)
        reasons[pull] = next(row[3] for row in rows if row[2] >= Level.WARNING)
    assert reasons[10000.0] is reasons[11000.0] is Reason.STALLING
    assert reasons[16500.0] in (Reason.DIGGING_IN, Reason.SLIPPING)
    assert reasons[17500.0] in (Reason.DIGGING_IN, Reason.SLIPPING)


def test_no_warning_where_the_soft_patch_is_passed():
    # Same torque, half the draft: the speed falls from 3.7 to 2.3 m/s, without standstill.
    rows, stood = drive_into_soft_patch((1500, 1500, 5200, 5200), 5500.0, 12.0, True)
    assert math.isinf(stood)
    assert {level for _, _, level, _, _ in rows} == {Level.NONE}


class Wheel:
    """Warning for one wheel of 0.5 m under 10 kN, with given motion."""

    def __init__(self, **limits):
        self.warning = Immobilisation([0.5], 10e3, WarningLimits(**limits))
        self.t = 0.0

    def on(self, seconds, v, rim, torque=1000.0, mobilised=math.nan, sinkage=math.nan):
        """Continue for a time; v, rim and sinkage are values or (start, end)."""
        levels = []
        for share in np.linspace(0.0, 1.0, round(seconds * 100)):
            self.t += 0.01
            now = [
                value[0] + share * (value[1] - value[0]) if isinstance(value, tuple) else value
                for value in (v, rim, sinkage)
            ]
            levels.append(
                self.warning.step(self.t, now[0], [now[1] / 0.5], [torque], mobilised, now[2])
            )
        return levels


def test_time_left_by_hand():
    wheel = Wheel()
    wheel.on(5.0, 2.0, 2.2)
    # From 2 m/s down by 0.5 m/s^2. After 1.6 s at 1.2 m/s: (1.2 - 0.3)/0.5 = 1.8 s are left. The
    # rate, twice smoothed over 0.3 s, is there to 1 - (1 + 1.6/0.3)*exp(-1.6/0.3) = 97 %.
    wheel.on(1.6, (2.0, 1.2), (2.2, 1.4))
    assert wheel.warning.time_left == pytest.approx(1.8 / 0.97, rel=0.02)
    assert wheel.warning.level is Level.NONE
    # 1.5 s are left 0.3 s later, and 0.1 s on it is confirmed.
    levels = wheel.on(1.0, (1.2, 0.7), (1.4, 0.9))
    assert levels.index(Level.WARNING) / 100 == pytest.approx(0.4, abs=0.05)
    assert wheel.warning.reason is Reason.STALLING


def test_letting_go_is_no_stalling():
    wheel = Wheel()
    wheel.on(5.0, 2.0, 2.2)
    # The driver takes a third of the torque away, or nearly all.
    assert set(wheel.on(3.0, (2.0, 0.1), (2.2, 0.2), torque=650.0)) == {Level.NONE}
    wheel = Wheel()
    wheel.on(5.0, 2.0, 2.2)
    assert set(wheel.on(3.0, (2.0, 0.0), (2.2, 0.0), torque=20.0)) == {Level.NONE}


def test_exhausted_thrust_warns_of_digging_in_earlier():
    def first(mobilised):
        wheel = Wheel()
        wheel.on(5.0, 0.9, 1.0)
        # Slip grows from 0.1 to 0.7 within 3 s; 0.15 is soon reached, 0.3 later.
        for k in range(30):
            v, rim = 0.9 - 0.02 * k, 1.0 + 0.002 * k
            levels = wheel.on(0.1, (v, v - 0.02), (rim, rim + 0.002), mobilised=mobilised)
            if levels[-1] is Level.WARNING:
                return k, wheel.warning.reason
        return 30, None

    exhausted, reason = first(0.97)
    assert reason is Reason.DIGGING_IN
    assert exhausted < first(0.7)[0]
    assert first(math.nan) == first(0.7)


def test_slipping_without_getting_on():
    wheel = Wheel()
    wheel.on(3.0, 1.0, 1.2)
    levels = wheel.on(2.0, 1.0, 4.0)
    assert levels[-1] is Level.WARNING
    assert wheel.warning.reason is Reason.SLIPPING
    assert wheel.warning.slip == pytest.approx(0.75, abs=0.01)


def test_moving_off_with_much_slip_is_no_warning():
    wheel = Wheel()
    # From standstill to 2 m/s within 3 s, rim ahead by 2 m/s.
    assert set(wheel.on(3.0, (0.0, 2.0), (0.0, 4.0))) == {Level.NONE}


def test_sinking_in():
    wheel = Wheel()
    wheel.on(3.0, 1.0, 1.2, sinkage=0.1)
    # From 0.1 to 0.4 m of a radius of 0.5 m within 3 s: 0.8 of it at the end.
    levels = wheel.on(3.0, 1.0, 1.2, sinkage=(0.1, 0.4))
    assert wheel.warning.reason is Reason.SINKING
    warned = levels.index(Level.WARNING) / 100
    # 1.5 s before the end at 0.2 of the radius a second, later by the trend's lag.
    assert 1.4 < warned < 2.2
    # Meeting soft soil it sinks fast, but not far.
    wheel = Wheel()
    wheel.on(3.0, 1.0, 1.2, sinkage=0.02)
    levels = wheel.on(0.3, 1.0, 1.2, sinkage=(0.02, 0.12))
    levels += wheel.on(2.0, 1.0, 1.2, sinkage=0.12)
    assert set(levels) == {Level.NONE}


def test_a_warning_is_withdrawn_after_all_has_been_well_for_a_while():
    wheel = Wheel()
    wheel.on(3.0, 1.0, 1.2)
    wheel.on(1.0, 1.0, 4.0)
    assert wheel.warning.level is Level.WARNING
    # The slip goes down at once; smoothed over 0.3 s, from 4 m/s to below 2.5 m/s takes 0.2 s.
    levels = wheel.on(2.0, 1.0, 1.2)
    gone = levels.index(Level.NONE) / 100
    assert 1.0 < gone < 1.5
    assert wheel.warning.reason is Reason.NONE
    # A sign that comes and goes does not make it flicker.
    wheel.on(1.0, 1.0, 4.0)
    levels = []
    for _ in range(5):
        levels += wheel.on(0.6, 1.0, 1.2) + wheel.on(0.4, 1.0, 5.0)
    assert set(levels) == {Level.WARNING}


def test_a_short_sign_is_not_confirmed():
    wheel = Wheel(confirmation=0.5)
    wheel.on(3.0, 1.0, 1.2)
    levels = wheel.on(0.3, 1.0, 4.0) + wheel.on(1.0, 1.0, 1.2)
    assert set(levels) == {Level.NONE}


def test_stuck_until_it_moves_again():
    wheel = Wheel()
    wheel.on(3.0, 1.0, 1.2)
    levels = wheel.on(3.0, 0.0, 3.0)
    assert levels[-1] is Level.IMMOBILISED
    assert wheel.warning.time_left == 0.0
    # Freed: after a second of driving all is well.
    levels = wheel.on(3.0, (0.3, 2.0), (0.4, 2.2))
    assert levels[-1] is Level.NONE


def test_standing_under_a_brake_is_not_stuck():
    # 100 N·m on 0.5 m: 2 % of the weight.
    assert set(Wheel().on(10.0, 0.0, 0.0, torque=100.0)) == {Level.NONE}


def test_reverse_is_seen_as_forward_is():
    forward, reverse = Wheel(), Wheel()
    for v, rim in ((1.0, 1.2), ((1.0, 0.5), (1.2, 3.0))):
        ahead = forward.on(2.0, v, rim)
        flip = [tuple(-a for a in each) if isinstance(each, tuple) else -each for each in (v, rim)]
        assert reverse.on(2.0, *flip, torque=-1000.0) == ahead
    assert reverse.warning.level is Level.WARNING


def test_a_gap_in_time_is_no_change_of_speed():
    wheel = Wheel()
    wheel.on(3.0, 3.0, 3.2)
    wheel.t += 5.0
    assert set(wheel.on(2.0, 1.0, 1.1)) == {Level.NONE}


@pytest.mark.parametrize(
    ('arguments', 'named'),
    [
        ((0.0, 1.0, [2.0], [1000.0]), 'time runs backwards'),
        ((2.0, math.nan, [2.0], [1000.0]), 'speed nan m/s'),
        ((2.0, 1.0, [2.0, 2.0], [1000.0]), 'wheel speed for each of 1'),
        ((2.0, 1.0, [2.0], [math.inf]), 'torque for each of 1'),
    ],
)
def test_what_is_not_usable_is_named(arguments, named):
    wheel = Wheel()
    wheel.on(1.0, 1.0, 1.2)
    with pytest.raises(ValueError, match=named):
        wheel.warning.step(*arguments)


@pytest.mark.parametrize(
    ('make', 'named'),
    [
        (lambda: Immobilisation([0.0], 1e4), 'radii'),
        (lambda: Immobilisation([0.5], 0.0), 'weight'),
        (lambda: WarningLimits(horizon=0.0), 'horizon'),
    ],
)
def test_parameters_out_of_range_are_named(make, named):
    with pytest.raises(ValueError, match=named):
        make()
