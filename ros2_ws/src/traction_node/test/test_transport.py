"""Transports and domains by environment variable."""

import os
import subprocess
import sys
from pathlib import Path

from traction_node.transport import use_udp


def test_udp_alone_unless_the_user_has_chosen():
    for chosen in ({}, {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}):
        environment = dict(chosen)
        use_udp(environment)
        assert environment == {**chosen, 'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}
    environment = {'FASTDDS_BUILTIN_TRANSPORTS': 'LARGE_DATA'}
    use_udp(environment)
    assert environment == {'FASTDDS_BUILTIN_TRANSPORTS': 'LARGE_DATA'}


def test_this_machine_only_goes_by_a_profile_unless_the_user_has_one():
    environment = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    use_udp(environment)
    assert environment['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'SYSTEM_DEFAULT'
    profile = Path(environment['FASTRTPS_DEFAULT_PROFILES_FILE']).read_text(encoding='utf-8')
    assert '<address>127.0.0.1</address>' in profile
    # The same in a child that is told once more to stay on this machine.
    child = {**environment, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    use_udp(child)
    assert child == environment
    mine = {
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'FASTRTPS_DEFAULT_PROFILES_FILE': 'mine.xml',
    }
    environment = dict(mine)
    use_udp(environment)
    assert environment == {**mine, 'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}


def test_processes_that_run_at_once_get_a_domain_each_and_none_that_of_the_environment():
    program = (
        'import os, sys; from traction_node.transport import keep_local; keep_local(); '
        'print(os.environ["ROS_DOMAIN_ID"], os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"], '
        'flush=True); sys.stdin.read()'
    )
    running = [
        subprocess.Popen(
            [sys.executable, '-c', program],
            env={**os.environ, 'ROS_DOMAIN_ID': '7'},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(5)
    ]
    said = [process.stdout.readline().split() for process in running]
    for process in running:
        process.communicate(timeout=30.0)
    assert {reach for _, reach in said} == {'LOCALHOST'}
    domains = {int(domain) for domain, _ in said}
    assert len(domains) == len(running)
    assert domains <= set(range(1, 101)) - {7}
