"""The plant node as a process: topics, clock, torque in, bad input, end."""

import contextlib
import math

import numpy as np
import psutil
import pytest
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from traction_model.vehicle.vehicle import load_vehicle
from traction_node import diagnostic
from traction_node.probe import NodeProcess, Probe, executable
from traction_node.stamp import seconds, to_stamp

WHEELS = list(load_vehicle('tractor_4wd').wheel_names)
RATES = {
    'wheel_states': 100.0,
    'radar': 30.0,  # no whole number of steps of wheel_states
    'ground_truth/slip_estimate': 100.0,
    'ground_truth/terrain_estimate': 10.0,
    'ground_truth/odometry': 50.0,
}

LATENCY = 0.015


def plant(namespace='', **params):
    return NodeProcess(
        executable('traction_model', 'plant_node'), params=params, namespace=namespace
    )


def torque(effort, names=WHEELS, stamp=0.0):
    message = JointState(name=list(names), effort=[float(entry) for entry in effort])
    to_stamp(message.header.stamp, stamp)
    return message


@pytest.fixture
def probe():
    with Probe() as probe:
        yield probe


@pytest.fixture(scope='module')
def running():
    """Probe of a tractor in real time; in a namespace, as the other tests have their own."""
    params = {
        'radar_min_speed': 0.0,
        'radar_rate': RATES['radar'],
        'radar_latency': LATENCY,
        'torque_time_constant': 0.0,
    }
    with plant('field', **params), Probe('field') as probe:
        yield probe


def test_every_topic_comes_at_its_rate_in_real_time(running):
    probe = running
    received = {name: probe.subscribe(name) for name in RATES}
    probe.wait_for(lambda: all(received.values()), 15.0, 'message on every topic')
    starts = {name: seconds(messages[-1].header.stamp) for name, messages in received.items()}
    for messages in received.values():
        messages.clear()
    probe.run_for(2.0)
    for name, messages in received.items():
        stamps = [seconds(message.header.stamp) for message in messages]
        # By their stamps exactly; by the wall clock within 10 % and one message.
        period = (stamps[-1] - starts[name]) / len(stamps)
        assert period == pytest.approx(1 / RATES[name], rel=0.02), name
        assert len(stamps) == pytest.approx(2.0 * RATES[name], rel=0.1, abs=1), name


def test_radar_comes_after_its_latency_at_the_next_step(running):
    probe = running
    ages = {'wheel_states': [], 'radar': []}

    def take(name):
        def on_message(message):
            now = probe.node.get_clock().now().nanoseconds * 1e-9
            ages[name].append(now - seconds(message.header.stamp))

        return on_message

    for name in ages:
        probe.subscribe(name, take(name))
    probe.wait_for(lambda: len(ages['radar']) >= 30, 10.0, '30 readings of radar')
    # wheel_states has no latency. 15 ms end at the step 20 ms on; radar's next is 33 ms on.
    age = np.median(ages['radar']) - np.median(ages['wheel_states'])
    assert age == pytest.approx(0.02, abs=0.005)


def test_at_rest_without_torque(running):
    probe = running
    wheels = probe.subscribe('wheel_states')
    slips = probe.subscribe('ground_truth/slip_estimate')
    terrain = probe.subscribe('ground_truth/terrain_estimate')
    probe.wait_for(lambda: wheels and slips and terrain, 5.0, 'messages')
    assert list(wheels[-1].name) == WHEELS
    assert list(wheels[-1].velocity) == pytest.approx([0.0] * 4, abs=1e-6)
    assert list(slips[-1].valid) == [False] * 4
    assert slips[-1].source == slips[-1].SOURCE_SIMULATED
    # It stands in the soil by its weight.
    assert all(0.01 < depth < 0.1 for depth in terrain[-1].sinkage)


