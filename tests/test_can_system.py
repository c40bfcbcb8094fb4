"""The simulated tractor behind a CAN bus: frames alone connect it with the suite."""

import numpy as np
import pytest

from traction_bringup.system import system
from traction_node.running_system import RunningSystem
from traction_node.stamp import seconds
from tractor_io.can.interface import free_port

TARGET = 0.2
SUITE = {'torque_gate', 'slip_controller', 'slip_estimator', 'can_bridge'}
TRACTOR = {'plant_node', 'tractor_ecu'}
# The driver's pedal goes to the engine and to the suite, which limits the torque.
PEDAL = '/torque_request'
# Soft soil early, so that the drive is short: m along the path of the rear axle; s after that.
SOFT_FROM, SETTLE = 3.0, 2.0
# Truths in a row, one every 10 ms.
STRETCH = 300


@pytest.fixture(scope='module')
def running():
    bus = {'interface': 'udp_multicast', 'port': free_port()}
    nodes = system(
        simulated=True,
        can='udp_multicast',
        parameters={
            'can_bridge': bus,
            'tractor_ecu': bus,
            'plant_node': {'soil_starts': [0.0, SOFT_FROM]},
            'drive_cycle': {'slip_target': TARGET},
        },
    )
    with RunningSystem(nodes) as system_under_test:
        yield system_under_test


def speakers_and_listeners(node):
    """Publishers and subscribers by topic, without topics common to all nodes."""
    found = {}
    for name, _ in node.get_topic_names_and_types():
        if name not in ('/rosout', '/parameter_events', '/diagnostics', PEDAL):
            found[name] = (
                {info.node_name for info in node.get_publishers_info_by_topic(name)},
                {info.node_name for info in node.get_subscriptions_info_by_topic(name)},
            )
    return found


def test_nothing_but_frames_goes_between_tractor_and_suite(running):
    """First, as the test below listens to the truth itself."""
    found = speakers_and_listeners(running.probe.node)
    assert found['/wheel_states'][0] == {'can_bridge'}
    assert found['/radar'][0] == {'can_bridge'}
    assert found['/tractor/wheel_torque'] == ({'tractor_ecu'}, {'plant_node'})
    for name, (speakers, listeners) in found.items():
        assert not (speakers & TRACTOR and listeners & SUITE), name
        assert not (speakers & SUITE and listeners & TRACTOR), name


def test_slip_is_held_through_the_bus(running):
    probe = running.probe
    odometry = probe.subscribe('ground_truth/odometry')
    truths = probe.subscribe('ground_truth/slip_estimate')
    probe.wait_for(lambda: odometry and odometry[-1].pose.pose.position.x > SOFT_FROM, 'soft soil')
    begin = seconds(odometry[-1].header.stamp) + SETTLE

    def error():
        """95th percentile of the error over the last seconds; without control it is 0.1."""
        newest = [m for m in truths if seconds(m.header.stamp) > begin][-STRETCH:]
        slip = np.array([m.slip for m in newest])
        return np.percentile(np.abs(slip - TARGET), 95) if len(newest) == STRETCH else np.inf

    # Where the machine stands still for 0.1 s, gate and engine take the torque away for a moment.
    probe.wait_for(lambda: error() < 0.04, 'stretch with slip near its target')
