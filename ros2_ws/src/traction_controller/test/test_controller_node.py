"""Slip controller as a process: commands for estimates and requests, and parameters."""

import math
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_share_directory
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from traction_controller.control.driveline import Differential, Grouping
from traction_controller.control.exit_reason import ExitReason, LimitStatus
from traction_controller.control.set_point import SetPoint
from traction_controller.control.slip_control import Mode, TargetSource
from traction_controller.control.wheel_outcome import Degraded
from traction_controller.estimation.slip_filter import SlipFilter
from traction_controller.synthesis.gain_table import read_gain_table
from traction_interfaces.msg import SlipEstimate, TerrainEstimate
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import load_vehicle
from traction_node import diagnostic
from traction_node.probe import NodeProcess, Probe, executable
from traction_node.stamp import seconds, to_stamp

NODE = 'slip_controller'
WHEELS = ['fl', 'fr', 'rl', 'rr']
# A request holds for as long as a busy machine may stand still, s of real time.
REQUEST_TIMEOUT = 10.0


def controller(namespace='', **params):
    path = executable('traction_controller', 'slip_controller')
    return NodeProcess(
        path, params={'request_timeout': REQUEST_TIMEOUT, **params}, namespace=namespace
    )


class Tractor:
    """Publisher of requests and slips; waits for the command after each slip."""

    def __init__(self, probe):
        self.probe = probe
        self.t = 100.0
        self.commands = probe.subscribe('wheel_torque_command')
        self.states = probe.subscribe('controller_state')
        self.estimates = probe.publisher('slip_estimate')
        self.requests = probe.publisher('torque_request')
        probe.meet(NODE, 'wheel_torque_command', 'controller_state')

    def request(self, effort, names=WHEELS):
        self.requests.publish(JointState(name=list(names), effort=[float(e) for e in effort]))

    def send_slip(
        self, slips, valid=True, rim=2.0, names=WHEELS, source=SlipEstimate.SOURCE_BLENDED,
        deviation=0.01, speed=None, stiffness=(), gross_traction=(),
    ):  # fmt: skip
        message = SlipEstimate(wheel_names=list(names), source=source)
        message.slip_variance = [deviation**2] * len(names)
        message.ground_based_speed = 0.95 * rim if speed is None else speed
        to_stamp(message.header.stamp, self.t)
        message.slip = [float(entry) for entry in slips]
        message.valid = [valid] * len(message.slip) if isinstance(valid, bool) else valid
        message.wheel_based_speed = [rim] * len(message.slip)
        message.slip_stiffness = list(stiffness)
        message.gross_traction = list(gross_traction)
        self.estimates.publish(message)

    def step(self, slip, **estimate):
        """Advance by 10 ms; returns command and state of that instant."""
        self.t += 0.01
        count = len(self.commands), len(self.states)
        self.send_slip([slip] * 4, **estimate)
        self.probe.wait_for(
            lambda: len(self.commands) > count[0] and len(self.states) > count[1],
            'wheel_torque_command',
        )  # fmt: skip
        return self.commands[-1], self.states[-1]

    def ask(self, torque):
        """Request a torque until the controller has received it."""

        def heard():
            self.request([torque] * 4)
            return list(self.step(0.05)[1].torque_request) == [torque] * 4

        self.probe.wait_for(heard, f'request of {torque} N·m')

    def run(self, steps, slip, torque):
        for _ in range(steps):
            self.request([torque] * 4)
            answer = self.step(slip)
        return answer


@pytest.fixture(scope='module')
def field():
    """Probe of an active controller in a namespace, as other tests start their own."""
    # A law of slip alone, since the estimates below have no gross traction.
    with controller('field', autostart=True, law='lqi'), Probe('field') as probe:
        probe.diagnostics(f'field/{NODE}')
        probe.wait_for_diagnostic(f'field/{NODE}', 'waiting for slip_estimate')
        yield probe


@pytest.fixture
def tractor(field):
    """From a new activation on, in mode limit at a target of 0.2."""
    assert field.change_state(NODE, 'deactivate')
    assert field.set_parameter(NODE, 'mode', 'limit') == ''
    assert field.set_parameter(NODE, 'slip_target', 0.5) == ''
    assert field.set_parameter(NODE, 'slip_target', 0.2) == ''
    assert field.change_state(NODE, 'activate')
    return Tractor(field)


