"""Values of joints are put in order, and bad ones are named."""

import math

import pytest

from traction_node.joints import JointError, JointOrder


def test_values_come_in_the_receivers_order_and_others_are_passed_over():
    order = JointOrder(['rl', 'rr'], 'torque')
    assert order.values(['fl', 'rr', 'rl'], [1.0, 2.0, 3.0]) == [3.0, 2.0]
    # Another order in the next message.
    assert order.values(['rl', 'rr'], [4.0, 5.0]) == [4.0, 5.0]


def test_one_value_without_a_name_may_be_for_all():
    order = JointOrder(['rl', 'rr'], 'torque', one_for_all=True)
    assert order.values([], [3.0]) == [3.0, 3.0]
    assert order.values(['rr', 'rl'], [1.0, 2.0]) == [2.0, 1.0]
    with pytest.raises(JointError, match="'rl' is missing"):
        order.values([], [1.0, 2.0])


@pytest.mark.parametrize(
    ('names', 'values', 'cause', 'said'),
    [
        ([], [], 'names', "torque: joint 'rl' is missing"),
        (['rl'], [1.0], 'names', "torque: joint 'rr' is missing"),
        (['rl', 'rr', 'rl'], [1.0, 2.0, 3.0], 'names', "joint 'rl' is given twice"),
        (['rl', 'rr', 'xx'], [1.0, 2.0, 3.0], 'names', "unknown joint 'xx'"),
        (['rl', 'rr'], [1.0], 'length', '1 values for 2 joints'),
        (['rl', 'rr'], [1.0, math.nan], 'not_finite', "torque of joint 'rr' is nan"),
        (['rl', 'rr'], [-math.inf, 1.0], 'not_finite', "torque of joint 'rl' is -inf"),
    ],
)
def test_a_bad_message_is_refused_by_name(names, values, cause, said):
    with pytest.raises(JointError, match=said) as refusal:
        JointOrder(['rl', 'rr'], 'torque', only=True).values(names, values)
    assert refusal.value.cause == cause
