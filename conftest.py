"""Process tests that ran into a time-out are tried a second time, and no others."""

import pytest


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items):
    """Mark the tests that the plugin of traction_node marks as those of processes.

    A machine that stalls for seconds, or a message that DDS loses while two processes first meet,
    shows as a time-out; the report says which test was tried again.
    """
    again = pytest.mark.flaky(reruns=1, only_rerun=['TimeoutError', 'TimeoutExpired'])
    for item in items:
        if item.get_closest_marker('process'):
            item.add_marker(again)
