"""`colcon test` finds the tests of every Python package of the workspace."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

WORKSPACE = Path(__file__).resolve().parents[1] / 'ros2_ws'
PACKAGES = sorted(path.parent.name for path in WORKSPACE.glob('src/*/setup.py'))


@pytest.fixture(scope='module')
def logs(tmp_path_factory):
    """Folder with the output of `colcon test` for each package; tests are collected, not run."""
    folder = tmp_path_factory.mktemp('colcon')
    done = subprocess.run(
        [
            str(Path(sys.prefix, 'bin', 'colcon')),
            *('--log-base', str(folder / 'log')),
            *('test', '--packages-select', *PACKAGES),
            *('--test-result-base', str(folder / 'result')),
            *('--pytest-args', '--collect-only', '--quiet'),
        ],
        cwd=WORKSPACE,
        capture_output=True,
        text=True,
        timeout=900.0,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / 'log' / 'latest_test'


@pytest.mark.parametrize('package', PACKAGES)
def test_colcon_finds_the_tests_of(package, logs):
    said = (logs / package / 'stdout_stderr.log').read_text(encoding='utf-8')
    found = re.search(r'(\d+)(?:/\d+)? tests? collected', said)
    assert found, said
    modules = list((WORKSPACE / 'src' / package / 'test').glob('test_*.py'))
    # At least one of each module.
    assert int(found.group(1)) >= len(modules) > 0
    for module in modules:
        assert module.name in said, module.name