def test_no_request_no_torque(tractor, field):
    command, state = tractor.step(0.1)
    assert list(command.name) == WHEELS
    assert list(command.effort) == [0.0] * 4
    assert list(state.exit_reason) == [ExitReason.REMOTE_COMMAND_TIMEOUT] * 4
    status = field.wait_for_diagnostic(f'field/{NODE}', 'no torque_request: commanding no torque')
    assert status.level == bytes([diagnostic.WARN])


def test_request_passes_while_slip_is_low(tractor):
    tractor.ask(3000.0)
    command, state = tractor.run(100, 0.05, 3000.0)
    assert list(command.effort) == [3000.0] * 4
    assert seconds(command.header.stamp) == pytest.approx(tractor.t)
    assert state.mode == Mode.LIMIT
    assert state.slip_target == 0.2
    assert list(state.limit_status) == [LimitStatus.OPERATOR_LIMITED] * 4
    assert list(state.torque_command) == list(command.effort)
    assert list(state.slip) == pytest.approx([0.05] * 4)
    assert all(gain > 0 for gain in (*state.slip_gain, *state.integral_gain))


def test_slip_above_target_takes_torque_away(tractor):
    tractor.ask(3000.0)
    tractor.run(100, 0.05, 3000.0)
    command, state = tractor.run(20, 0.4, 3000.0)
    assert max(command.effort) < 3000.0
    assert set(state.exit_reason) == {ExitReason.ALL_CLEAR}


def test_one_entry_for_all_wheels_and_any_order(tractor, field):
    def heard(names, effort, expected):
        tractor.request(effort, names)
        return list(tractor.step(0.05)[1].torque_request) == expected

    field.wait_for(lambda: heard([], [700.0], [700.0] * 4), 'request for all')
    field.wait_for(
        lambda: heard(['rr', 'rl', 'fr', 'fl'], [4, 3, 2, 1], [1.0, 2.0, 3.0, 4.0]),
        'request by name',
    )  # fmt: skip


def test_silent_request_counts_as_zero(tractor, field):
    tractor.ask(3000.0)
    assert max(tractor.run(100, 0.05, 3000.0)[0].effort) == 3000.0
    assert field.set_parameter(NODE, 'request_timeout', 0.5) == ''

    def silent():
        command, state = tractor.step(0.05)
        return list(command.effort) == [0.0] * 4 and set(state.exit_reason)

    assert field.wait_for(silent, 'zero torque') == {ExitReason.REMOTE_COMMAND_TIMEOUT}
    assert field.set_parameter(NODE, 'request_timeout', REQUEST_TIMEOUT) == ''
    tractor.ask(2000.0)


def test_slip_not_valid_or_too_slow_passes_the_request(tractor):
    tractor.ask(1000.0)
    # Given back over half a second, 50 steps, and in full from then on.
    for _ in range(51):
        tractor.request([1000.0] * 4)
        command, state = tractor.step(0.9, valid=False)
        assert list(state.exit_reason) == [ExitReason.SLIP_NOT_AVAILABLE] * 4
        assert list(state.limit_status) == [LimitStatus.NOT_AVAILABLE] * 4
    assert list(command.effort) == [1000.0] * 4
    command, state = tractor.step(0.9, rim=0.1)
    assert list(command.effort) == [1000.0] * 4
    assert list(state.exit_reason) == [ExitReason.VEHICLE_SPEED_TOO_LOW] * 4


def test_mode_switches_at_run_time_without_a_bump(tractor, field):
    tractor.ask(3000.0)
    before, _ = tractor.run(300, 0.05, 3000.0)
    assert field.set_parameter(NODE, 'mode', 'hold') == ''
    tractor.request([3000.0] * 4)
    # Slip 0.2 off its target by 0.15: in one step only the integral acts.
    command, state = tractor.step(0.05)
    assert state.mode == Mode.HOLD
    moved = [gain * 0.15 * 0.01 for gain in state.integral_gain]
    assert list(command.effort) == pytest.approx(
        [torque + step for torque, step in zip(before.effort, moved, strict=True)], rel=1e-6
    )
    # In hold it may exceed the request.
    command, _ = tractor.run(100, 0.05, 3000.0)
    assert min(command.effort) > 3000.0
    assert field.set_parameter(NODE, 'mode', 'limit') == ''
    tractor.request([3000.0] * 4)
    assert max(tractor.step(0.05)[0].effort) <= 3000.0


