"""Slip control on a linear model and on soil."""

import functools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from traction_controller.control.exit_reason import ExitReason, LimitStatus
from traction_controller.control.slip_control import Mode, SlipControl
from traction_controller.control.slip_state import SlipState
from traction_model.vehicle.vehicle import load_vehicle

RIG = load_vehicle('single_wheel_rig')
TRACTOR = load_vehicle('tractor_4wd')
LOADS = [float(load) for load in TRACTOR.static_loads()]
STIFFNESS = [4 * load for load in LOADS]  # that of the linear wheels
DT = 0.01


@functools.cache
def shared_control():
    """Control shared by all tests, since the computation of its gains is slow."""
    return SlipControl(TRACTOR, 0.2, hold_torque=20000.0)


def fresh_control():
    control = shared_control()
    control.reset()
    control.mode = Mode.LIMIT
    control.set_target(0.2)
    return control


@pytest.fixture
def control():
    return fresh_control()


def step(control, slips, requests, *, valid=True, rims=2.0, speed=0.0, shaft=0.0, dt=DT):
    """Step with one value for all four wheels if only one is given."""

    def each(value):
        return [value] * 4 if np.ndim(value) == 0 else list(value)

    state = SlipState(each(slips), each(valid), each(rims), speed, STIFFNESS)
    return control.step(dt, state, each(shaft), None if requests is None else each(requests))


@given(
    st.lists(
        st.tuples(
            st.floats(-1, 1), st.floats(-8000, 8000), st.floats(-5, 5), st.floats(-8000, 8000),
            st.booleans(),
        ),
        min_size=1, max_size=30,
    )
)  # fmt: skip
@settings(deadline=None, max_examples=100)
def test_limit_never_exceeds_the_request(drive):
    control = fresh_control()
    for slip, request, rim, shaft, valid in drive:
        for outcome in step(control, slip, request, valid=valid, rims=rim, shaft=shaft):
            assert math.isfinite(outcome.torque)
            # Along the request, from nothing to all of it.
            assert 0.0 <= math.copysign(1.0, request) * outcome.torque <= abs(request)


def test_request_passes_where_slip_is_below_target(control):
    for _ in range(300):
        outcomes = step(control, 0.05, 3000.0, shaft=3000.0)
    assert [outcome.torque for outcome in outcomes] == [3000.0] * 4
    assert all(o.limit_status is LimitStatus.OPERATOR_LIMITED for o in outcomes)
    assert all(o.exit_reason is ExitReason.ALL_CLEAR for o in outcomes)


def test_slip_above_target_reduces_torque_of_that_wheel_only(control):
    for _ in range(300):
        step(control, 0.05, 3000.0, shaft=3000.0)
    for slip in np.linspace(0.05, 0.3, 6):
        outcomes = step(control, [0.05, slip, 0.05, 0.05], 3000.0, shaft=3000.0)
    assert 0.0 < outcomes[1].torque < 2990.0
    assert outcomes[1].limit_status is LimitStatus.LIMITED_HIGH
    assert [outcomes[j].torque for j in (0, 2, 3)] == [3000.0] * 3


def drive(control, wheels, seconds, requests=5000.0):
    history = []
    for _ in range(round(seconds / DT)):
        outcomes = step(control, wheels.slips, requests, shaft=wheels.shaft)
        torques = [outcome.torque for outcome in outcomes]
        wheels.advance(torques)
        history.append([wheels.slips, torques])
    return np.array(history)


def test_hold_reaches_its_target_on_the_linear_model(control, linear_wheels):
    control.mode = Mode.HOLD
    wheels = linear_wheels()
    history = drive(control, wheels, 5.0)
    assert history[-1, 0] == pytest.approx([0.2] * 4, abs=1e-3)
    # Overshoot at most a tenth of the step.
    assert np.max(history[:, 0]) < 0.22
    # And stays there when the soil takes 500 N·m more.
    wheels.load_torque = 500.0
    history = drive(control, wheels, 5.0)
    assert history[-1, 0] == pytest.approx([0.2] * 4, abs=1e-3)


