"""Set-up: the environment of the interpreter, worked out once and completed at each start."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import ros_environment

ROOT = Path(__file__).resolve().parents[1]
BARE = {'HOME': os.environ['HOME'], 'PATH': '/usr/bin:/bin'}


def test_completed_puts_what_is_missing_in_front_and_moves_nothing():
    recorded = {'LD_LIBRARY_PATH': '/a:/b:/c', 'ROS_DISTRO': 'jazzy'}
    given = {'LD_LIBRARY_PATH': '/mine:/b', 'HOME': '/home'}
    result = ros_environment.completed(given, recorded)
    assert result == {
        'LD_LIBRARY_PATH': '/a:/c:/mine:/b',
        'HOME': '/home',
        'ROS_DISTRO': 'jazzy',
    }
    assert ros_environment.completed(result, recorded) == result


def test_completed_leaves_the_users_choice_of_a_plain_variable():
    result = ros_environment.completed({'ROS_DOMAIN_ID': '7'}, {'ROS_DOMAIN_ID': '0'})
    assert result == {'ROS_DOMAIN_ID': '7'}


def test_installed_ros_is_asked_through_its_own_script(tmp_path):
    script = tmp_path / 'opt ros' / 'setup.bash'
    script.parent.mkdir()
    script.write_text(
        'echo sourcing\n'
        'export AMENT_PREFIX_PATH="$(dirname "${BASH_SOURCE[0]}")"\n'
        'export ROS_DISTRO=jazzy\n'
        'export TWO_LINES="a\nb"\n'
        'export PATH="/ros/bin:$PATH"\n'
    )
    complete = ros_environment.sourced(script, BARE)
    assert complete['AMENT_PREFIX_PATH'] == str(script.parent)
    assert complete['TWO_LINES'] == 'a\nb'
    assert complete['PATH'] == '/ros/bin:/usr/bin:/bin'

    ros_environment.record(tmp_path, complete, BARE)
    recorded = json.loads((tmp_path / ros_environment.RECORD).read_text())
    assert recorded == {
        'AMENT_PREFIX_PATH': str(script.parent),
        'PATH': '/ros/bin',
        'ROS_DISTRO': 'jazzy',
        'TWO_LINES': 'a\nb',
    }
    assert ros_environment.completed(BARE, recorded).items() >= recorded.items() - {
        ('PATH', '/ros/bin')
    }


def test_script_that_fails_is_not_passed_over(tmp_path):
    script = tmp_path / 'setup.bash'
    script.write_text('return 3\n')
    with pytest.raises(subprocess.CalledProcessError):
        ros_environment.sourced(script, BARE)


def test_wheels_bring_their_libraries_in_a_fixed_order(tmp_path):
    site = tmp_path / 'lib' / 'python3.12' / 'site-packages'
    for name in ('ros_rclpy.libs', 'ros_rcl.libs', 'numpy.libs'):
        (site / name).mkdir(parents=True)
    variables = ros_environment.wheels(tmp_path)
    assert variables['LD_LIBRARY_PATH'].split(':') == [
        str(tmp_path / 'lib'),
        str(site / 'ros_rcl.libs'),
        str(site / 'ros_rclpy.libs'),
    ]


@pytest.fixture
def restarts(tmp_path, monkeypatch):
    """Calls of execve, for an environment of which one variable was recorded."""
    calls = []
    (tmp_path / ros_environment.RECORD).write_text('{"AMENT_PREFIX_PATH": "/suite"}')
    monkeypatch.setattr(sys, 'prefix', str(tmp_path))
    monkeypatch.setattr(sys, 'orig_argv', ['python', '-m', 'pytest'])
    monkeypatch.setattr(os, 'execve', lambda *arguments: calls.append(arguments))
    monkeypatch.setenv('AMENT_PREFIX_PATH', '/other')
    return calls


def test_incomplete_environment_starts_the_interpreter_once_more(restarts, monkeypatch):
    ros_environment.enter()
    [(path, arguments, environment)] = restarts
    assert path == sys.executable
    assert arguments == [sys.executable, '-m', 'pytest']
    assert environment['AMENT_PREFIX_PATH'] == '/suite:/other'

    monkeypatch.setenv('AMENT_PREFIX_PATH', environment['AMENT_PREFIX_PATH'])
    ros_environment.enter()
    assert len(restarts) == 1


def test_colcons_script_sees_the_shells_own_environment(restarts, monkeypatch):
    script = '/ws/install/_local_setup_util_sh.py'
    monkeypatch.setattr(sys, 'orig_argv', ['python3', script, 'sh'])
    ros_environment.enter()
    assert restarts == []


def test_without_a_record_nothing_happens(restarts, tmp_path):
    (tmp_path / ros_environment.RECORD).unlink()
    ros_environment.enter()
    assert restarts == []


def test_interpreter_needs_nothing_sourced():
    code = 'import rclpy, traction_interfaces.msg as m; print(m.SlipEstimate(slip=[0.25]).slip[0])'
    result = subprocess.run(
        [sys.executable, '-c', code], env=BARE, capture_output=True, text=True, check=True
    )
    assert result.stdout == '0.25\n'
    assert result.stderr == ''


def test_sourcing_the_workspace_finds_every_package():
    packages = [path.parent.name for path in ROOT.glob('ros2_ws/src/*/package.xml')]
    found = ros_environment.sourced(ROOT / 'ros2_ws' / 'install' / 'setup.bash', BARE)
    prefixes = found['AMENT_PREFIX_PATH'].split(':')
    assert {Path(prefix).name for prefix in prefixes} >= set(packages)
