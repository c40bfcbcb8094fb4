"""Fixtures of several test modules."""

import subprocess

import pytest

from traction_node.probe import executable


@pytest.fixture(scope='session')
def traction():
    """Run the command `traction` in a process; returns exit status and output."""

    def run(*arguments):
        done = subprocess.run(
            [str(executable('traction_bringup', 'traction')), *map(str, arguments)],
            capture_output=True,
            text=True,
            timeout=240,
        )
        return done.returncode, done.stdout + done.stderr

    return run
