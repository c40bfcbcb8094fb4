"""Diagnostics: detection of changes, and texts of values."""

from traction_node.diagnostic import OK, WARN, Diagnostic, text


def test_only_a_new_level_or_message_is_news():
    state = Diagnostic()
    assert state.change(WARN, 'torque limited', {'wheel': 'left'})
    assert not state.change(WARN, 'torque limited', {'wheel': 'right'})
    assert state.values == {'wheel': 'right'}
    assert state.change(WARN, 'command stale', {})
    assert state.change(OK, 'command stale', {})


def test_values_as_people_read_them():
    assert text(True) == 'true'
    assert text(0.123456789) == '0.123457'
    assert text(float('nan')) == 'nan'
    assert text(('left', 1.5, 3)) == 'left, 1.5, 3'
