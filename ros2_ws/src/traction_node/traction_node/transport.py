"""How messages go from process to process: by UDP, never through shared memory.

On one machine Fast DDS prefers shared memory. A process that is killed or stopped while it holds
the lock of a queue there keeps all who send to it waiting for a second: torque would come that
much too late. UDP keeps nobody waiting.
"""

import os
from collections.abc import MutableMapping
from pathlib import Path

from ament_index_python.packages import get_package_share_directory

_RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
_TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'
_PROFILES = 'FASTRTPS_DEFAULT_PROFILES_FILE'


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
