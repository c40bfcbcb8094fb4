"""Slip controller: order and age of inputs, and construction from parameters."""

import math
from types import SimpleNamespace

import pytest

from traction_controller.control.driveline import Differential, Grouping
from traction_controller.control.exit_reason import ExitReason
from traction_controller.control.laws.law import SlipLaw, soil_moment
from traction_controller.control.set_point import SetPoint
from traction_controller.control.slip_control import Mode, SlipControl, TargetSource
from traction_controller.control.slip_controller import SlipController
from traction_controller.control.slip_state import SlipState
from traction_controller.control.wheel_outcome import Degraded
from traction_controller.nodes.slip_controller import SlipControllerBehaviour
from traction_model.contact.tractive import static_contact_length
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import load_vehicle

TRACTOR = load_vehicle('tractor_4wd')
LOADS = [float(load) for load in TRACTOR.static_loads()]
DEFAULTS = {each.name: each.default for each in SlipControllerBehaviour.PARAMETERS}


def parameters(**changes):
    assert set(changes) <= set(DEFAULTS)
    return SimpleNamespace(**{**DEFAULTS, **changes})


class RecordingLaw(SlipLaw):
    """Law with the torque against the soil; records its inputs."""

    velocity_form = False

    def __init__(self, wheel, load, *, slip, lag, dt):
        self.wheel = wheel
        self.calls = []

    def reset(self):
        self.calls = []

    def torque(self, state, target, sent, dt):
        self.calls.append((state.stiffness, state.shaft_torque, target, dt))
        return soil_moment(self.wheel, state)


def controller(**changes):
    p = parameters(law='recording', mode='hold', **changes)
    return SlipController.from_parameters(p, laws={'recording': RecordingLaw})


def slip(**more):
    return SlipState([0.2] * 4, [True] * 4, [2.0] * 4, 1.6, **more)


def last(made, what, wheel=3):
    return made.control.laws[wheel].calls[-1][('stiffness', 'shaft', 'target', 'dt').index(what)]


@pytest.fixture
def made():
    one = controller()
    one.torque_request(0.0, [1.0] * 4)
    return one


def test_parameters_make_the_controller():
    p = parameters(
        mode='hold', slip_target=0.12, law='lqi', grouping='axle', differential='locked',
        driven_axles='rear', hold_torque=[1e3, 2e3, 3e3, 4e3], torque_rate=[5e3], rate=50.0,
        min_speed=0.5, request_timeout=0.7, torque_timeout=0.2, set_point='efficiency',
        set_point_weight=0.5,
    )  # fmt: skip
    made = SlipController.from_parameters(p)
    control = made.control
    assert (control.mode, control.slip_target, control.law) == (Mode.HOLD, 0.12, 'lqi')
    assert (control.grouping, control.differential) == (Grouping.AXLE, Differential.LOCKED)
    assert control.driven == 'rear'
    assert control.hold_torque == [1e3, 2e3, 3e3, 4e3]
    assert control.torque_rate == [5e3] * 4
    assert control.min_speed == 0.5
    assert (made.request_timeout, made.torque_timeout) == (0.7, 0.2)
    assert made.set_point.weight == 0.5
    # The vehicle's gain table is for 100 Hz: the law lpv cannot be chosen, the others can.
    assert 'made for a period of 0.01 s, the controller has 0.02 s' in made.lpv_refused
    with pytest.raises(ValueError, match="control law 'lpv' needs a gain table"):
        control.set_law('lpv')
    control.set_law('pi')


