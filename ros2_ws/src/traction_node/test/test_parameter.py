"""Parameters: accepted values, and errors."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from traction_node.parameter import NodeParameter, ParameterError, resolve

TORQUE = NodeParameter(
    'torque_max',
    default=800.0,
    description='limit',
    unit='N·m',
    minimum=0.0,
    maximum=5000.0,
)
WHEELS = NodeParameter(
    'wheel_names',
    default=['left', 'right'],
    description='wheels',
)
RADII = NodeParameter(
    'radius',
    default=[0.5, 0.6],
    description='radii',
    unit='m',
    minimum=0.1,
)
MODE = NodeParameter(
    'mode',
    default='limit',
    description='mode',
    choices=('limit', 'hold'),
)
COUNT = NodeParameter(
    'count',
    default=3,
    description='number of wheels',
    minimum=1,
)
SWITCH = NodeParameter(
    'autostart',
    default=False,
    description='start',
)


def test_integer_for_a_number_becomes_a_float():
    value = TORQUE.check(750)
    assert value == 750.0
    assert type(value) is float


def test_lists_become_tuples_of_the_right_type():
    assert WHEELS.check(['a', 'b', 'c']) == ('a', 'b', 'c')
    assert RADII.check([1, 0.5]) == (1.0, 0.5)
    assert all(type(radius) is float for radius in RADII.check([1, 2]))


@pytest.mark.parametrize(
    ('parameter', 'value', 'reason'),
    [
        (TORQUE, 5000.1, 'parameter "torque_max" = 5000.1 N·m is out of range: 0 .. 5000 N·m'),
        (TORQUE, -1, 'parameter "torque_max" = -1 N·m is out of range: 0 .. 5000 N·m'),
        (TORQUE, float('nan'), 'parameter "torque_max" = nan N·m is not finite'),
        (TORQUE, float('inf'), 'parameter "torque_max" = inf N·m is not finite'),
        (TORQUE, 'high', 'parameter "torque_max" = \'high\' should be a number in N·m'),
        (TORQUE, True, 'parameter "torque_max" = True should be a number in N·m'),
        (TORQUE, None, 'parameter "torque_max" = None should be a number in N·m'),
        (COUNT, 0, 'parameter "count" = 0 is out of range: at least 1'),
        (COUNT, 2.0, 'parameter "count" = 2.0 should be an integer'),
        (COUNT, True, 'parameter "count" = True should be an integer'),
        (SWITCH, 1, 'parameter "autostart" = 1 should be a boolean'),
        (MODE, 'hodl', 'parameter "mode" = \'hodl\' is not one of limit, hold'),
        (WHEELS, 'left', 'parameter "wheel_names" = \'left\' should be a list, each entry a text'),
        (WHEELS, ['left', 1], 'parameter "wheel_names" = [\'left\', 1] should be a list'),
        (WHEELS, [], 'parameter "wheel_names" needs at least one entry'),
        (RADII, [0.5, 0.05], 'parameter "radius" = [0.5, 0.05] m is out of range: at least 0.1 m'),
    ],
)
def test_refusal_names_parameter_value_range_and_unit(parameter, value, reason):
    with pytest.raises(ParameterError) as refusal:
        parameter.check(value)
    assert str(refusal.value).startswith(reason)


@given(st.floats() | st.integers() | st.text() | st.none() | st.booleans() | st.lists(st.floats()))
def test_whatever_is_accepted_is_a_float_in_range(value):
    try:
        accepted = TORQUE.check(value)
    except ParameterError:
        return
    assert type(accepted) is float
    assert 0.0 <= accepted <= 5000.0


def test_default_must_keep_to_its_own_rules():
    with pytest.raises(ParameterError, match='out of range'):
        NodeParameter(
            'slip',
            default=1.5,
            description='slip',
            maximum=1.0,
        )
    with pytest.raises(ParameterError, match='no type'):
        NodeParameter(
            'names',
            default=[],
            description='names',
        )


def test_resolve_takes_overrides_and_keeps_defaults():
    values = resolve([TORQUE, MODE], {'mode': 'hold', 'use_sim_time': True}, ['use_sim_time'])
    assert values == {'torque_max': 800.0, 'mode': 'hold'}


def test_resolve_names_the_closest_parameter():
    with pytest.raises(ParameterError) as refusal:
        resolve([TORQUE, MODE], {'torque_maximum': 1.0})
    assert str(refusal.value) == (
        'there is no parameter "torque_maximum"; did you mean "torque_max"?'
    )
    with pytest.raises(ParameterError) as refusal:
        resolve([TORQUE, MODE], {'zzz': 1.0})
    assert str(refusal.value) == 'there is no parameter "zzz"'
