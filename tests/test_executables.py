"""Every executable as with `ros2 run`: parameters and Ctrl-C."""

import pytest
from recorded_bags import BAGS

from traction_node.probe import NodeProcess, Probe, executable
from tractor_io.can.interface import free_port

BAG = BAGS / 'wheel_low_slip'

NODES = [
    ('traction_model', 'plant_node', 'plant_node', {'seed': 3}),
    ('traction_controller', 'slip_estimator', 'slip_estimator', {'min_speed': 0.4}),
    ('traction_controller', 'slip_controller', 'slip_controller', {'slip_target': 0.15}),
    ('torque_gate', 'torque_gate', 'torque_gate', {'timeout': 0.05}),
    ('tractor_io', 'can_bridge', 'can_bridge', {'address': 100}),
    ('tractor_io', 'tractor_ecu', 'tractor_ecu', {'port': free_port()}),
    ('tractor_io', 'bag_player', 'bag_player', {'bag': str(BAG), 'loop': True}),
    ('tractor_io', 'bag_recorder', 'bag_recorder', {'topics': ['wheel_states']}),
    ('traction_bringup', 'drive_cycle', 'drive_cycle', {'ramp': 1.0}),
]


@pytest.mark.parametrize(('package', 'name', 'node', 'params'), NODES, ids=[n[1] for n in NODES])
def test_takes_a_parameter_and_ends_on_ctrl_c(package, name, node, params, tmp_path):
    if name == 'bag_recorder':
        params = {**params, 'output': tmp_path / 'bag'}
    with NodeProcess(executable(package, name), params=params) as process, Probe() as probe:
        probe.wait_for(lambda: probe.diagnostics(node), f'diagnostics of {node}')
        assert process.interrupt() == 0, process.output
        assert 'Traceback' not in process.output


@pytest.mark.parametrize(('package', 'name', 'node', 'params'), NODES, ids=[n[1] for n in NODES])
def test_names_a_parameter_that_is_mistyped(package, name, node, params):
    first = next(iter(params))
    wrong = first + 'x'
    with NodeProcess(executable(package, name), params={wrong: 1}) as process:
        assert process.wait() == 2
        assert wrong in process.output
        assert f'"{first}"' in process.output
        assert 'Traceback' not in process.output