def test_shipped_defaults_use_the_gain_table_of_the_vehicle():
    made = SlipController.from_parameters(parameters())
    assert made.control.law == 'lpv'
    assert made.lpv_refused == ''
    assert made.set_point is None
    assert made.control.target_source is TargetSource.PARAMETER


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'gain_table': 'tracter_4wd'}, "unknown gain table 'tracter_4wd'; did you mean"),
        ({'torque_rate': [1.0, 2.0]}, 'torque_rate has 2 entries for 4 wheels'),
        ({'vehicle': 'single_wheel_rig', 'driven_axles': 'rear', 'hold_torque': [700.0]},
         'a vehicle with one axle has no rear axle'),
        ({'set_point': 'efficiency', 'set_point_low': 0.4}, 'set_point_low 0.4 is above'),
        ({'set_point': 'efficiency', 'soil': 'sandy_laom'}, "'sandy_laom'"),
        ({'vehicle': 'tractor_2wd'}, "unknown vehicle 'tractor_2wd'"),
    ],
)  # fmt: skip
def test_parameters_that_do_not_fit_are_refused(changes, reason):
    with pytest.raises(ValueError, match=reason):
        SlipController.check_parameters(parameters(**changes))


def test_gross_traction_of_every_estimate_counts_at_once(made):
    radii = [wheel.radius for wheel in TRACTOR.wheels]
    made.slip_estimate(0.0, 0.0, slip())
    for k in range(1, 20):
        force = [2000.0 + 50.0 * k, 2000.0, 2000.0 - 50.0 * k, 3000.0]
        outcomes = made.slip_estimate(0.01 * k, 0.0, slip(gross_traction=force))
        moment = [
            f * r + wheel.viscous_friction * 2.0 / r
            for f, r, wheel in zip(force, radii, TRACTOR.wheels, strict=True)
        ]
        assert [outcome.torque for outcome in outcomes] == pytest.approx(moment)


def test_request_that_falls_silent(made):
    # It is still used 0.5 s after its arrival.
    made.slip_estimate(0.0, 0.5, slip())
    assert made.request == [1.0] * 4
    outcomes = made.slip_estimate(0.01, 0.5 + 1e-3, slip())
    assert made.request is None
    assert {o.exit_reason for o in outcomes} == {ExitReason.REMOTE_COMMAND_TIMEOUT}
    made.torque_request(0.6, [2.0] * 4)
    made.slip_estimate(0.02, 0.6, slip())
    assert made.request == [2.0] * 4


def test_stiffness_that_is_not_known(made):
    # Five static loads until one comes, from then on the one that came last.
    made.slip_estimate(0.0, 0.0, slip())
    assert last(made, 'stiffness') == pytest.approx(5.0 * LOADS[3])
    made.slip_estimate(0.01, 0.0, slip(slip_stiffness=[1e4, 2e4, 3e4, 4e4]))
    assert last(made, 'stiffness') == 4e4
    made.slip_estimate(0.02, 0.0, slip())
    assert last(made, 'stiffness') == 4e4
    made.reset()
    made.torque_request(0.0, [1.0] * 4)
    made.slip_estimate(0.0, 0.0, slip())
    assert last(made, 'stiffness') == pytest.approx(5.0 * LOADS[3])


def test_age_of_the_shaft_torque(made):
    made.wheel_states(0.0, [1.0, 2.0, 3.0, 4.0])
    for t, missing in ((0.05, False), (0.1, False), (0.11, True)):
        outcomes = made.slip_estimate(t, 0.0, slip())
        expected = Degraded.SHAFT_TORQUE if missing else Degraded.NONE
        assert {outcome.degraded for outcome in outcomes} == {expected}
        assert missing or last(made, 'shaft') == 4.0
    made.wheel_states(0.12, [5.0] * 4)
    assert made.slip_estimate(0.12, 0.0, slip())[0].degraded is Degraded.NONE
    # A vehicle that does not measure it.
    made.wheel_states(0.13, None)
    assert made.slip_estimate(0.13, 0.0, slip())[0].degraded is Degraded.SHAFT_TORQUE


def test_time_between_estimates(made):
    # None before the first; after a gap five periods; none where the clock was set back.
    for t, expected in ((7.0, 0.0), (7.01, 0.01), (9.0, 0.05), (3.0, 0.0), (3.02, 0.02)):
        made.slip_estimate(t, 0.0, slip())
        assert last(made, 'dt') == pytest.approx(expected)