def test_target_by_topic_and_by_parameter(tractor, field):
    target = field.publisher('slip_target')
    target.publish(Float64(data=0.12))
    field.wait_for(lambda: tractor.step(0.05)[1].slip_target == 0.12, 'target by topic')
    # Another parameter leaves it; its own takes over.
    assert field.set_parameter(NODE, 'request_timeout', 9.0) == ''
    assert tractor.step(0.05)[1].slip_target == 0.12
    assert field.set_parameter(NODE, 'slip_target', 0.15) == ''
    assert tractor.step(0.05)[1].slip_target == 0.15
    assert field.set_parameter(NODE, 'request_timeout', REQUEST_TIMEOUT) == ''


def test_stiffer_soil_changes_the_gains(tractor, field):
    tractor.ask(1000.0)
    first = list(tractor.step(0.1)[1].slip_gain)
    tractor.request([1000.0] * 4)
    changed = tractor.step(0.1, stiffness=[5e3] * 4)[1].slip_gain
    assert all(gain != before for gain, before in zip(changed, first, strict=True))


def test_law_and_driveline_switch_at_run_time_without_a_bump(tractor, field):
    tractor.ask(3000.0)
    before, state = tractor.run(300, 0.05, 3000.0)
    assert state.law == 'lqi'
    assert (state.grouping, state.differential) == (Grouping.WHEEL, Differential.OPEN)
    count = state.change_count
    for name, value, told in (
        ('law', 'lpv', 'law lpv: operator controlled'),
        ('grouping', 'vehicle', 'driveline vehicle, open, all driven: operator controlled'),
        ('differential', 'locked', 'driveline vehicle, locked, all driven: operator controlled'),
        ('law', 'pi', 'law pi: operator controlled'),
    ):
        assert field.set_parameter(NODE, name, value) == ''
        tractor.request([3000.0] * 4)
        command, state = tractor.step(0.05)
        assert list(state.changes) == [told]
        count += 1
        assert state.change_count == count
        assert list(command.effort) == pytest.approx(list(before.effort), rel=1e-3)
    assert state.law == 'pi'
    assert (state.grouping, state.differential) == (Grouping.VEHICLE, Differential.LOCKED)
    assert field.set_parameter(NODE, 'driven_axles', 'rear') == ''
    tractor.request([3000.0] * 4)
    command, state = tractor.step(0.05)
    assert list(command.effort[:2]) == [0.0, 0.0]
    assert list(state.exit_reason[:2]) == [ExitReason.NOT_DRIVEN] * 2
    for name, value in (
        ('law', 'lqi'), ('grouping', 'wheel'), ('differential', 'open'), ('driven_axles', 'all'),
    ):  # fmt: skip
        assert field.set_parameter(NODE, name, value) == ''


def test_without_radar_the_target_is_lower(tractor, field):
    tractor.ask(1000.0)
    silent = {'source': SlipEstimate.SOURCE_WHEEL, 'deviation': 0.04}
    tractor.request([1000.0] * 4)
    _, state = tractor.step(0.05, **silent)
    assert state.slip_target == 0.2
    assert list(state.wheel_slip_target) == pytest.approx([0.16] * 4)
    assert list(state.degraded) == [Degraded.RADAR | Degraded.SHAFT_TORQUE] * 4
    assert list(state.changes) == ['fl fr rl rr: without radar, shaft torque']
    status = field.wait_for_diagnostic(
        f'field/{NODE}', 'controlling without radar, shaft torque'
    )  # fmt: skip
    assert status.level == bytes([diagnostic.WARN])
    _, state = tractor.step(0.05)
    assert list(state.wheel_slip_target) == [0.2] * 4


def test_shaft_torque_comes_and_goes(tractor, field):
    states = field.publisher('wheel_states')
    tractor.ask(1000.0)

    def degraded(expected, **reading):
        def found():
            message = JointState(name=WHEELS, velocity=[3.0] * 4, **reading)
            to_stamp(message.header.stamp, tractor.t)
            states.publish(message)
            tractor.request([1000.0] * 4)
            _, state = tractor.step(0.05)
            return list(state.degraded) == [expected] * 4

        field.wait_for(found, f'degraded {expected!r}')

    degraded(Degraded.NONE, effort=[900.0] * 4)
    field.wait_for_diagnostic(f'field/{NODE}', 'controlling')
    # No effort at all is a vehicle that measures none.
    degraded(Degraded.SHAFT_TORQUE, effort=[])
    degraded(Degraded.NONE, effort=[900.0] * 4)
    # Older than torque_timeout, 0.1 s, against the slip estimate.
    tractor.t += 0.2
    tractor.request([1000.0] * 4)
    assert list(tractor.step(0.05)[1].degraded) == [Degraded.SHAFT_TORQUE] * 4
    degraded(Degraded.NONE, effort=[900.0] * 4)


