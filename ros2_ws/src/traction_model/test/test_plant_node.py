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
    sent = {name: [] for name in RATES}
    received = {name: probe.subscribe(name, sent=times) for name, times in sent.items()}
    # The slowest comes at 10 Hz: 2 s.
    probe.wait_for(lambda: all(len(m) > 20 for m in received.values()), 'messages on every topic')
    for name, messages in received.items():
        stamps = [seconds(message.header.stamp) for message in messages]
        # A message may be lost, so that the time between two is twice as long.
        assert np.median(np.diff(stamps)) == pytest.approx(1 / RATES[name], rel=0.35), name
        assert np.ptp(stamps) / (len(stamps) - 1) == pytest.approx(1 / RATES[name], rel=0.05), name
        # Simulated time is never ahead of real time, and a machine that stands still for a moment
        # lets it fall behind by no more than that.
        ages = np.subtract(sent[name], stamps)
        assert min(ages) > -0.005, name
        assert max(ages) < 1.0, name


def test_radar_comes_after_its_latency_at_the_next_step(running):
    probe = running
    sent = {'wheel_states': [], 'radar': []}
    received = {name: probe.subscribe(name, sent=times) for name, times in sent.items()}
    probe.wait_for(lambda: len(received['radar']) >= 30, '30 readings of radar')
    # Radar is published just before the wheel_states of the same step, which have no latency.
    ages = []
    for time, message in zip(sent['radar'], received['radar'], strict=True):
        step = int(np.searchsorted(sent['wheel_states'], time))
        if step < len(sent['wheel_states']):
            now = seconds(received['wheel_states'][step].header.stamp)
            ages.append(now - seconds(message.header.stamp))
    # 15 ms end at the step 20 ms on; radar's next is 33 ms on.
    assert np.median(ages) == pytest.approx(0.02, abs=1e-6)


def test_at_rest_without_torque(running):
    probe = running
    wheels = probe.subscribe('wheel_states')
    slips = probe.subscribe('ground_truth/slip_estimate')
    terrain = probe.subscribe('ground_truth/terrain_estimate')
    probe.wait_for(lambda: wheels and slips and terrain, 'messages')
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

    probe.wait_for(driving, 'speed of 0.5 m/s')
    assert list(wheels[-1].effort) == [1000.0, 2000.0, 3000.0, 4000.0]
    radii = [wheel.radius for wheel in load_vehicle('tractor_4wd').wheels]
    by_stamp = {seconds(entry.header.stamp): entry for entry in wheels}
    entry = next(entry for entry in reversed(truth) if seconds(entry.header.stamp) in by_stamp)
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
    probe.wait_for(lambda: max(wheels[-1].effort) == 0.0, 'end of torque without commands')


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

    status = probe.wait_for(named, f'"{reason}" in the diagnostics')[-1]
    assert status.level == bytes([diagnostic.WARN])
    # A good one recovers it.
    seen = len(probe.diagnostics('field/plant_node'))

    def recovered():
        command.publish(torque([0, 0, 0, 0]))
        statuses = probe.diagnostics('field/plant_node')[seen:]
        return [status for status in statuses if status.message == 'simulating']

    assert probe.wait_for(recovered, 'recovery')[-1].level == bytes([diagnostic.OK])


def test_interrupt_ends_it_with_status_0(probe):
    wheels = probe.subscribe('wheel_states')
    with plant() as node:
        probe.wait_for(lambda: wheels, 'wheel_states')
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
        real_time_factor=0.0, duration=10.0, wait_for_torque=0.0, wait_for_subscribers=60.0
    ) as node:
        # It ends by itself, having simulated all of them.
        probe.wait_for(lambda: not node.running, 'end of 10 simulated seconds')
        assert node.wait() == 0
        assert node.output == ''
    probe.wait_for(lambda: clocks[-1] == pytest.approx(10.0), 'last clock')
    odometry = received['ground_truth/odometry']
    # Stamps are simulated time.
    probe.wait_for(
        lambda: seconds(odometry[-1].header.stamp) == pytest.approx(10.0), 'last odometry'
    )
    assert clocks == sorted(clocks)
    # In the plant's processor time, as other programs may take the processor.
    (first, first_spent), (last, last_spent) = spent[0], spent[-1]
    assert last - first > 5.0
    assert (last - first) / (last_spent - first_spent) > 5.0


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
        probe.wait_for(lambda: all(received.values()), 'message on every topic')
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

    for name in RATES.keys() - {'wheel_states'}:
        probe.subscribe(name)
    wheels = probe.subscribe('wheel_states', answer)
    # However long this process may take to answer.
    params = {'torque_timeout': 10.0, 'wait_for_subscribers': 60.0, 'wait_for_torque': 60.0}
    with plant(real_time_factor=0.0, duration=5.0, torque_time_constant=0.0, **params) as node:
        command = probe.publisher('wheel_torque')
        probe.wait_for(lambda: not node.running, 'end of 5 simulated seconds')
        assert node.wait() == 0
    answered = [k for k, message in enumerate(wheels) if max(message.effort) == 1000.0]
    assert len(answered) > 100
    steps = [stamps[k + 1] - stamps[k] for k in answered[:-1]]
    # From the first answer on nothing is lost: 10 ms from reading to reading.
    assert max(steps) == pytest.approx(0.01, abs=1e-6)


def test_several_times_real_time(probe):
    sent = []
    wheels = probe.subscribe('wheel_states', sent=sent)
    # A faster one would take most of a core, which a busy machine does not have.
    with plant(real_time_factor=2.0):
        probe.wait_for(lambda: wheels and seconds(wheels[-1].header.stamp) > 10.0, '10 s')
    stamps = [seconds(message.header.stamp) for message in wheels]
    # By stretches of 1 s of simulated time, as the machine may stand still in one of them.
    rates = [
        (stamps[k + 100] - stamps[k]) / (sent[k + 100] - sent[k])
        for k in range(0, len(stamps) - 100, 100)
    ]
    assert np.median(rates) == pytest.approx(2.0, rel=0.15)


def test_same_seed_same_radar():
    params = {
        'real_time_factor': 0.0,
        'duration': 2.0,
        'wait_for_torque': 0.0,
        'wait_for_subscribers': 60.0,
        'radar_min_speed': 0.0,
        'radar_rate': 50.0,
    }
    seeds = {'first': 3, 'second': 3, 'other': 4}
    with contextlib.ExitStack() as stack:
        for namespace, seed in seeds.items():
            stack.enter_context(plant(namespace, **params, seed=seed))
        probes = [stack.enter_context(Probe(namespace)) for namespace in seeds]
        heard = [{name: probe.subscribe(name) for name in RATES} for probe in probes]
        for probe, received in zip(probes, heard, strict=True):
            odometry = received['ground_truth/odometry']

            def over(odometry=odometry):
                return odometry and seconds(odometry[-1].header.stamp) == pytest.approx(2.0)

            probe.wait_for(over, 'end of 2 simulated seconds')
    first, second, other = (
        {
            round(seconds(message.header.stamp), 3): message.twist.twist.linear.x
            for message in received['radar']
        }
        for received in heard
    )
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
