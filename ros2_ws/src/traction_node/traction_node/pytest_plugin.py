"""Pytest plugin: a separate ROS domain for every test run, and a mark for tests of processes.

With pytest-xdist, every worker has a separate domain, so tests of processes can run in parallel.

Pytest loads it wherever this package is installed. So the tests of a package run the same way from
its folder, under `colcon test` and from the root of the repository. A user's `ROS_DOMAIN_ID` is
kept. `-p no:traction_node` disables the plugin.
"""

import os
from typing import Any

import pytest

from traction_node.transport import keep_local, use_udp

STARTERS = {'NodeProcess', 'Probe', 'RunningSystem'}
"""Names that start nodes; a test module with one of them has tests of processes."""

_OWN_DOMAIN = 'traction_node_own_domain'
_TAKEN = pytest.StashKey[bool]()


def pytest_configure(config: pytest.Config) -> None:
    """Restrict messages to this machine, and declare the mark."""
    worker = getattr(config, 'workerinput', {})
    # The workers of pytest-xdist inherit the environment of the run that started them.
    if 'ROS_DOMAIN_ID' not in os.environ or worker.get(_OWN_DOMAIN):
        keep_local()
        config.stash[_TAKEN] = True
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    use_udp()
    config.addinivalue_line(
        'markers', 'process: with real processes, which keep times and take the machine'
    )


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """Tell a worker of pytest-xdist to take its own domain, unless the user has chosen one."""
    node.workerinput[_OWN_DOMAIN] = node.config.stash.get(_TAKEN, False)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of modules that start nodes."""
    for item in items:
        if isinstance(item, pytest.Function) and STARTERS & vars(item.module).keys():
            item.add_marker('process')
