"""Baseline laws: common properties, and the gains of the scheduled PI."""

import math

import control
import numpy as np
import pytest

from traction_controller.control.driveline import Differential, Grouping
from traction_controller.control.laws.law import WheelState
from traction_controller.control.laws.registry import LAWS, make_law
from traction_controller.control.slip_control import Mode, SlipControl
from traction_evaluation.baselines.laws import ALL_LAWS, BASELINES
from traction_evaluation.baselines.scheduled_pi import ScheduledPiLaw
from traction_evaluation.closed_loop.closed_loop import DT, ClosedLoop, Sensors
from traction_evaluation.loop.shipped import shipped_parameters
from traction_evaluation.loop.traction_loop import TractionLoop
from traction_model.lpv.slip_dynamics import slip_dynamics
from traction_model.simulation.drawbar import Drawbar
from traction_model.simulation.plant import Plant
from traction_model.soil.soil import load_soil
from traction_model.soil.terrain import Terrain
from traction_model.vehicle.vehicle import GRAVITY, load_vehicle

TRACTOR = load_vehicle('tractor_4wd')
REAR = TRACTOR.wheels[3]
LOAD = float(TRACTOR.static_loads()[3])
PATCH = Terrain([load_soil('sandy_loam_chrono'), load_soil('soft_patch_chrono')], [8.0])
# Full throttle: more than rear wheels in the ruts of the front ones can use at 20 % slip.
REQUEST = np.array([2400.0, 2400.0, 9000.0, 9000.0])


@pytest.fixture(params=BASELINES)
def law(request):
    return make_law(request.param, REAR, LOAD, laws=BASELINES)


def state(slip, shaft=3000.0, rim=2.0):
    # Gross traction of steady motion under the shaft torque.
    return WheelState(slip, rim, rim * (1 - slip), 4 * LOAD, shaft / REAR.radius, shaft)


def test_nothing_changes_on_target_in_steady_motion(law):
    for _ in range(300):
        assert law.torque(state(0.2), 0.2, 3000.0, 0.01) == pytest.approx(3000.0)


def test_first_step_goes_on_from_the_torque_sent(law):
    assert law.torque(state(0.35, shaft=500.0), 0.2, 4321.0, 0.0) == pytest.approx(4321.0)


def test_slip_above_target_takes_torque_away_and_below_adds_it(law):
    for slip, sign in ((0.3, -1.0), (0.1, 1.0)):
        law.reset()
        sent = 3000.0
        for _ in range(10):
            sent = law.torque(state(slip), 0.2, sent, 0.01)
        assert sign * (sent - 3000.0) > 10.0


def test_what_was_not_sent_is_not_remembered(law):
    # Ten minutes at a limit far from the target: the step after is that after a second of it, but
    # for exp(-1/0.2) of the first torque, that the sliding mode still takes over.
    answers = []
    for steps in (100, 60000):
        law.reset()
        for _ in range(steps):
            law.torque(state(0.05), 0.2, 3000.0, 0.01)
        answers.append(law.torque(state(0.2), 0.2, 3000.0, 0.01))
    assert answers[0] == pytest.approx(answers[1], abs=20.0)


