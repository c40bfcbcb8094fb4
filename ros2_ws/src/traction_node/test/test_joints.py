"""Values of joints are put in order, and bad ones are named."""

import math

import pytest

from traction_node.joints import JointOrder


def test_values_come_in_the_receivers_order_and_others_are_passed_over():
    order = JointOrder(['rl', 'rr'])
    assert order.values(['fl', 'rr', 'rl'], [1.0, 2.0, 3.0], 'torque') == [3.0, 2.0]
    # Another order in the next message.
    assert order.values(['rl', 'rr'], [4.0, 5.0], 'torque') == [4.0, 5.0]


@pytest.mark.parametrize(
    ('names', 'values', 'said'),
    [
        (['rl'], [1.0], "torque: 'rr' is missing"),
        (['rl', 'rr', 'rl'], [1.0, 2.0, 3.0], "'rl' is given twice"),
        (['rl', 'rr'], [1.0], '1 values for 2 names'),
        (['rl', 'rr'], [1.0, math.nan], "'rr' is nan"),
        (['rl', 'rr'], [-math.inf, 1.0], "'rl' is -inf"),
    ],
)
def test_a_bad_message_is_refused_by_name(names, values, said):
    with pytest.raises(ValueError, match=said):
        JointOrder(['rl', 'rr']).values(names, values, 'torque')
