"""Slip control without radar, tachometer or shaft torque, and when its law fails."""

import math

import numpy as np
import pytest

from traction_controller.control.driveline import Differential, Grouping
from traction_controller.control.exit_reason import ExitReason, LimitStatus
from traction_controller.control.laws.registry import LAWS
from traction_controller.control.slip_control import Mode, SlipControl
from traction_controller.control.slip_state import SlipState
from traction_controller.control.wheel_outcome import Degraded
from traction_model.vehicle.vehicle import load_vehicle

TRACTOR = load_vehicle('tractor_4wd')
LOADS = [float(load) for load in TRACTOR.static_loads()]
DT = 0.01


class Table:
    """Gains that a test sets; by default about those that a synthesis finds for loam."""

    gains = (60000.0, 0.3, 0.1, 0.0)

    def at(self, rim_speed, stiffness):
        return self.gains


@pytest.fixture
def control():
    return SlipControl(TRACTOR, 0.2, hold_torque=20000.0)


def drive(control, wheels, seconds, *, lost=None, valid=(True,) * 4, **more):
    """Run the linear wheels with lost inputs; returns slips and torques, a row every 10 ms."""
    rows = []
    for _ in range(round(seconds / DT)):
        slips = wheels.slips
        shaft = wheels.shaft
        if lost is not None:
            shaft = [math.nan if j in lost else torque for j, torque in enumerate(shaft)]
        rims = [1.6 / (1 - slip) for slip in slips]
        state = SlipState(slips, list(valid), rims, 1.6, wheels.stiffness, **more)
        outcomes = control.step(DT, state, shaft, [15000.0] * 4)
        torques = [outcome.torque for outcome in outcomes]
        wheels.advance(np.array(torques))
        rows.append([*wheels.slips, *torques])
    rows = np.array(rows)
    return rows[:, :4], rows[:, 4:]


@pytest.mark.parametrize(
    ('deviation', 'target'),
    # By the deviation, at most to half; unknown deviation: to half.
    [(0.0, 0.2), (0.03, 0.17), (0.1, 0.1), (0.5, 0.1), (None, 0.1)],
)
def test_without_radar_the_target_is_lower(control, linear_wheels, deviation, target):
    wheels = linear_wheels()
    drive(control, wheels, 5.0)
    before = control.outcomes[3].torque
    slips, torques = drive(
        control, wheels, 10.0, speed_measured=False,
        slip_deviation=None if deviation is None else [deviation] * 4,
    )  # fmt: skip
    assert torques[0, 3] == pytest.approx(before, rel=0.02)
    assert slips[-1] == pytest.approx([target] * 4, abs=2e-3)
    for outcome in control.outcomes:
        assert outcome.degraded is Degraded.RADAR
        assert outcome.slip_target == pytest.approx(target)
        assert outcome.exit_reason is ExitReason.ALL_CLEAR
    # The target given stays; with the radar back it is in force again.
    assert control.slip_target == 0.2
    slips, _ = drive(control, wheels, 10.0)
    assert slips[-1] == pytest.approx([0.2] * 4, abs=2e-3)
    assert control.outcomes[0].degraded is Degraded.NONE


def test_least_target_without_radar():
    control = SlipControl(TRACTOR, 0.012)
    state = SlipState([0.0] * 4, [True] * 4, [2.0] * 4, 2.0, LOADS, speed_measured=False)
    control.step(DT, state, None, [1.0] * 4)
    assert control.outcomes[0].slip_target == SlipControl.MIN_TARGET


@pytest.mark.parametrize('differential', list(Differential))
def test_group_goes_on_without_a_tachometer(control, linear_wheels, differential):
    # The left wheels' slip is not valid; the right ones hold the target for both.
    control.set_driveline(Grouping.AXLE, differential, 'all')
    wheels = linear_wheels(locked=differential is Differential.LOCKED)
    drive(control, wheels, 5.0)
    before = control.outcomes[3].torque
    slips, torques = drive(control, wheels, 10.0, valid=(False, True, False, True))
    assert torques[0, 3] == pytest.approx(before, rel=0.02)
    assert slips[-1] == pytest.approx([0.2] * 4, abs=2e-3)
    reasons = [outcome.exit_reason for outcome in control.outcomes]
    assert reasons == [ExitReason.ALL_CLEAR] * 4
    missing = [outcome.degraded for outcome in control.outcomes]
    assert missing == [Degraded.TACHOMETER, Degraded.NONE] * 2


