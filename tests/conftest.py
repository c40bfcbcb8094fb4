"""What several test modules share."""

import subprocess

import pytest

from traction_node.probe import executable


@pytest.fixture(scope='session')
def traction():
    """The command `traction` in a process of its own: gives exit status and all it printed."""

    def run(*arguments):
        done = subprocess.run(
            [str(executable('traction_bringup', 'traction')), *map(str, arguments)],
            capture_output=True,
            text=True,
            timeout=240,
        )
        return done.returncode, done.stdout + done.stderr

    return run