def test_tachometer_of_one_wheel(tractor, field):
    assert field.set_parameter(NODE, 'grouping', 'axle') == ''
    tractor.ask(1000.0)
    tractor.request([1000.0] * 4)
    _, state = tractor.step(0.05, valid=[False, True, True, True])
    assert list(state.exit_reason) == [ExitReason.ALL_CLEAR] * 4
    missing = [value & Degraded.TACHOMETER for value in state.degraded]
    assert missing == [Degraded.TACHOMETER, 0, 0, 0]
    assert field.set_parameter(NODE, 'grouping', 'wheel') == ''


def test_law_lpv_with_the_table_of_the_vehicle():
    tractor_4wd = load_vehicle('tractor_4wd')
    share = Path(get_package_share_directory('traction_controller'))
    tables = read_gain_table(share / 'config' / 'gains' / 'tractor_4wd.yaml', tractor_4wd, 0.01)
    # Initial slip stiffness: 5 static loads.
    gains = [
        # On slip and torque; this law has no integral.
        [*tables[name].at(2.0, 5.0 * float(load))[:2], 0.0]
        for name, load in zip(WHEELS, tractor_4wd.static_loads(), strict=True)
    ]
    with controller('lpv', autostart=True, law='lpv'), Probe('lpv') as probe:
        probe.diagnostics(f'lpv/{NODE}')
        probe.wait_for_diagnostic(f'lpv/{NODE}', 'waiting for slip_estimate')
        tractor = Tractor(probe)
        tractor.ask(3000.0)
        command, state = tractor.run(10, 0.05, 3000.0)
        assert state.law == 'lpv'
        found = zip(state.slip_gain, state.torque_gain, state.integral_gain, strict=True)
        assert list(map(list, found)) == [pytest.approx(list(row)) for row in gains]
        assert all(0.0 < torque <= 3000.0 for torque in command.effort)
        # The stiffness of every slip estimate is used, 100 times a second.
        for k in range(20):
            stiffness = [(2.0 + 0.1 * k) * float(load) for load in tractor_4wd.static_loads()]
            tractor.request([3000.0] * 4)
            _, state = tractor.step(0.05, stiffness=stiffness)
            expected = [
                tables[name].at(2.0, own)[0] for name, own in zip(WHEELS, stiffness, strict=True)
            ]
            assert list(state.slip_gain) == pytest.approx(expected)


def test_at_another_rate_than_the_table_is_for_all_other_laws_work():
    with controller('slow', autostart=True, law='lqi', rate=50.0), Probe('slow') as probe:
        probe.diagnostics(f'slow/{NODE}')
        probe.wait_for_diagnostic(f'slow/{NODE}', 'waiting for slip_estimate')
        assert 'lpv' in probe.set_parameter(NODE, 'law', 'lpv')
        assert probe.set_parameter(NODE, 'law', 'pi') == ''


def test_gross_traction_of_every_slip_estimate_counts_at_once(tractor, field):
    assert field.set_parameter(NODE, 'law', 'lpv') == ''
    assert field.set_parameter(NODE, 'mode', 'hold') == ''
    tractor.ask(1.0)
    radii = [0.65, 0.65, 0.85, 0.85]
    gross_traction = [2000.0] * 4

    def step():
        tractor.request([1.0] * 4)
        command, _ = tractor.step(0.2, gross_traction=gross_traction)
        return list(command.effort)

    # With M what balances the soil, slip at its target and the shaft torque standing still, a
    # step of M moves the command by dM*(1 + sum of the gains on torque and commands).
    tractor_4wd = load_vehicle('tractor_4wd')
    share = Path(get_package_share_directory('traction_controller'))
    tables = read_gain_table(share / 'config' / 'gains' / 'tractor_4wd.yaml', tractor_4wd, 0.01)
    # Initial slip stiffness: 5 static loads.
    sums = [
        1.0 + sum(tables[name].at(2.0, 5.0 * float(load))[1:])
        for name, load in zip(WHEELS, tractor_4wd.static_loads(), strict=True)
    ]
    for _ in range(200):
        before = step()
    for wheel in range(4):
        gross_traction[wheel] += 500.0
        after = step()
        moved = [0.0] * 4
        moved[wheel] = 500.0 * radii[wheel] * sums[wheel]
        # In addition it moves towards its final value, by less than 1 N·m per step.
        assert [a - b for a, b in zip(after, before, strict=True)] == pytest.approx(moved, abs=1.0)
        for _ in range(200):
            before = step()
    assert field.set_parameter(NODE, 'law', 'lqi') == ''


