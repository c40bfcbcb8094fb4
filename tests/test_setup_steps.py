"""Set-up: steps, skipped steps, and messages of failures."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
import setup

ROOT = Path(__file__).resolve().parents[1]
SETUP = ROOT / 'tools' / 'setup.sh'


@pytest.fixture
def checkout(tmp_path):
    """A checkout with requirements and one package, nothing set up."""
    (tmp_path / 'requirements').mkdir()
    for name in ('python', 'ros'):
        (tmp_path / 'requirements' / f'{name}.txt').write_text('six==1.17.0\n')
    package = tmp_path / 'ros2_ws' / 'src' / 'one'
    (package / 'test').mkdir(parents=True)
    (package / 'package.xml').write_text('<package/>')
    return tmp_path


@pytest.fixture
def ros(tmp_path):
    """An installed ROS, as far as set-up looks at it."""
    prefix = tmp_path / 'ros'
    prefix.mkdir()
    (prefix / 'setup.bash').write_text(
        f'export AMENT_PREFIX_PATH={prefix} PYTHONPATH={prefix}/python ROS_DISTRO=jazzy\n'
    )
    return prefix


class Recorded(setup.Setup):
    """Set-up that writes its commands down instead of running them."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.commands = []
        self.environments = {}

    def command(self, what, command, environment, cwd=None):
        self.commands.append(list(map(str, command)))
        self.environments[what] = environment


def test_wheels_are_installed_where_there_is_no_ros(checkout):
    steps = Recorded(checkout, None, 'python3.12')
    steps.make_venv()
    steps.install(steps.requirements())
    steps.relocate()
    venv, install, relocate = steps.commands
    assert venv == ['python3.12', '-m', 'venv', str(checkout / '.venv')]
    assert [Path(name).name for name in install if name.endswith('.txt')] == [
        'python.txt',
        'ros.txt',
    ]
    assert relocate[1].endswith('tools/relocate.py')


def test_installed_ros_is_used(checkout, ros, monkeypatch):
    monkeypatch.setenv('AMENT_PREFIX_PATH', '/opt/ros/other')  # sourced by the user before
    steps = Recorded(checkout, ros, '/usr/bin/python3')
    steps.make_venv()
    steps.install(steps.requirements())
    steps.relocate()
    venv, install = steps.commands
    assert '--system-site-packages' in venv
    assert [Path(name).name for name in install if name.endswith('.txt')] == ['python.txt']
    variables = steps.ros_variables()
    assert variables['AMENT_PREFIX_PATH'] == str(ros)
    assert variables['PYTHONPATH'] == f'{ros}/python'
    assert 'AMENT_PREFIX_PATH' not in steps.environments['making .venv']


def test_environment_of_an_installed_ros_is_recorded_with_the_workspace(checkout, ros):
    steps = Recorded(checkout, ros, sys.executable)
    site = checkout / '.venv' / 'lib' / 'python3.12' / 'site-packages'
    install = checkout / 'ros2_ws' / 'install'
    for folder in (site, install, checkout / '.venv' / 'bin'):
        folder.mkdir(parents=True)
    (install / 'local_setup.bash').write_text(
        f'export AMENT_PREFIX_PATH={install}/one:$AMENT_PREFIX_PATH\n'
    )
    steps.record_environment()
    recorded = (checkout / '.venv' / setup.ros_environment.RECORD).read_text()
    assert f'"AMENT_PREFIX_PATH": "{install}/one:{ros}"' in recorded
    assert f'"PYTHONPATH": "{ros}/python"' in recorded
    assert (site / '_ros_environment.pth').exists()
    traction = (checkout / '.venv' / 'bin' / 'traction').read_text()
    assert f'{install}/traction_bringup/lib/traction_bringup/traction' in traction


def test_only_changed_and_failed_packages_are_built_again(checkout):
    steps = Recorded(checkout, None, 'python3.12')
    steps.venv.mkdir()
    steps.stamps = {}

    def built(name, status):
        folder = checkout / 'ros2_ws' / 'build' / name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / 'colcon_build.rc').write_text(f'{status}\n')

    def colcon(what, command, environment, cwd):
        start = command.index('--packages-select') + 1
        names = command[start : command.index('--cmake-args')]
        steps.commands.append(names)
        for name in names:
            built(name, 1 if name == 'bad' else 0)

    steps.command = colcon
    steps.build({'bad': 'a', 'one': 'a', 'two': 'a'})
    steps.build({'bad': 'a', 'one': 'a', 'two': 'b'})
    installed = checkout / 'ros2_ws' / 'install' / 'one'
    installed.mkdir(parents=True)
    steps.build({'bad': 'a', 'two': 'b'})
    assert steps.commands == [['bad', 'one', 'two'], ['bad', 'two'], ['bad']]
    assert not installed.exists()  # gone from the sources, so gone from the workspace


def test_digest_follows_sources_and_not_tests(checkout):
    package = checkout / 'ros2_ws' / 'src' / 'one'
    before = setup.digest(package)
    (package / 'test' / 'test_one.py').write_text('')
    (package / '__pycache__').mkdir()
    (package / '__pycache__' / 'one.pyc').write_text('')
    assert setup.digest(package) == before
    (package / 'one.py').write_text('')
    assert setup.digest(package) != before


def test_step_is_done_again_only_with_other_ingredients(checkout):
    steps = Recorded(checkout, None, 'python3.12')
    steps.venv.mkdir()
    steps.stamps = {}
    done = []
    for key in ('a', 'a', 'b'):
        steps.step(1, 'step', key, lambda key=key: done.append(key))
    assert done == ['a', 'b']


