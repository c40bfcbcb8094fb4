"""Quality of service in the files of a bag: to and from the profiles that rosbag2 writes."""

from collections.abc import Mapping, Sequence
from typing import Any

from rosbags.interfaces import Qos as RosbagsQos
from rosbags.interfaces import QosDurability, QosReliability

from traction_node.bounded_yaml import load_yaml
from traction_node.quality_of_service import Qos
from tractor_io.bags.mcap_limits import whole_number
from tractor_io.bags.plain_yaml import dump_plain_yaml

# RMW_DURATION_INFINITE: how rosbag2 writes a deadline, lifespan or lease that is not set.
INFINITE = {'sec': 9223372036, 'nsec': 854775807}

CHANNEL_KEY = 'offered_qos_profiles'
"""Key of a channel's metadata in an MCAP file."""


def profile_of(qos: Qos) -> dict[str, Any]:
    """Profile of rosbag2 for a quality of service.

    Parameters
    ----------
    qos : Qos
        Of the publisher.

    Returns
    -------
    dict
        As in metadata.yaml.
    """
    return {
        'history': 'keep_last',
        'depth': qos.depth,
        'reliability': 'reliable' if qos.reliable else 'best_effort',
        'durability': 'transient_local' if qos.latched else 'volatile',
        'deadline': INFINITE,
        'lifespan': INFINITE,
        'liveliness': 'automatic',
        'liveliness_lease_duration': INFINITE,
        'avoid_ros_namespace_conventions': False,
    }


def common_qos(profiles: Sequence[RosbagsQos]) -> Qos:
    """Quality of service that suits all publishers of a topic.

    Parameters
    ----------
    profiles : sequence of rosbags.interfaces.Qos
        One of each publisher; the default one where there is none.

    Returns
    -------
    Qos
        Reliable and latched if all publishers were; the longest queue.

    Raises
    ------
    ValueError
        If the depth of a queue is no whole number that a bag can hold.
    """
    if not profiles:
        return Qos()
    return Qos(
        reliable=all(p.reliability != QosReliability.BEST_EFFORT for p in profiles),
        latched=all(p.durability == QosDurability.TRANSIENT_LOCAL for p in profiles),
        depth=max(whole_number(profile.depth) for profile in profiles),
    )


def to_channel(qos: Qos) -> dict[str, str]:
    """Quality of service as metadata of a channel in an MCAP file.

    Parameters
    ----------
    qos : Qos
        Of the publisher.

    Returns
    -------
    dict of str to str
        One entry, YAML.
    """
    return {CHANNEL_KEY: dump_plain_yaml([profile_of(qos)])}


def from_channel(metadata: Mapping[str, str]) -> Qos:
    """Quality of service from the metadata of a channel.

    Parameters
    ----------
    metadata : mapping of str to str
        Of a channel in an MCAP file; may be damaged.

    Returns
    -------
    Qos
        The default one where it cannot be read.
    """
    try:
        (profile, *_) = load_yaml(metadata.get(CHANNEL_KEY, '')) or [{}]
        return Qos(
            reliable=profile.get('reliability', 'reliable') != 'best_effort',
            latched=profile.get('durability') == 'transient_local',
            depth=int(profile.get('depth', 10)),
        )
    except (TypeError, ValueError, OverflowError, AttributeError):
        return Qos()