def test_wheel_torque_drives_it_and_silence_stops_that(running):
    probe = running
    wheels = probe.subscribe('wheel_states')
    truth = probe.subscribe('ground_truth/slip_estimate')
    odometry = probe.subscribe('ground_truth/odometry')
    command = probe.publisher('wheel_torque')
    # Names in another order than the plant's: each torque goes to its own wheel.
    message = torque([4000, 3000, 2000, 1000], ['rr', 'rl', 'fr', 'fl'])

    def driving():
        command.publish(message)
        return truth and truth[-1].ground_based_speed > 0.5

    probe.wait_for(driving, 10.0, 'speed of 0.5 m/s')
    assert list(wheels[-1].effort) == [1000.0, 2000.0, 3000.0, 4000.0]
    radii = [wheel.radius for wheel in load_vehicle('tractor_4wd').wheels]
    by_stamp = {seconds(entry.header.stamp): entry for entry in wheels}
    entry = truth[-2]
    rim = [
        radius * omega
        for radius, omega in zip(
            radii, by_stamp[seconds(entry.header.stamp)].velocity, strict=True
        )
    ]
    assert list(entry.wheel_based_speed) == pytest.approx(rim)
    assert list(entry.slip) == pytest.approx(
        [1 - entry.ground_based_speed / speed for speed in rim]
    )
    assert list(entry.valid) == [True] * 4
    assert odometry[-1].pose.pose.position.x > 0.0
    # torque_timeout is 0.5 s.
    probe.wait_for(lambda: max(wheels[-1].effort) == 0.0, 1.0, 'end of torque without commands')


@pytest.mark.parametrize(
    ('message', 'reason'),
    [
        (torque([1, 1, 1], WHEELS[:3]), "wheel_torque effort: joint 'rr' is missing"),
        (torque([1, 1, 1]), 'wheel_torque effort: 3 values for 4 joints'),
        (torque([1, math.nan, 1, 1]), "wheel_torque effort of joint 'fr' is nan"),
        (torque([1] * 5, [*WHEELS, 'fl']), "wheel_torque effort: joint 'fl' is given twice"),
    ],
)
def test_refused_torque_is_named(running, message, reason):
    probe = running
    probe.diagnostics('field/plant_node')
    command = probe.publisher('wheel_torque')

    def named():
        command.publish(message)
        statuses = probe.diagnostics('field/plant_node')
        return [status for status in statuses if status.message == reason]

    status = probe.wait_for(named, 5.0, f'"{reason}" in the diagnostics')[-1]
    assert status.level == bytes([diagnostic.WARN])
    # A good one recovers it.
    seen = len(probe.diagnostics('field/plant_node'))

    def recovered():
        command.publish(torque([0, 0, 0, 0]))
        statuses = probe.diagnostics('field/plant_node')[seen:]
        return [status for status in statuses if status.message == 'simulating']

    assert probe.wait_for(recovered, 5.0, 'recovery')[-1].level == bytes([diagnostic.OK])


def test_interrupt_ends_it_with_status_0(probe):
    wheels = probe.subscribe('wheel_states')
    with plant() as node:
        probe.wait_for(lambda: wheels, 15.0, 'wheel_states')
        assert node.interrupt() == 0
        assert node.output == ''


def test_as_fast_as_possible_with_clock(probe):
    clocks, spent = [], []

    def on_clock(message):
        clocks.append(seconds(message.clock))
        # None once the process has ended: the last messages are then still on their way.
        with contextlib.suppress(psutil.NoSuchProcess):
            times = psutil.Process(node.pid).cpu_times()
            spent.append((clocks[-1], times.user + times.system))

    probe.node.create_subscription(Clock, '/clock', on_clock, 10)
    received = {name: probe.subscribe(name) for name in RATES}
    with plant(
        real_time_factor=0.0, duration=30.0, wait_for_torque=0.0, wait_for_subscribers=60.0
    ) as node:
        # It ends by itself, having simulated all of them.
        probe.wait_for(lambda: not node.running, 90.0, 'end of 30 simulated seconds')
        assert node.wait() == 0
        assert node.output == ''
    assert clocks[-1] == pytest.approx(30.0)
    assert clocks == sorted(clocks)
    # In the plant's processor time, as other programs may take the processor.
    (first, first_spent), (last, last_spent) = spent[0], spent[-1]
    assert last - first > 20.0
    assert (last - first) / (last_spent - first_spent) > 5.0
    # Stamps are simulated time.
    assert seconds(received['ground_truth/odometry'][-1].header.stamp) == pytest.approx(30.0)


def test_as_fast_as_possible_loses_nothing_before_late_subscribers(probe):
    params = {'real_time_factor': 0.0, 'wait_for_torque': 0.0, 'wait_for_subscribers': 60.0}
    with plant(**params, radar_min_speed=0.0):
        probe.wait_for_diagnostic('plant_node', 'waiting for subscribers')
        # One after the other: it waits for the last.
        received = {}
        for name in RATES:
            received[name] = probe.subscribe(name)
            probe.run_for(0.3)
            assert not any(received.values()) or name == list(RATES)[-1]
        probe.wait_for(lambda: all(received.values()), 15.0, 'message on every topic')
    for name, messages in received.items():
        assert seconds(messages[0].header.stamp) == 0.0, name


