"""Description of the system, for launch files and runner."""

import importlib.util
import sys
import types
from pathlib import Path

import pytest
import yaml
from rcl_interfaces.srv import GetParameters

from traction_bringup.system import system, tractor
from traction_node.probe import executable
from traction_node.running_system import NodeEndedError, NodeSpec, RunningSystem

LAUNCH = Path(__file__).parents[1] / 'launch'


def test_every_node_has_an_executable_and_a_parameter_file_that_names_it():
    for node in system(simulated=True, bag='bag'):
        assert executable(node.package, node.executable).is_file()
        for file in node.parameter_files:
            [key] = yaml.safe_load(file.read_text(encoding='utf-8'))
            # With any namespace, and found under the name that the system gives the node.
            assert key == f'/**/{node.name}'


def test_without_control_the_drive_cycle_commands_the_gate():
    nodes = {node.name: node for node in system(simulated=True, controlled=False)}
    assert 'slip_controller' not in nodes
    assert nodes['drive_cycle'].remappings == {'torque_request': 'wheel_torque_command'}


def test_on_a_tractor_neither_plant_nor_drive_cycle_runs():
    assert [node.name for node in system(simulated=False)] == [
        'torque_gate',
        'slip_controller',
        'slip_estimator',
    ]


@pytest.mark.parametrize('controlled', [True, False])
def test_with_a_bus_nothing_but_frames_goes_between_tractor_and_suite(controlled):
    described = system(simulated=True, controlled=controlled, can='udp_multicast')
    nodes = {node.name: node for node in described}
    assert {'can_bridge', 'tractor_ecu'} <= set(nodes)
    for name in ('wheel_states', 'radar', 'wheel_torque'):
        assert nodes['plant_node'].remappings[name] == f'tractor/{name}'
        assert nodes['tractor_ecu'].remappings[name] == f'tractor/{name}'
        assert name not in nodes['can_bridge'].remappings
    # The driver's pedal is the request of the drive cycle, on whatever topic.
    asked = nodes['drive_cycle'].remappings.get('torque_request')
    assert nodes['tractor_ecu'].remappings.get('torque_request') == asked
    assert nodes['drive_cycle'].parameters['listeners'] == 2
    for name in ('can_bridge', 'tractor_ecu'):
        assert nodes[name].parameters['interface'] == 'udp_multicast'
    bus = yaml.safe_load(nodes['can_bridge'].parameter_files[0].read_text(encoding='utf-8'))
    # Both ends agree, and every part is for a node of the system.
    assert bus['/**/can_bridge'] == bus['/**/tractor_ecu']
    assert set(bus) <= {f'/**/{name}' for name in (*nodes, 'slip_controller')}


def test_a_tractor_alone_has_a_driver_who_waits_for_no_suite():
    *others, driver = tractor(can='socketcan', parameters={'plant_node': {'seed': 7}})
    assert [node.name for node in others] == ['plant_node', 'tractor_ecu']
    assert others[0].parameters == {'seed': 7}
    assert driver.name == 'drive_cycle'
    assert driver.remappings == {'wheel_states': 'tractor/wheel_states'}
    assert driver.parameters == {'listeners': 1}


def test_on_a_tractor_a_bus_brings_the_bridge_alone():
    names = [node.name for node in system(simulated=False, can='socketcan')]
    assert 'can_bridge' in names
    assert 'tractor_ecu' not in names


def test_parameters_go_to_their_node_and_a_wrong_name_is_refused():
    nodes = {n.name: n for n in system(simulated=True, parameters={'plant_node': {'seed': 7}})}
    assert nodes['plant_node'].parameters == {'seed': 7}
    with pytest.raises(ValueError, match='no node plant'):
        system(simulated=True, parameters={'plant': {'seed': 7}})


def test_ones_own_file_overrules_the_shipped_ones(tmp_path):
    own = tmp_path / 'own.yaml'
    own.write_text('/**/slip_estimator:\n  ros__parameters:\n    soil: lete_sand\n')
    for node in system(simulated=False, autostart=False, parameter_file=own):
        assert node.parameter_files[-1] == own
        assert node.parameters == {'autostart': False}
    with RunningSystem(
        [
            node
            for node in system(simulated=False, parameter_file=own)
            if node.name == 'slip_estimator'
        ]
    ) as running:
        assert 'cannot change' in running.probe.set_parameter('slip_estimator', 'soil', 'dry_sand')
        request = GetParameters.Request(names=['soil', 'vehicle'])
        values = running.probe.call(GetParameters, 'slip_estimator/get_parameters', request).values
    # Other values still come from the shipped file.
    assert [value.string_value for value in values] == ['lete_sand', 'tractor_4wd']
    with pytest.raises(ValueError, match='no such parameter file'):
        system(simulated=False, parameter_file=tmp_path / 'nowhere.yaml')


def test_a_node_that_ends_at_start_is_named_with_what_it_said():
    broken = NodeSpec('traction_model', 'plant_node', 'plant_node', parameters={'rate': -1.0})
    with pytest.raises(NodeEndedError, match=r'(?s)plant_node ended with exit status 2.*rate'):
        RunningSystem([broken]).__enter__()


@pytest.fixture
def launch_modules(monkeypatch):
    """Stand-ins that record their arguments, used without `ros2 launch`."""

    class Kept:
        def __init__(self, *args, **kwargs):
            self.args, self.kwargs = args, kwargs

        def perform(self, context):
            return context[self.args[0]]

    for name, members in {
        'launch': ('LaunchDescription',),
        'launch.actions': ('DeclareLaunchArgument', 'OpaqueFunction'),
        'launch.substitutions': ('LaunchConfiguration',),
        'launch_ros': (),
        'launch_ros.actions': ('Node',),
    }.items():
        module = types.ModuleType(name)
        for member in members:
            setattr(module, member, type(member, (Kept,), {}))
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, 'traction_bringup.launching', raising=False)
    yield
    sys.modules.pop('traction_bringup.launching', None)


@pytest.mark.parametrize('file', ['simulation', 'traction'])
def test_launch_files_start_the_same_nodes_as_the_runner(launch_modules, file):
    spec = importlib.util.spec_from_file_location(file, LAUNCH / f'{file}.launch.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    [entities] = module.generate_launch_description().args
    *arguments, nodes = entities
    given = {a.args[0]: a.kwargs['default_value'] for a in arguments}
    actions = nodes.kwargs['function'](given | {'namespace': 'second'})
    expected = system(simulated=file == 'simulation')
    assert [action.kwargs['name'] for action in actions] == [node.name for node in expected]
    for action, node in zip(actions, expected, strict=True):
        assert action.kwargs['package'] == node.package
        assert action.kwargs['namespace'] == 'second'
        assert action.kwargs['parameters'] == [
            *map(str, node.parameter_files),
            dict(node.parameters),
        ]
