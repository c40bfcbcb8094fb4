"""Fixtures of several test modules."""

import subprocess

import pytest

from traction_node.probe import executable

WHOLE_SUITE = {
    'tests/test_bag_nodes.py',
    'tests/test_can_system.py',
    'tests/test_demo.py',
    'tests/test_faults.py',
    'tests/test_faults_of_the_bus.py',
    'tests/test_system.py',
}
"""Modules that run all nodes in real time."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Give all modules of `WHOLE_SUITE` to one worker of `pytest -n 2 --dist loadfile`.

    All nodes together take most of a core: on two cores they cannot run twice in real time.
    """
    if config.getvalue('dist') != 'loadfile':
        return None
    from xdist.scheduler import LoadFileScheduling

    class OneSuiteAtATime(LoadFileScheduling):
        def _split_scope(self, nodeid):
            module = super()._split_scope(nodeid)
            return 'whole suite' if module in WHOLE_SUITE else module

    return OneSuiteAtATime(config, log)


@pytest.fixture(scope='session')
def traction():
    """Run the command `traction` in a process; returns exit status and output."""

    def run(*arguments):
        done = subprocess.run(
            [str(executable('traction_bringup', 'traction')), *map(str, arguments)],
            capture_output=True,
            text=True,
            timeout=600,
        )
        return done.returncode, done.stdout + done.stderr

    return run
