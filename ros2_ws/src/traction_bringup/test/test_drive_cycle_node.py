"""Drive cycle as a process: waits for subscribers and reports it."""

from sensor_msgs.msg import JointState

from traction_node.probe import NodeProcess, Probe, executable


def test_it_says_that_it_waits_for_subscribers():
    path = executable('traction_bringup', 'drive_cycle')
    with Probe() as probe, NodeProcess(path, params={'listeners': 2}):
        probe.wait_for_diagnostic('drive_cycle', 'waiting for wheel_states')
        requests = probe.subscribe('torque_request')
        wheels = probe.publisher('wheel_states')
        timer = probe.node.create_timer(0.01, lambda: wheels.publish(JointState()))
        probe.wait_for_diagnostic(
            'drive_cycle', 'waiting for 2 subscribers of torque_request, has 1'
        )
        assert not requests
        probe.subscribe('torque_request')
        probe.wait_for_diagnostic('drive_cycle', 'driving')
        timer.cancel()
