"""Transport between processes: UDP without shared memory, and an unused ROS domain.

On one machine Fast DDS prefers shared memory. If a process is killed or stopped while it holds the
lock of a queue there, all senders to it wait for a second, and torque is late by this time. With
UDP senders do not wait.
"""

import contextlib
import itertools
import os
import random
from collections.abc import MutableMapping
from pathlib import Path

import domain_coordinator
from ament_index_python.packages import get_package_share_directory

_DOMAIN = 'ROS_DOMAIN_ID'
_RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
_TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'
_PROFILES = 'FASTRTPS_DEFAULT_PROFILES_FILE'

_taken = contextlib.ExitStack()
"""Reservation of a domain until the end of this process."""


def keep_local() -> None:
    """Set an unused ROS domain for this process and its children, on this machine only.

    The domain of the environment is not used, since a tractor may be in it. Domains are unique
    among processes that call this function or ROS's `domain_coordinator`.

    Raises
    ------
    RuntimeError
        If all domains are in use.
    """
    foreign = int(os.environ.get(_DOMAIN, '0'))
    # Linux does not assign the ports of domains 1..100 to other programs.
    free = [domain for domain in range(1, 101) if domain != foreign]
    random.SystemRandom().shuffle(free)
    candidates = itertools.cycle(free)
    domain = _taken.enter_context(domain_coordinator.domain_id(lambda: next(candidates)))
    os.environ[_DOMAIN] = str(domain)
    os.environ[_RANGE] = 'LOCALHOST'


def use_udp(environment: MutableMapping[str, str] = os.environ) -> None:
    """Restrict this process and its children to UDP, by environment variables.

    Call it before `rclpy.init`. Transports and profiles chosen by the user are kept.

    Parameters
    ----------
    environment : mutable mapping of str to str, optional
        Environment of the process.
    """
    share = Path(get_package_share_directory('traction_node'))
    loopback = str(share / 'config' / 'loopback.xml')
    # With LOCALHOST, rmw_fastrtps adds shared memory to all transports, unless the profile
    # restricts them to this machine. A parent process may have set that profile.
    if environment.get(_RANGE) == 'LOCALHOST' and environment.get(_PROFILES, loopback) == loopback:
        environment[_PROFILES] = loopback
        environment[_RANGE] = 'SYSTEM_DEFAULT'
    environment.setdefault(_TRANSPORTS, 'UDPv4')