def test_stiffness_that_is_no_number_is_named_and_the_last_one_holds(tractor, field):
    tractor.ask(2000.0)
    good = [1e4, 2e4, 3e4, 4e4]
    before = list(tractor.step(0.05, stiffness=good)[1].slip_gain)
    after = tractor.step(0.05, stiffness=[1e4, math.nan, 1e4, 1e4])[1]
    assert list(after.slip_gain) == pytest.approx(before)
    field.wait_for_diagnostic(
        f'field/{NODE}', "refused: slip_estimate slip_stiffness of joint 'fr' is nan"
    )
    assert list(tractor.step(0.05, stiffness=good)[1].slip_gain) == pytest.approx(before)


def test_set_point_from_the_estimated_soil():
    # Twice as strong as the nominal soil; the goal is about 0.11 (see test_set_point.py), from
    # 0.2 at 0.05 a second.
    params = {
        'set_point': 'efficiency', 'set_point_rate': 0.05, 'set_point_time_constant': 0.1,
    }  # fmt: skip
    vehicle, soil = load_vehicle('tractor_4wd'), load_soil('sandy_loam_chrono')
    stress = (2 * SlipFilter(vehicle, soil).max_shear_stress).tolist()
    seeker = SetPoint(vehicle, soil)
    # The modulus of the front wheels is unknown.
    modulus = [math.nan, math.nan, 0.04, 0.03]
    seeker.update(1.0, 0.2, stress, [True] * 4, modulus)
    with controller('seek', autostart=True, **params), Probe('seek') as probe:
        probe.diagnostics(f'seek/{NODE}')
        probe.wait_for_diagnostic(f'seek/{NODE}', 'waiting for slip_estimate')
        tractor = Tractor(probe)
        terrain = probe.publisher('terrain_estimate')

        def estimate(**more):
            message = TerrainEstimate(wheel_names=WHEELS, **more)
            message.max_shear_stress = stress
            message.shear_deformation_modulus = modulus
            to_stamp(message.header.stamp, tractor.t)
            terrain.publish(message)

        tractor.step(0.1)
        # No soil is known before the first valid estimate.
        estimate(valid=[False] * 4)
        assert tractor.step(0.1)[1].target_source == TargetSource.PARAMETER

        def sought():
            tractor.t += 1.0
            estimate(valid=[True] * 4)
            state = tractor.step(0.1)[1]
            return state.target_source == TargetSource.SET_POINT and state.slip_target

        first = probe.wait_for(sought, 'set-point in force')
        assert seeker.goal < first <= 0.2

        def arrived():
            return sought() == pytest.approx(seeker.goal, abs=1e-3)

        probe.wait_for(arrived, f'target of {seeker.goal}')
        # A target by topic is stored while a set-point is active, and rejected if it is out of
        # range.
        probe.publisher('slip_target').publish(Float64(data=1.5))
        probe.wait_for_diagnostic(f'seek/{NODE}', 'refused: slip target must be')
        probe.publisher('slip_target').publish(Float64(data=0.3))
        assert sought() == pytest.approx(seeker.goal, abs=1e-3)


def bad_target(tractor, field):
    field.publisher('slip_target').publish(Float64(data=1.5))