def test_change_of_target_is_followed_without_a_bump(control, linear_wheels):
    control.mode = Mode.HOLD
    wheels = linear_wheels()
    drive(control, wheels, 5.0)
    before = [outcome.torque for outcome in control.outcomes]
    control.set_target(0.1)
    after = [outcome.torque for outcome in step(control, wheels.slips, 5000.0, shaft=wheels.shaft)]
    # One step of integral action on an error of 0.1, nothing else.
    for j in range(4):
        moved = control.outcomes[j].gains[2] * 0.1 * DT
        assert after[j] == pytest.approx(before[j] - moved, abs=0.02 * moved)
        assert moved < 0.05 * before[j]
    history = drive(control, wheels, 5.0)
    assert history[-1, 0] == pytest.approx([0.1] * 4, abs=1e-3)


def test_change_of_mode_has_no_bump(control, linear_wheels):
    control.mode = Mode.HOLD
    wheels = linear_wheels()
    drive(control, wheels, 5.0)
    held = [outcome.torque for outcome in control.outcomes]
    for mode in (Mode.LIMIT, Mode.HOLD, Mode.LIMIT):
        control.mode = mode
        outcomes = step(control, wheels.slips, 20000.0, shaft=wheels.shaft)
        assert [outcome.torque for outcome in outcomes] == pytest.approx(held, rel=1e-3)


def test_no_windup(control):
    # A minute at the requested torque with slip far below its target: when slip then rises,
    # torque falls as fast as after a second of it.
    falls = []
    for seconds in (1.0, 60.0):
        control.reset()
        for _ in range(round(seconds / DT)):
            step(control, 0.02, 3000.0, shaft=3000.0)
        for _ in range(10):
            outcomes = step(control, 0.35, 3000.0, shaft=3000.0)
        falls.append(outcomes[0].torque)
    assert falls[0] == falls[1] < 3000.0
    # Nor at zero: a minute spinning with no torque left, then grip.
    rises = []
    for seconds in (1.0, 60.0):
        control.reset()
        for _ in range(round(seconds / DT)):
            step(control, 0.8, 3000.0)
        assert control.outcomes[0].torque == 0.0
        for _ in range(10):
            outcomes = step(control, 0.1, 3000.0)
        rises.append(outcomes[0].torque)
    assert rises[0] == rises[1] > 0.0


def test_backward_request_is_forward_mirrored(control):
    # Braking while rolling forward: slip and torque have opposite signs, control is the same.
    random = np.random.default_rng(1)
    slips = np.cumsum(random.normal(0, 0.02, 300))
    shafts = 2000 + 500 * random.standard_normal(300)
    runs = []
    for sign in (1.0, -1.0):
        control.reset()
        runs.append(
            [
                sign * step(control, sign * s, sign * 3000.0, shaft=sign * t)[0].torque
                for s, t in zip(np.clip(slips, -1, 1), shafts, strict=True)
            ]
        )
    assert runs[0] == runs[1]
    assert min(runs[0]) < 3000.0


def test_driving_in_reverse_is_driving_forward_mirrored(control):
    # Backward speed and backward request: slip is positive when the wheels drive.
    runs = []
    for sign in (1.0, -1.0):
        control.reset()
        runs.append(
            [
                sign
                * step(control, s, sign * 3000.0, rims=sign * 2.0, shaft=sign * 2000.0)[0].torque
                for s in np.linspace(0.0, 0.5, 100)
            ]
        )
    assert runs[0] == runs[1]
    assert runs[0][-1] < 1000.0


