"""Common properties of all control laws, and their construction."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from traction_controller.control.laws.law import WheelState
from traction_controller.control.laws.registry import LAWS, make_law
from traction_model.vehicle.vehicle import load_vehicle

TRACTOR = load_vehicle('tractor_4wd')
REAR = TRACTOR.wheels[3]
LOAD = float(TRACTOR.static_loads()[3])


class Constant:
    """A gain table that is the same everywhere."""

    def __init__(self, *gains):
        self.gains = gains

    def at(self, rim_speed, stiffness):
        return self.gains


# Gains of about the size that the regulator has on loam.
TABLE = Constant(30000.0, 0.3, 0.1, 0.05)
SETTINGS = {'lpv': {'gain_table': TABLE}}


@pytest.fixture(scope='module')
def laws():
    return {name: make_law(name, REAR, LOAD, settings=SETTINGS.get(name)) for name in LAWS}


def state_of(slip, shaft=3000.0, rim=2.0):
    # Gross traction of steady motion under the shaft torque.
    return WheelState(slip, rim, rim * (1 - slip), 4 * LOAD, shaft / REAR.radius, shaft)


@pytest.mark.parametrize('name', LAWS)
def test_nothing_changes_on_target_in_steady_motion(laws, name):
    laws[name].reset()
    for _ in range(300):
        assert laws[name].torque(state_of(0.2), 0.2, 3000.0, 0.01) == pytest.approx(3000.0)


@pytest.mark.parametrize('name', LAWS)
def test_first_step_goes_on_from_the_torque_sent(laws, name):
    # Whatever was sent before, and whatever the shaft has of it: without time it stays.
    laws[name].reset()
    assert laws[name].torque(state_of(0.35, shaft=500.0), 0.2, 4321.0, 0.0) == pytest.approx(
        4321.0
    )


@pytest.mark.parametrize('name', LAWS)
def test_slip_above_target_takes_torque_away_and_below_adds_it(laws, name):
    for slip, sign in ((0.3, -1.0), (0.1, 1.0)):
        laws[name].reset()
        sent = 3000.0
        for _ in range(10):
            sent = laws[name].torque(state_of(slip), 0.2, sent, 0.01)
        assert sign * (sent - 3000.0) > 10.0


@pytest.mark.parametrize('name', LAWS)
def test_what_was_not_sent_is_not_remembered(laws, name):
    # Ten minutes at a limit far from the target: the step after is that after a second of it.
    answers = []
    for steps in (100, 60000):
        laws[name].reset()
        for _ in range(steps):
            laws[name].torque(state_of(0.05), 0.2, 3000.0, 0.01)
        answers.append(laws[name].torque(state_of(0.2), 0.2, 3000.0, 0.01))
    # Of the torque taken over a law may have exp(-1/0.1) = 5e-5 left after a second.
    assert answers[0] == pytest.approx(answers[1], abs=1.0)


@given(
    name=st.sampled_from(list(LAWS)),
    drive=st.lists(
        st.tuples(
            st.floats(-1, 1), st.floats(-20, 20), st.floats(0, 1e7), st.floats(-2e4, 2e4),
            st.floats(-2e4, 2e4), st.floats(0, 0.05), st.floats(0.01, 0.9),
        ),
        min_size=1, max_size=20,
    ),
)  # fmt: skip
@settings(deadline=None, max_examples=100)
def test_every_answer_is_finite(laws, name, drive):
    law = laws[name]
    law.reset()
    for slip, rim, stiffness, shaft, sent, dt, target in drive:
        state = WheelState(slip, rim, rim, stiffness, shaft / REAR.radius, shaft)
        assert math.isfinite(law.torque(state, target, sent, dt))
        assert all(math.isfinite(gain) for gain in law.gains)
        assert len(law.gains) >= 3


@pytest.mark.parametrize(
    ('arguments', 'reason'),
    [
        ({'name': 'pid'}, "unknown control law 'pid'; did you mean 'pi'?"),
        ({'name': 'lpv'}, "control law 'lpv' needs a gain table"),
        ({'name': 'pi', 'settings': {'proportion': 1.0}},
         "control law 'pi' has no setting 'proportion'; did you mean 'proportional'?"),
        ({'name': 'pi', 'load': 0.0}, 'load must be above 0, got 0.0'),
        ({'name': 'lqi', 'lag': math.nan}, 'lag must be above 0, got nan'),
        ({'name': 'lqi', 'dt': -0.01}, 'dt must be above 0, got -0.01'),
        ({'name': 'lqi', 'slip': 1.0}, 'slip must be at least 0 and below 1, got 1.0'),
        ({'name': 'pi', 'settings': {'integral': -1.0}}, 'integral must be above 0, got -1.0'),
        ({'name': 'pi', 'settings': {'rim_speed': 0.0}}, 'rim_speed must be above 0, got 0.0'),
        ({'name': 'pi', 'settings': {'delay': math.nan}}, 'delay must be at least 0, got nan'),
    ],
)  # fmt: skip
def test_refused(arguments, reason):
    arguments = {'load': LOAD, **arguments}
    name, load = arguments.pop('name'), arguments.pop('load')
    with pytest.raises(ValueError, match=reason.replace('?', r'\?')):
        make_law(name, REAR, load, **arguments)