@pytest.mark.parametrize(
    ('send', 'reason'),
    [
        (lambda t, f: t.request([1.0, math.nan, 1.0, 1.0]),
         "torque_request effort of joint 'fr' is nan"),
        (lambda t, f: t.request([1.0] * 3, WHEELS[:3]),
         "torque_request effort: joint 'rr' is missing"),
        (lambda t, f: t.request([1.0, 2.0]), 'torque_request effort: 2 values for 4 joints'),
        (lambda t, f: t.send_slip([math.nan] * 4), "slip_estimate slip of joint 'fl' is nan"),
        (lambda t, f: t.send_slip([0.1] * 3), 'slip_estimate slip: 3 values for 4 joints'),
        (lambda t, f: t.send_slip([0.1] * 4, speed=math.nan),
         'slip_estimate ground_based_speed is nan'),
        (bad_target, 'slip target must be 0.01 to 0.9, got 1.5'),
    ],
)  # fmt: skip
def test_bad_message_is_named_and_passed_over(tractor, field, send, reason):
    tractor.ask(2000.0)
    before = len(tractor.commands)
    seen = len(field.diagnostics(f'field/{NODE}'))

    def named():
        news = field.diagnostics(f'field/{NODE}')[seen:]
        return [status for status in news if reason in status.message]

    send(tractor, field)
    status = field.wait_for(named, f'"{reason}" in the diagnostics')[-1]
    assert status.level == bytes([diagnostic.ERROR])
    assert len(tractor.commands) == before
    # Earlier input is still used.
    tractor.request([2000.0] * 4)
    command, state = tractor.run(5, 0.05, 2000.0)
    assert all(math.isfinite(torque) for torque in command.effort)
    assert list(state.torque_request) == [2000.0] * 4


@pytest.mark.parametrize(
    ('name', 'value', 'reason'),
    [
        ('mode', 'hodl', 'parameter "mode" = \'hodl\' is not one of limit, hold'),
        ('slip_target', 1.5, 'parameter "slip_target" = 1.5 is out of range: 0.01 .. 0.9'),
        ('hold_torque', 500.0, 'parameter "hold_torque" cannot change while the node runs'),
        ('request_timeout', 0.0, '"request_timeout" = 0.0 s is out of range: 0.05 .. 10 s'),
    ],
)
def test_parameter_refused_at_run_time(field, name, value, reason):
    assert reason in field.set_parameter(NODE, name, value)


@pytest.mark.parametrize(
    ('params', 'reason'),
    [
        (
            {'gain_table': 'tracter_4wd'},
            "unknown gain table 'tracter_4wd'; did you mean 'tractor_4wd'?",
        ),
        (
            {'law': 'lqg'},
            'parameter "law" = \'lqg\' is not one of pi, lqi, lpv',
        ),
        (
            {'grouping': 'axles'},
            'parameter "grouping" = \'axles\' is not one of wheel, axle, vehicle',
        ),
        ({'torque_rate': [1.0, 2.0]}, 'torque_rate has 2 entries for 4 wheels'),
        (
            {'vehicle': 'single_wheel_rig', 'driven_axles': 'rear', 'hold_torque': [700.0]},
            'a vehicle with one axle has no rear axle to drive: drive all',
        ),
        (
            {'set_point': 'efficiency', 'set_point_low': 0.4},
            'set_point_low 0.4 is above set_point_high 0.3',
        ),
        ({'vehicle': 'tractor_2wd'}, "unknown vehicle 'tractor_2wd'; did you mean 'tractor_4wd'?"),
        ({'mode': 'hodl'}, 'parameter "mode" = \'hodl\' is not one of limit, hold'),
        ({'slip_target': 0.0}, 'parameter "slip_target" = 0.0 is out of range: 0.01 .. 0.9'),
        ({'slip_targt': 0.1}, 'there is no parameter "slip_targt"; did you mean "slip_target"?'),
    ],
)
def test_bad_parameter_ends_the_start_with_one_line(params, reason):
    with controller(**params) as node:
        assert node.wait() == 2
        assert node.output.startswith(f'{NODE}: {reason}')
        assert node.output.count('\n') == 1


def test_lifecycle_by_service():
    with Probe() as probe, controller() as node:
        assert probe.state(NODE) == 'unconfigured'
        assert probe.change_state(NODE, 'configure')
        tractor = Tractor(probe)
        tractor.send_slip([0.1] * 4)
        probe.run_for(0.2)  # twenty periods of slip_estimate
        assert tractor.commands == []
        assert probe.change_state(NODE, 'activate')
        tractor.ask(1000.0)
        assert probe.change_state(NODE, 'deactivate')
        assert probe.change_state(NODE, 'activate')
        # The request of before is forgotten.
        assert list(tractor.step(0.05)[0].effort) == [0.0] * 4
        assert probe.change_state(NODE, 'deactivate')
        assert probe.change_state(NODE, 'cleanup')
        assert probe.state(NODE) == 'unconfigured'
        assert node.interrupt() == 0
        assert 'Traceback' not in node.output