@pytest.mark.parametrize(
    ('arguments', 'reason', 'torque'),
    [
        ({'slips': 0.1, 'requests': None}, ExitReason.REMOTE_COMMAND_TIMEOUT, 0.0),
        ({'slips': 0.9, 'requests': 3000.0, 'rims': 0.2}, ExitReason.VEHICLE_SPEED_TOO_LOW, 3e3),
        ({'slips': 0.9, 'requests': 3e3, 'valid': False}, ExitReason.SLIP_NOT_AVAILABLE, 3e3),
        ({'slips': 0.9, 'requests': -9e2, 'valid': False}, ExitReason.SLIP_NOT_AVAILABLE, -9e2),
    ],
)  # fmt: skip
def test_exit_reasons(control, arguments, reason, torque):
    for outcome in step(control, **arguments):
        assert outcome.exit_reason is reason
        assert outcome.limit_status is LimitStatus.NOT_AVAILABLE
        assert outcome.torque == torque


@pytest.mark.parametrize('rim', [0.0, -1.0])
def test_a_wheel_that_locks_or_turns_backwards_under_braking_is_let_go(control, rim):
    # At 5 m/s slip is -1 whether the wheel stands or turns against the motion.
    torque = -6000.0
    for _ in range(50):
        outcomes = step(control, -1.0, -6000.0, rims=rim, speed=5.0, shaft=torque)
        torque = outcomes[0].torque
    assert outcomes[0].exit_reason is ExitReason.ALL_CLEAR
    assert torque == 0.0


def test_leaving_control_at_low_speed_gives_the_request_back_bit_by_bit(control):
    for _ in range(100):
        step(control, 0.6, 3000.0, rims=0.5, shaft=0.0)
    before = step(control, 0.6, 3000.0, rims=0.5)[0].torque
    assert before == 0.0
    torques = []
    for _ in range(51):
        outcome = step(control, 0.6, 3000.0, rims=0.2)[0]
        assert outcome.exit_reason is ExitReason.VEHICLE_SPEED_TOO_LOW
        torques.append(outcome.torque)
    # Progress of the return grows by 10 ms / 0.5 s per step: 2 % of 3000 N·m at first.
    assert torques[0] == pytest.approx(60.0)
    assert torques == sorted(torques)
    assert torques[-1] == 3000.0
    # Less torque is never held back.
    assert step(control, 0.6, 10.0, rims=0.2)[0].torque == 10.0


def test_hold_gives_no_torque_without_a_request(control):
    control.mode = Mode.HOLD
    for _ in range(100):
        outcomes = step(control, 0.0, 0.0)
    assert [outcome.torque for outcome in outcomes] == [0.0] * 4


def test_hold_torque_of_each_wheel():
    control = SlipControl(RIG, 0.2, Mode.HOLD, hold_torque=[700.0])
    for _ in range(200):
        [outcome] = control.step(DT, SlipState([0.0], [True], [2.0], 2.0, [2e4]), [700.0], [1.0])
    assert outcome.torque == 700.0
    with pytest.raises(ValueError, match='hold_torque has 2 entries for 1 wheels'):
        SlipControl(RIG, 0.2, hold_torque=[700.0, 800.0])


def test_slip_control_takes_over_from_what_was_passed(control):
    step(control, 0.9, 3000.0, valid=False)
    outcomes = step(control, 0.2, 3000.0)
    # At the target, with no change of slip known: the torque stays.
    assert [outcome.torque for outcome in outcomes] == pytest.approx([3000.0] * 4)


def test_no_time_no_integral_action(control):
    step(control, 0.5, 3000.0, valid=False)
    assert [o.torque for o in step(control, 0.5, 3000.0, dt=0.0)] == [3000.0] * 4


@pytest.mark.parametrize('target', [0.0, -0.1, 0.95, math.nan])
def test_target_refused(control, target):
    with pytest.raises(ValueError, match=r'slip target must be 0\.01 to 0\.9, got'):
        control.set_target(target)
    assert control.slip_target == 0.2


@pytest.mark.parametrize('fault', ['hold_torque', 'min_speed'])
def test_control_refuses(fault):
    with pytest.raises(ValueError, match=f'{fault} must be above 0, got nan'):
        SlipControl(RIG, 0.2, **{fault: math.nan})
