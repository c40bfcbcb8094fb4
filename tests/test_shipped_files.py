"""A default changed in a file that ships changes evaluation, replay and running nodes alike."""

import shutil
from pathlib import Path

import pytest
import yaml
from ament_index_python.packages import get_package_prefix, get_package_share_directory
from rcl_interfaces.srv import GetParameters

from traction_bringup.system import system
from traction_evaluation.closed_loop.controllers import controllers, fixed_pi
from traction_evaluation.loop.shipped import BEHAVIOURS, digest, shipped_parameters
from traction_evaluation.replay.lockstep import LockStep
from traction_node.running_system import RunningSystem
from tractor_io.bags.message_types import typestore

CHANGED = {
    'slip_estimator': ('radar_timeout', 0.25),
    'slip_controller': ('request_timeout', 0.35),
    'torque_gate': ('timeout', 0.05),
}
"""A parameter of every node, and a value that does not ship."""


def evaluated(node, name):
    """Value that the LPV controller is judged by."""
    return controllers(fixed_pi(1.0, 1.0))[-1].parameters[node][name]


def replayed(node, name):
    """Value that the node has in a replay."""
    lockstep = LockStep(typestore(), lambda *message: None, 0)
    return getattr(lockstep.add(BEHAVIOURS[node][1], shipped_parameters()[node]).p, name)


def running(probe, node, name):
    """Value that a node in a process of its own says it has."""
    request = GetParameters.Request(names=[name])
    (value,) = probe.call(GetParameters, f'{node}/get_parameters', request).values
    return value.double_value


@pytest.fixture
def changed_files(tmp_path, monkeypatch):
    """YAML files as the packages install them, but for `CHANGED`, where all look for them."""
    for node, (name, value) in CHANGED.items():
        package, _ = BEHAVIOURS[node]
        share = tmp_path / 'share' / package
        if not share.exists():
            executables = Path(get_package_prefix(package), 'lib', package)
            shutil.copytree(get_package_share_directory(package), share)
            index = tmp_path / 'share' / 'ament_index' / 'resource_index' / 'packages'
            index.mkdir(parents=True, exist_ok=True)
            (index / package).touch()
            (tmp_path / 'lib').mkdir(exist_ok=True)
            (tmp_path / 'lib' / package).symlink_to(executables)
        path = share / 'config' / f'{node}.yaml'
        content = yaml.safe_load(path.read_text(encoding='utf-8'))
        content[f'/**/{node}']['ros__parameters'][name] = value
        path.write_text(yaml.safe_dump(content), encoding='utf-8')
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path), prepend=':')


def test_a_changed_file_changes_evaluation_replay_and_running_nodes(request):
    before, shipped = digest(), shipped_parameters()
    for node, (name, value) in CHANGED.items():
        assert shipped[node][name] == evaluated(node, name) == replayed(node, name) != value
    request.getfixturevalue('changed_files')
    assert digest() != before
    nodes = [node for node in system(simulated=False) if node.name in CHANGED]
    assert {node.name for node in nodes} == set(CHANGED)
    with RunningSystem(nodes) as started:
        for node, (name, value) in CHANGED.items():
            assert evaluated(node, name) == value
            assert replayed(node, name) == value
            assert running(started.probe, node, name) == value