@pytest.mark.parametrize('mode', list(Mode))
@pytest.mark.parametrize(
    ('grouping', 'differential'),
    [
        (Grouping.WHEEL, Differential.OPEN),
        (Grouping.AXLE, Differential.OPEN),
        (Grouping.AXLE, Differential.LOCKED),
    ],
)
@pytest.mark.parametrize('name', BASELINES)
def test_slip_on_a_soft_patch_stays_at_its_target(name, mode, grouping, differential):
    changes = {
        'slip_controller': {
            'mode': mode.name.lower(),
            'grouping': grouping.name.lower(),
            'differential': differential.name.lower(),
            'hold_torque': [10000.0],
        },
        'torque_gate': {'max_torque': [10000.0]},
    }
    parameters = shipped_parameters(changes=changes)
    parameters['slip_controller']['law'] = name
    plant = Plant(
        TRACTOR, PATCH, drawbar=Drawbar(13000, 1500, 2.0), torque_time_constant=0.1,
        max_power=75e3,
    )  # fmt: skip
    traction_loop = TractionLoop.from_parameters(parameters, ALL_LAWS)
    loop = ClosedLoop(plant, traction_loop, Sensors(), 1, delay=0.0, perfect=True)
    for _ in range(round(20.0 / DT)):
        loop.step((REQUEST * min(1.0, loop.t / 3.0)).tolist())
    drive = loop.drive()
    entered = drive.t[np.argmax(drive.x > 8.0)]
    late = drive.t > entered + 2.0
    assert late.sum() > 500
    # All wheels; the budget of the demo.
    assert np.percentile(np.abs(drive.slip[late] - 0.2), 95) <= 0.03
    if mode is Mode.LIMIT:
        assert np.all(drive.command <= REQUEST + 1e-9)


def test_laws_of_the_node_come_first():
    assert list(ALL_LAWS) == [*LAWS, *BASELINES]


@pytest.mark.parametrize(
    ('name', 'settings', 'reason'),
    [
        ('scheduled_pi', {'delay': math.nan}, 'delay must be at least 0, got nan'),
        ('scheduled_pi', {'proportional': 1.0}, "control law 'scheduled_pi' has no setting"),
        ('sliding_mode', {'reach': 0.0}, 'reach must be above 0, got 0.0'),
        ('sliding_mode', {'boundary_layer': -1.0}, 'boundary_layer must be above 0, got -1.0'),
        ('sliding_mode', {'takeover_time': 0.0}, 'takeover_time must be above 0, got 0.0'),
    ],
)
def test_refused(name, settings, reason):
    with pytest.raises(ValueError, match=reason):
        make_law(name, REAR, LOAD, settings=settings, laws=BASELINES)


@pytest.mark.parametrize('name', BASELINES)
def test_without_the_argument_they_cannot_be_chosen(name):
    with pytest.raises(ValueError, match=f"unknown control law '{name}'"):
        SlipControl(TRACTOR, 0.2, law=name)


@pytest.mark.parametrize('rim_speed', [0.3, 2.0, 12.0])
@pytest.mark.parametrize('relative_stiffness', [0.2, 1.0, 4.0, 50.0])
def test_margins_of_the_scheduled_loop(rim_speed, relative_stiffness):
    # With tau_c above theta SIMC promises a gain margin of 3 and a phase margin of 60 degrees
    # (Skogestad 2003, table 1: 3.14 and 61.4 at tau_c = theta): by an independent library.
    a, b = slip_dynamics(REAR, LOAD / GRAVITY, rim_speed, relative_stiffness * LOAD, 0.2)
    lag, delay = 0.1, 0.03
    law = ScheduledPiLaw(REAR, LOAD, slip=0.2, lag=lag, dt=0.01, delay=delay)
    law.torque(WheelState(0.2, rim_speed, stiffness=relative_stiffness * LOAD), 0.2, 0.0, 0.01)
    proportional, _, integral = law.gains
    s = control.tf('s')
    loop = b / (s - a) / (lag * s + 1) * (proportional * s + integral) / s
    loop *= control.tf(*control.pade(delay, 6))
    gain_margin, phase_margin, *_ = control.margin(loop)
    assert gain_margin > 3.0
    assert phase_margin > 55.0


def test_gains_are_not_extrapolated():
    law = ScheduledPiLaw(REAR, LOAD, slip=0.2, lag=0.1, dt=0.01)
    found = []
    for rim, stiffness in ((0.3, 0.2), (0.0, 0.0), (12.0, 50.0), (-90.0, 1e6)):
        law.torque(WheelState(0.2, rim, stiffness=stiffness * LOAD), 0.2, 0.0, 0.01)
        found.append(law.gains)
    assert found[0] == found[1]
    assert found[2] == found[3]
    assert all(math.isfinite(gain) for gain in np.ravel(found))
