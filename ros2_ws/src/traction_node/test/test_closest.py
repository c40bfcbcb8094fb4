"""Hints at the name that was meant."""

from traction_node.closest import MAX_LISTED, closest, closest_name


def test_a_mistyped_name_gets_the_nearest_one():
    assert closest_name('tiemout', ['timeout', 'rate']) == 'timeout'
    assert closest('tiemout', ['rate', 'timeout']) == "; did you mean 'timeout'?"


def test_a_name_like_none_gets_the_list_in_order():
    assert closest_name('xyz', ['timeout', 'rate']) == ''
    # Unnamed columns of a table are no hint.
    assert closest('xyz', ['timeout', '', 'rate']) == '; there are: rate, timeout'


def test_what_is_no_name_and_what_is_too_long_is_no_trouble():
    assert closest(7, ['rate']) == '; there are: rate'
    assert closest('x' * 10**7, ['rate']) == '; there are: rate'
    many = [f'column {k:03d}' for k in range(1000)]
    assert closest('xyz', many) == '; there are: ' + ', '.join(many[:MAX_LISTED])