def test_as_fast_as_possible_goes_on_without_subscribers_and_says_so():
    params = {'real_time_factor': 0.0, 'duration': 1.0, 'wait_for_torque': 0.0}
    with plant(**params, wait_for_subscribers=1.0) as node:
        assert node.wait(30.0) == 0
        (line,) = node.output.splitlines()
    assert line.endswith(f'simulating without subscriber to {", ".join(RATES)}')


def test_as_fast_as_possible_waits_for_the_answer(probe):
    # Answered at every wheel_states: every torque acts in exactly one step.
    command = None
    stamps = []

    def answer(message):
        stamps.append(seconds(message.header.stamp))
        if command is not None:
            command.publish(torque([500, 500, 1000, 1000], stamp=stamps[-1]))

    wheels = probe.subscribe('wheel_states', answer)
    with plant(real_time_factor=0.0, duration=5.0, torque_time_constant=0.0) as node:
        command = probe.publisher('wheel_torque')
        probe.wait_for(lambda: not node.running, 30.0, 'end of 5 simulated seconds')
        assert node.wait() == 0
    answered = [k for k, message in enumerate(wheels) if max(message.effort) == 1000.0]
    assert len(answered) > 100
    steps = [stamps[k + 1] - stamps[k] for k in answered[:-1]]
    # From the first answer on nothing is lost: 10 ms from reading to reading.
    assert max(steps) == pytest.approx(0.01, abs=1e-6)


def test_several_times_real_time(probe):
    clocks = []
    probe.node.create_subscription(
        Clock, '/clock', lambda message: clocks.append(seconds(message.clock)), 10
    )
    with plant(real_time_factor=5.0):
        probe.wait_for(lambda: clocks, 15.0, 'clock')
        before = clocks[-1]
        probe.run_for(1.0)
        assert clocks[-1] - before == pytest.approx(5.0, rel=0.15)


def test_same_seed_same_radar(probe):
    received = {name: probe.subscribe(name) for name in RATES}

    def run(seed):
        received['radar'].clear()
        with plant(
            real_time_factor=0.0,
            duration=10.0,
            wait_for_torque=0.0,
            wait_for_subscribers=60.0,
            radar_min_speed=0.0,
            radar_rate=10.0,
            seed=seed,
        ) as node:
            probe.wait_for(lambda: not node.running, 90.0, 'end')
        return {
            round(seconds(message.header.stamp), 3): message.twist.twist.linear.x
            for message in received['radar']
        }

    first, second, other = run(3), run(3), run(4)
    # Of 101 readings; best effort may lose some.
    common = first.keys() & second.keys()
    assert len(common) >= 50
    assert all(first[stamp] == second[stamp] for stamp in common)
    assert all(first[stamp] != other[stamp] for stamp in first.keys() & other.keys())


@pytest.mark.parametrize(
    ('params', 'reason'),
    [
        ({'vehicle': 'tractor_4dw'}, "unknown vehicle 'tractor_4dw'; did you mean 'tractor_4wd'?"),
        ({'soils': ['dry_snad']}, "unknown soil 'dry_snad'; did you mean 'dry_sand'?"),
        ({'soils': ['dry_sand', 'snow_us']}, '2 soils need as many soil_starts, got 1'),
        (
            {'soils': ['dry_sand'] * 3, 'soil_starts': [0.0, 5.0, 4.0]},
            'starts of soils must be finite and increase, got [5.0, 4.0] m',
        ),
        ({'drawbar_pull': -1.0}, '"drawbar_pull" = -1.0 N is out of range: at least 0 N'),
        ({'form': 'contakt'}, "is not one of paper, bekker_wong, contact"),
        ({'drawbar_pul': 5.0}, 'no parameter "drawbar_pul"; did you mean "drawbar_pull"?'),
    ],
)  # fmt: skip
def test_bad_parameter_ends_the_start_with_one_line(params, reason):
    with plant(**params) as node:
        assert node.wait() == 2
        assert node.output.startswith('plant_node: ')
        assert reason in node.output
        assert node.output.count('\n') == 1