def test_without_any_tachometer_the_request_passes(control, linear_wheels):
    control.set_driveline(Grouping.AXLE, Differential.OPEN, 'all')
    wheels = linear_wheels()
    drive(control, wheels, 5.0)
    _, torques = drive(control, wheels, 1.0, valid=(False, False, True, True))
    # Step by step, within half a second.
    assert np.all(np.diff(torques[:, 0]) >= 0.0)
    assert np.all(torques[51:, :2] == 15000.0)
    assert np.all(torques[:, 2:] < 15000.0)
    reasons = [outcome.exit_reason for outcome in control.outcomes]
    assert reasons == [ExitReason.SLIP_NOT_AVAILABLE] * 2 + [ExitReason.ALL_CLEAR] * 2
    missing = [outcome.degraded for outcome in control.outcomes]
    assert missing == [Degraded.TACHOMETER] * 2 + [Degraded.NONE] * 2


def test_without_any_slip_and_without_speed_torque_only_falls(control, linear_wheels):
    drive(control, linear_wheels(), 5.0)
    before = [outcome.torque for outcome in control.outcomes]
    state = SlipState([0.2] * 4, [False] * 4, [3.0] * 4, 2.4, [1e5] * 4, speed_measured=False)
    for request in (15000.0, 100.0, 15000.0):
        for _ in range(100):
            outcomes = control.step(0.01, state, None, [request] * 4)
    assert before[0] > 100.0
    assert [outcome.torque for outcome in outcomes] == [100.0] * 4


@pytest.mark.parametrize('law', LAWS)
@pytest.mark.parametrize('lost', [(0, 1, 2, 3), (0, 3)])
def test_without_shaft_torque_the_lag_stands_for_it(linear_wheels, law, lost):
    control = SlipControl(
        TRACTOR, 0.2, Mode.HOLD, law=law, settings={'lpv': {'gain_table': Table()}},
        hold_torque=20000.0,
    )  # fmt: skip
    whole, without = linear_wheels(), linear_wheels()
    expected = drive(control, whole, 8.0)
    control.reset()
    found = drive(control, without, 8.0, lost=lost)
    # The linear wheels have exactly the lag that is assumed: no difference but rounding.
    np.testing.assert_allclose(found[1], expected[1], rtol=1e-6, atol=1e-3)
    assert found[0][-1] == pytest.approx([0.2] * 4, abs=2e-3)
    for j, outcome in enumerate(control.outcomes):
        assert outcome.degraded is (Degraded.SHAFT_TORQUE if j in lost else Degraded.NONE)


def test_shaft_torque_lost_and_found_under_way(control, linear_wheels):
    wheels = linear_wheels()
    drive(control, wheels, 5.0)
    for lost in ((0, 1, 2, 3), None, (1, 2)):
        before = [outcome.torque for outcome in control.outcomes]
        _, torques = drive(control, wheels, 1.0, lost=lost)
        assert torques[0] == pytest.approx(before, rel=1e-3)


@pytest.mark.parametrize('grouping', list(Grouping))
def test_a_law_that_fails_is_not_trusted_again(linear_wheels, grouping):
    table = Table()
    control = SlipControl(
        TRACTOR, 0.2, law='lpv', settings={'lpv': {'gain_table': table}}, grouping=grouping
    )  # fmt: skip
    wheels = linear_wheels()
    drive(control, wheels, 2.0)
    table.gains = (math.nan, 0.3, 0.1, 0.0)
    drive(control, wheels, 0.02)
    table.gains = Table.gains
    drive(control, wheels, 1.0)
    for outcome in control.outcomes:
        assert outcome.torque == 0.0
        assert outcome.exit_reason is ExitReason.FUNCTION_FAULT
        assert outcome.limit_status is LimitStatus.NON_RECOVERABLE_FAULT
    # Until all is begun anew.
    control.reset()
    drive(control, linear_wheels(), 0.1)
    for outcome in control.outcomes:
        assert outcome.torque > 0.0
        assert outcome.exit_reason is ExitReason.ALL_CLEAR


def test_what_is_missing_is_told(control, linear_wheels):
    wheels = linear_wheels()
    drive(control, wheels, 0.1)
    drive(control, wheels, DT, speed_measured=False, lost=(0,), valid=(True, False, True, True))
    assert control.changes == [
        'fl: without radar, shaft torque',
        'fr: slip not available',
        'fr: without radar, tachometer',
        'rl rr: without radar',
    ]
    drive(control, wheels, DT)
    assert control.changes == [
        'fl fr rl rr: nothing is missing',
        'fr: no reason, all clear',
    ]
