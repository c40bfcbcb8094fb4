"""Transports by environment variable."""

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
    mine = {
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'FASTRTPS_DEFAULT_PROFILES_FILE': 'mine.xml',
    }
    environment = dict(mine)
    use_udp(environment)
    assert environment == {**mine, 'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}