def test_targets(made):
    made.slip_target(0.12)
    made.slip_estimate(0.0, 0.0, slip())
    assert last(made, 'target') == 0.12
    assert made.control.target_source is TargetSource.TOPIC
    for wrong in (0.0, 1.5, math.nan):
        with pytest.raises(ValueError, match='slip target must be'):
            made.slip_target(wrong)
    # It stands over a reset, and while other parameters are set.
    made.reset()
    made.set_parameters(parameters(law='recording', slip_target=0.3), ['mode'])
    assert made.control.slip_target == 0.12
    assert made.control.mode is Mode.LIMIT
    made.set_parameters(parameters(law='recording', slip_target=0.3), ['slip_target'])
    assert made.control.slip_target == 0.3
    assert made.control.target_source is TargetSource.PARAMETER


def test_parameters_at_run_time(made):
    p = parameters(
        law='recording', grouping='axle', differential='locked', driven_axles='rear',
        request_timeout=2.0, torque_timeout=0.03,
    )  # fmt: skip
    made.set_parameters(p, ['grouping'])
    control = made.control
    assert (control.grouping, control.differential) == (Grouping.AXLE, Differential.LOCKED)
    assert control.driven == 'rear'
    made.wheel_states(0.0, [1.0] * 4)
    outcomes = made.slip_estimate(0.04, 1.9, slip())
    assert made.request == [1.0] * 4
    assert outcomes[3].degraded is Degraded.SHAFT_TORQUE
    with pytest.raises(ValueError, match="unknown control law 'lqi'"):
        made.set_parameters(parameters(law='lqi'), ['law'])


def test_set_point():
    made = controller(set_point='efficiency', set_point_rate=0.05, set_point_time_constant=0.1)
    # Twice the maximum shear stress of the nominal soil over the static contact area.
    soil = load_soil('sandy_loam_chrono')
    stress = []
    for wheel, load in zip(TRACTOR.wheels, LOADS, strict=True):
        area = wheel.width * static_contact_length(soil, wheel, load)
        stress.append(2.0 * soil.max_shear_stress(load / area))
    modulus = [math.nan, math.nan, 0.04, 0.03]
    seeker = SetPoint(TRACTOR, soil, rate=0.05, time_constant=0.1)
    expected = seeker.update(0.0, 0.2, stress, [True] * 4, modulus)

    made.terrain_estimate(1.0, stress, [False] * 4, modulus)
    assert made.control.target_source is TargetSource.PARAMETER
    # Ten estimates a second are more than soil: the one a second after the first counts.
    for k in range(1, 10):
        made.terrain_estimate(1.0 + 0.1 * k, stress, [True] * 4, modulus)
        assert made.control.target_source is TargetSource.PARAMETER
    for k in range(10, 60):
        # Of a period of 1 s, and of the gap at the end no more than five.
        t = 1.0 + 0.1 * k + (100.0 if k >= 50 else 0.0)
        made.terrain_estimate(t, stress, [True] * 4, modulus)
        if k % 10 == 0:
            expected = seeker.update(
                5.0 if k == 50 else 1.0, expected, stress, [True] * 4, modulus
            )
        assert made.control.slip_target == pytest.approx(expected)
    assert made.control.target_source is TargetSource.SET_POINT
    # A target that is given meanwhile is kept for when none is sought.
    made.slip_target(0.3)
    assert made.control.slip_target == pytest.approx(expected)
    made.reset()
    assert made.control.slip_target == 0.3
    assert made.control.target_source is TargetSource.TOPIC


def test_without_a_set_point_terrain_moves_nothing(made):
    made.terrain_estimate(0.0, [5e4] * 4, [True] * 4)
    assert made.control.slip_target == SlipControl(TRACTOR, 0.2).slip_target