def test_step_that_failed_is_not_taken_for_done(checkout):
    steps = Recorded(checkout, None, 'python3.12')
    steps.venv.mkdir()
    steps.stamps = {}

    def fail():
        raise setup.SetupError('no')

    with pytest.raises(setup.SetupError):
        steps.step(1, 'step', 'a', fail)
    assert steps.stamps == {}


@pytest.mark.parametrize(
    ('output', 'line'),
    [
        (
            'ERROR: Could not install: [Errno 28] No space left on device',
            'x: no space left on the disk; free 3 GB and try again',
        ),
        (
            'WARNING: Retrying after connection broken by NewConnectionError(...)\n'
            'ERROR: No matching distribution found for numpy==2.4.6',
            'x: the package index cannot be reached; check the network connection',
        ),
        (
            'ERROR: No matching distribution found for numpy==2.4.6',
            'x: the package index has no numpy==2.4.6 for this Python and machine',
        ),
        (
            'Failed   <<< one [0.62s, exited with code 1]\nAborted  <<< two\n',
            'x: one does not build',
        ),
        ('...\nfatal error: Python.h\nstop', 'x: fatal error: Python.h'),
        ('', 'x: failed'),
    ],
)
def test_failure_is_one_line(output, line):
    assert setup.failure('x', output) == line


def test_index_that_cannot_be_reached_is_said_in_one_line(checkout):
    steps = setup.Setup(checkout, None, sys.executable)
    steps.venv.mkdir()
    steps.started, steps.line = time.monotonic(), ''
    steps.python = sys.executable
    # Port 1 of this machine: no listener.
    steps.clean |= {
        'PIP_CONFIG_FILE': os.devnull,
        'PIP_INDEX_URL': 'http://127.0.0.1:1/simple',
        'PIP_NO_CACHE_DIR': '1',
        'PIP_RETRIES': '1',
    }
    steps.clean.pop('PIP_FIND_LINKS', None)
    (checkout / 'requirements' / 'python.txt').write_text('numpy==0.0.1\n')
    with pytest.raises(setup.SetupError) as refusal:
        steps.install(steps.requirements())
    assert str(refusal.value) == (
        'installing packages: the package index cannot be reached; check the network connection '
        '(details in .venv/setup.log)'
    )


def test_missing_compiler_is_said_before_anything_else(checkout, monkeypatch):
    monkeypatch.delenv('CXX', raising=False)
    monkeypatch.setattr(shutil, 'which', lambda name: None)
    with pytest.raises(setup.SetupError) as refusal:
        setup.Setup(checkout, None, sys.executable).run()
    assert str(refusal.value).startswith('no C++ compiler (c++ or g++ or clang++): install')
    assert not (checkout / '.venv').exists()


def test_space_in_the_folders_name_is_said_before_anything_else(tmp_path):
    root = tmp_path / 'my suite'
    with pytest.raises(setup.SetupError) as refusal:
        setup.Setup(root, None, sys.executable).run()
    assert 'my suite" contains a space' in str(refusal.value)


def test_full_disk_is_said_before_anything_is_downloaded(checkout, monkeypatch):
    full = shutil._ntuple_diskusage(100e9, 99e9, 1.2e9)
    monkeypatch.setattr(shutil, 'disk_usage', lambda path: full)
    steps = Recorded(checkout, None, sys.executable)
    with pytest.raises(setup.SetupError) as refusal:
        steps.make_venv()
    assert str(refusal.value) == '1.2 GB left on the disk; 3 GB are needed'
    assert steps.commands == []


def interpreter(tmp_path, name, script):
    """An executable that stands for a Python."""
    path = tmp_path / name
    path.write_text(f'#!/bin/sh\n{script}\n')
    path.chmod(0o755)
    return path


def test_too_old_a_python_is_one_line(tmp_path):
    # Called as `python -S -c CODE`: make it believe that it is 3.8.
    old = interpreter(
        tmp_path,
        'python3.8',
        f'exec {sys.executable} -S -c "import sys; sys.version_info = (3, 8, 1); $3"',
    )
    result = subprocess.run(['sh', SETUP, old], capture_output=True, text=True, check=False)
    assert result.returncode == 1
    assert result.stderr == (
        f'setup: {old} is Python 3.8; 3.11, 3.12 or 3.13 is needed '
        '(make setup PYTHON=/path/to/python3.12 chooses another)\n'
    )
    assert result.stdout == ''


@pytest.mark.parametrize(
    ('script', 'reason'),
    [
        ('echo "shim: not installed" >&2; exit 127', 'shim: not installed'),
        ('exit 1', 'does not run'),
    ],
)
def test_command_that_is_no_python_is_one_line(tmp_path, script, reason):
    shim = interpreter(tmp_path, 'python3.12', script)
    result = subprocess.run(['sh', SETUP, shim], capture_output=True, text=True, check=False)
    assert result.returncode == 1
    assert result.stderr.startswith(f'setup: {shim} {reason} (make setup PYTHON=')
    absent = tmp_path / 'python9'
    result = subprocess.run(['sh', SETUP, absent], capture_output=True, text=True, check=False)
    assert result.stderr.startswith(f'setup: {absent} is not there (make setup PYTHON=')


def test_second_run_has_nothing_to_do_and_is_quick():
    start = time.monotonic()
    result = subprocess.run(['sh', SETUP], capture_output=True, text=True, check=True)
    assert result.stdout == 'setup: up to date\n'
    assert time.monotonic() - start < 3.0


def test_pins_are_exact_and_each_package_is_pinned_once():
    pins = [
        line
        for path in sorted(ROOT.glob('requirements/*.txt'))
        for line in path.read_text().splitlines()
        if line and not line.startswith('#')
    ]
    assert all('==' in pin for pin in pins)
    names = [pin.partition('==')[0] for pin in pins]
    assert len(names) == len(set(names))
