"""The table of topics: every row can be used as it stands."""

import pytest
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from traction_node.node import QOS as PROFILES
from traction_node.quality_of_service import QOS, Qos
from traction_node.topics import message_class, topic, topics


@pytest.mark.parametrize('row', topics().values(), ids=lambda row: row.name)
def test_row_names_a_message_and_a_quality_of_service(row):
    assert message_class(row.type).__name__ == row.type.rpartition('/')[2]
    assert row.qos in QOS
    assert row.rate >= 0.0


def test_profiles_of_rclpy_say_the_same():
    found = {
        name: Qos(
            profile.reliability == ReliabilityPolicy.RELIABLE,
            profile.durability == DurabilityPolicy.TRANSIENT_LOCAL,
            profile.depth,
        )
        for name, profile in PROFILES.items()
    }
    assert found == QOS


def test_only_diagnostics_are_outside_the_namespace():
    assert [name for name in topics() if name.startswith('/')] == ['/diagnostics']


def test_unknown_topic_is_named():
    with pytest.raises(KeyError, match='no topic "wheel_state"'):
        topic('wheel_state')
