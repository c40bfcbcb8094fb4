"""Where every test of the repository runs: a ROS domain of its own that stays on this machine."""

import os

import pytest

from traction_node.transport import use_udp

# Kept if set. Domains 1..101 are those whose ports no other programme is given by Linux.
os.environ.setdefault('ROS_DOMAIN_ID', str(1 + os.getpid() % 101))
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
use_udp()

# What starts nodes; a test module that uses one of these is one of real processes.
STARTERS = {'NodeProcess', 'Probe', 'RunningSystem', 'FaultBench', 'BusBench'}


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark the tests with real processes: they keep times and want the machine to themselves.

    A machine that stalls for seconds, or a message that DDS loses while two processes first meet,
    shows as a time-out: such a test, and no other, is tried a second time, and the report says so.
    """
    again = pytest.mark.flaky(reruns=1, only_rerun=['TimeoutError', 'TimeoutExpired'])
    for item in items:
        if STARTERS & vars(item.module).keys():
            item.add_marker('process')
        if item.get_closest_marker('process'):
            item.add_marker(again)
