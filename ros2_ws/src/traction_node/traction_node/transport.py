"""Transport between processes: UDP, never shared memory; a ROS domain that nobody else uses.

On one machine Fast DDS prefers shared memory. A process that is killed or stopped while it holds
the lock of a queue there keeps all who send to it waiting for a second: torque would come that
much too late. UDP keeps nobody waiting.
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
"""Keeps a domain until this process ends."""


def keep_local() -> None:
    """Give this process and its children a ROS domain of their own, on this machine only.

    Not that of the environment: a tractor may be listening there. No two processes that ask here,
    or through ROS's own `domain_coordinator`, get the same.

    Raises
    ------
    RuntimeError
        If every domain is taken.
    """
    foreign = int(os.environ.get(_DOMAIN, '0'))
    # Domains 1..100 are those whose ports Linux gives to no other programme.
    free = [domain for domain in range(1, 101) if domain != foreign]
    random.SystemRandom().shuffle(free)
    candidates = itertools.cycle(free)
    domain = _taken.enter_context(domain_coordinator.domain_id(lambda: next(candidates)))
    os.environ[_DOMAIN] = str(domain)
    os.environ[_RANGE] = 'LOCALHOST'


def use_udp(environment: MutableMapping[str, str] = os.environ) -> None:
    """Set the environment of this process and its children so that they use UDP alone.

    Call it before `rclpy.init`. Transports and profiles that the user has chosen stay.

    Parameters
    ----------
    environment : mutable mapping of str to str, optional
        That of the process.
    """
    # With LOCALHOST, rmw_fastrtps adds shared memory to whatever transports are chosen, unless
    # the profile keeps to this machine.
    if environment.get(_RANGE) == 'LOCALHOST' and _PROFILES not in environment:
        share = Path(get_package_share_directory('traction_node'))
        environment[_PROFILES] = str(share / 'config' / 'loopback.xml')
        environment[_RANGE] = 'SYSTEM_DEFAULT'
    environment.setdefault(_TRANSPORTS, 'UDPv4')
