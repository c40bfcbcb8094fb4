"""Torque gate: invalid commands, limits, and invariants under random input."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from torque_gate.gate import REACTION_TIME, WATCHDOG_PERIOD, Limit, State, StopSource, TorqueGate

WHEELS = ['fl', 'fr']
MIN, MAX, RATE = [-500.0, -1000.0], [2000.0, 4000.0], [10_000.0, 20_000.0]
TIMEOUT, RELEASE = 0.1, 0.08


def make_gate(**changes) -> TorqueGate:
    arguments = {
        'wheel_names': WHEELS,
        'min_torque': MIN,
        'max_torque': MAX,
        'max_rate': RATE,
        'timeout': TIMEOUT,
        'release_time': RELEASE,
    }
    return TorqueGate(**(arguments | changes))


def passing_gate(efforts=(1000.0, 1000.0)) -> TorqueGate:
    """Gate with the output `efforts` at t = 0, stamp 100 s."""
    gate = make_gate()
    gate.measured(0.0, 0.0, WHEELS, efforts)
    assert gate.command(0.0, 100.0, WHEELS, efforts)
    assert gate.output == list(efforts)
    return gate


def test_waits_at_the_safe_torque():
    gate = make_gate()
    assert gate.step(0.0)
    assert gate.state is State.WAITING
    assert gate.output == [0.0, 0.0]
    assert gate.reason == 'at 0 N·m, no good command yet'


def test_reordered_names_are_mapped():
    gate = passing_gate()
    assert gate.command(0.01, 100.01, ['fr', 'fl'], [1010.0, 1020.0])
    assert gate.output == [1020.0, 1010.0]
    assert gate.command(0.02, 100.02, WHEELS, [1030.0, 1040.0])
    assert gate.output == [1030.0, 1040.0]


def test_magnitude_is_limited():
    gate = passing_gate((1990.0, -990.0))
    assert gate.command(0.01, 100.01, WHEELS, [2050.0, -1050.0])
    assert gate.output == [2000.0, -1000.0]
    assert gate.limits == [Limit.HIGH, Limit.LOW]
    assert gate.limited == {'magnitude': 1, 'rate': 0}
    assert gate.reason == (
        'limited: fl 2050.0 N·m to 2000.0 N·m, most allowed; '
        'fr -1050.0 N·m to -1000.0 N·m, least allowed'
    )


def test_rate_is_limited():
    gate = passing_gate()
    assert gate.command(0.01, 100.01, WHEELS, [2000.0, 1100.0])
    # 10 ms at 10 000 N·m/s are 100 N·m; the other wheel may change by 200 N·m.
    assert gate.output == pytest.approx([1100.0, 1100.0])
    assert gate.limits == [Limit.RATE, Limit.NONE]
    assert gate.reason == 'limited: fl 2000.0 N·m to 1100.0 N·m at 10000 N·m/s'


BAD = [
    ([], [], 'names', "torque: joint 'fl' is missing"),
    (['fl'], [0.0], 'names', "torque: joint 'fr' is missing"),
    (['fl', 'fl'], [0.0, 0.0], 'names', "torque: joint 'fl' is given twice"),
    (['fl', 'xx'], [0.0, 0.0], 'names', "torque: joint 'fr' is missing"),
    (['fl', 'fr', 'xx'], [0.0] * 3, 'names', "torque: unknown joint 'xx'"),
    (WHEELS, [], 'length', 'torque: 0 values for 2 joints'),
    (WHEELS, [0.0] * 3, 'length', 'torque: 3 values for 2 joints'),
    (WHEELS, [0.0, math.nan], 'not_finite', "torque of joint 'fr' is nan"),
    (WHEELS, [-math.inf, 0.0], 'not_finite', "torque of joint 'fl' is -inf"),
]


@pytest.mark.parametrize(('names', 'efforts', 'cause', 'text'), BAD)
def test_bad_command_is_not_passed_and_a_good_one_recovers(names, efforts, cause, text):
    gate = passing_gate()
    assert not gate.command(0.01, 100.01, names, efforts)
    assert gate.output == [1000.0, 1000.0]
    assert gate.state is State.HOLDING
    assert gate.reason == f'holding the last good command: {text}'
    assert gate.rejected[cause] == sum(gate.rejected.values()) == 1
    assert not gate.step(0.02)
    assert gate.command(0.02, 100.02, WHEELS, [1010.0, 1010.0])
    assert gate.state is State.PASSING
    assert gate.output == [1010.0, 1010.0]


def test_command_much_older_than_the_wheel_states_is_stale():
    gate = passing_gate()
    gate.measured(0.005, 105.0, WHEELS, [1000.0, 1000.0])
    assert not gate.command(0.01, 100.01, WHEELS, [1000.0, 1000.0])
    assert gate.reason.endswith('stamp is 4.990 s older than the wheel states')
    assert gate.rejected['stale'] == 1
    assert gate.command(0.02, 104.9, WHEELS, [1000.0, 1000.0])
    # Old wheel states are no reference for the age of commands.
    assert gate.command(0.11, 104.91, WHEELS, [1000.0, 1000.0])


def test_stamp_that_runs_backwards_is_rejected_until_commands_stopped():
    gate = passing_gate()
    assert not gate.command(0.01, 99.5, WHEELS, [1000.0, 1000.0])
    assert gate.reason.endswith('stamp 99.500 s is 0.500 s older than the last')
    assert gate.rejected['stamp'] == 1
    # A clock that was set back for good: the gate lets go, then takes up the new time.
    assert not gate.command(0.09, 99.58, WHEELS, [1000.0, 1000.0])
    assert gate.command(0.11, 99.6, WHEELS, [1000.0, 1000.0])


def test_wheel_states_without_torques_tell_the_age_of_commands_too():
    gate = passing_gate()
    assert not gate.measured(0.005, 105.0, WHEELS, [])
    assert not gate.command(0.01, 100.01, WHEELS, [1000.0, 1000.0])
    assert gate.rejected['stale'] == 1


def test_command_much_younger_than_the_wheel_states_is_not_passed():
    gate = passing_gate()
    gate.measured(0.005, 100.005, WHEELS, [1000.0, 1000.0])
    assert not gate.command(0.01, 110.0, WHEELS, [1000.0, 1000.0])
    assert gate.reason.endswith('stamp is 9.995 s younger than the wheel states')
    # Those that follow are not measured by it.
    assert gate.command(0.02, 100.02, WHEELS, [1000.0, 1000.0])


def test_emergency_stop_holds_until_all_have_released_it():
    gate = passing_gate()
    gate.emergency_stop(StopSource.TOPIC, True)
    assert gate.output == [0.0, 0.0]
    assert gate.reason == 'emergency stop: at 0 N·m until released by topic'
    gate.emergency_stop(StopSource.SERVICE, True)
    gate.emergency_stop(StopSource.TOPIC, False)
    assert gate.reason == 'emergency stop: at 0 N·m until released by service'
    assert not gate.command(0.01, 100.01, WHEELS, [1000.0, 1000.0])
    # Neither a pause nor a deactivation ends it.
    assert gate.step(10.0)
    gate.release()
    assert gate.state is State.STOPPED
    assert gate.output == [0.0, 0.0]
    gate.measured(10.0, 0.0, WHEELS, [300.0, 0.0])
    gate.emergency_stop(StopSource.SERVICE, False)
    assert gate.state is State.SAFE
    assert gate.output == [0.0, 0.0]
    assert gate.command(10.01, 110.0, WHEELS, [1000.0, 1000.0])
    assert gate.output == [300.0, 0.0]


def test_a_release_without_a_stop_changes_nothing():
    gate = passing_gate()
    gate.emergency_stop(StopSource.SERVICE, False)
    assert gate.state is State.PASSING
    assert gate.output == [1000.0, 1000.0]


def test_commands_without_stamp_pass():
    gate = passing_gate()
    assert gate.command(0.01, 0.0, WHEELS, [1000.0, 1000.0])
    assert gate.command(0.02, 0.0, WHEELS, [1000.0, 1000.0])


def test_goes_to_the_safe_torque_when_commands_stop():
    gate = passing_gate((1000.0, -800.0))
    assert not gate.step(TIMEOUT)
    assert gate.output == [1000.0, -800.0]
    # Half the release time after the time-out half the torque is left.
    assert gate.step(TIMEOUT + RELEASE / 2)
    assert gate.state is State.RELEASING
    assert gate.output == pytest.approx([500.0, -400.0])
    assert gate.reason == 'going to 0 N·m, no good command for 0.1 s'
    assert gate.step(TIMEOUT + RELEASE + 1e-9)
    assert gate.state is State.SAFE
    assert gate.output == [0.0, 0.0]
    assert gate.timeouts == 1


def test_bad_commands_do_not_keep_it_from_the_safe_torque():
    gate = passing_gate()
    t = 0.0
    while t < REACTION_TIME:
        t += WATCHDOG_PERIOD
        gate.command(t, 100.0 + t, WHEELS, [math.nan, 0.0])
        gate.step(t)
    assert gate.output == [0.0, 0.0]
    assert gate.reason == "at 0 N·m, no good command for 0.1 s: torque of joint 'fl' is nan"


@pytest.mark.parametrize(
    ('measured', 'start'),
    [
        (700.0, 700.0),  # between safe torque and command: from there
        (-300.0, 0.0),  # beyond the gate's own output: from the output
        (1900.0, 1500.0),  # beyond the command: nobody asked for more
    ],
)
def test_starts_from_the_measured_torque(measured, start):
    gate = make_gate()
    gate.measured(0.0, 0.0, WHEELS, [measured, 0.0])
    assert gate.command(0.01, 100.0, WHEELS, [1500.0, 0.0])
    assert gate.output == [start, 0.0]


def test_starts_from_its_output_when_the_measurement_is_old_or_bad():
    gate = make_gate()
    gate.measured(0.0, 0.0, WHEELS, [700.0, 700.0])
    assert not gate.measured(0.3, 0.0, WHEELS, [math.nan, 700.0])
    assert not gate.measured(0.3, 0.0, ['fl'], [700.0])
    assert gate.command(0.3, 100.0, WHEELS, [1500.0, 1500.0])
    assert gate.output == [0.0, 0.0]


def test_measured_joints_may_be_more_and_in_another_order():
    gate = make_gate()
    assert gate.measured(0.0, 0.0, ['steer', 'fr', 'fl'], [9.0, 300.0, 400.0])
    gate.command(0.01, 100.0, WHEELS, [1500.0, 1500.0])
    assert gate.output == [400.0, 300.0]


def test_release_is_at_once():
    gate = passing_gate()
    gate.release()
    assert gate.output == [0.0, 0.0]
    assert gate.state is State.SAFE


@pytest.mark.parametrize(
    ('changes', 'text'),
    [
        ({'wheel_names': ['fl', 'fl']}, 'each once'),
        ({'wheel_names': []}, 'must be given'),
        ({'max_torque': [1.0]}, 'max_torque has 1 entries for 2 wheels'),
        ({'min_torque': [100.0, 0.0]}, r'fl: safe_torque 0\.0 N·m is not within 100'),
        ({'max_torque': [1.0, math.nan]}, 'fr: safe_torque'),
        ({'max_rate': [1.0, 0.0]}, r'fr: max_rate 0\.0 N·m/s is not above 0'),
        ({'timeout': 0.15}, r'must be at most 0\.2 s'),
        ({'timeout': 0.0}, r'timeout 0\.0 s'),
    ],
)
def test_inconsistent_settings_are_refused(changes, text):
    with pytest.raises(ValueError, match=text):
        make_gate(**changes)


TORQUE = st.floats(allow_nan=True, allow_infinity=True)
EVENT = st.tuples(
    st.floats(1e-4, 0.15),
    st.sampled_from(['command', 'measured']),
    st.sampled_from([WHEELS, ['fr', 'fl'], ['fl'], ['fl', 'fl'], ['fl', 'fr', 'xx'], []]),
    st.lists(TORQUE | st.floats(-3000, 5000), max_size=3),
    st.floats(0, 1e9),
)


@given(st.lists(EVENT, max_size=40))
def test_output_is_within_limits_and_safe_in_time_whatever_comes(events):
    gate = make_gate()
    t, next_step, last_good = 0.0, WATCHDOG_PERIOD, -math.inf
    for pause, kind, names, efforts, stamp in events:
        until = t + pause
        while next_step <= until:
            gate.step(next_step)
            check(gate, next_step, last_good)
            next_step += WATCHDOG_PERIOD
        t = until
        before, state = list(gate.output), gate.state
        if kind == 'measured':
            gate.measured(t, 0.0, names, efforts)
            assert gate.output == before
        elif gate.command(t, stamp, names, efforts):
            if state is State.PASSING and t - last_good <= TIMEOUT:
                for j in range(2):
                    step = RATE[j] * (t - last_good)
                    assert abs(gate.output[j] - before[j]) <= step * (1 + 1e-9) + 1e-9
            last_good = t
        check(gate, t, last_good)


def check(gate: TorqueGate, t: float, last_good: float) -> None:
    for j in range(2):
        assert MIN[j] <= gate.output[j] <= MAX[j]  # and thus no NaN
    if t - last_good > REACTION_TIME - WATCHDOG_PERIOD:
        assert gate.output == [0.0, 0.0]
    assert gate.reason
