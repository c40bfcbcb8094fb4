"""Limits of YAML texts, and what is said of a file that cannot be read."""

import pytest

from traction_node import bounded_yaml
from traction_node.bounded_yaml import (
    DEEPEST,
    LONGEST_SCALAR,
    BoundedYamlError,
    load_yaml,
    read_text,
    read_yaml,
)

# Values: the mapping, 'a', its list and two numbers, 'b', its list and twice that of 'a'.
ALIASES = 'a: &a [1, 2]\nb: [*a, *a]'
VALUES = 1 + 1 + 3 + 1 + 1 + 2 * 3


def nested(levels):
    return levels * '[' + levels * ']'


def test_aliases_count_as_what_they_stand_for(monkeypatch):
    monkeypatch.setattr(bounded_yaml, 'MAX_VALUES', VALUES)
    assert load_yaml(ALIASES) == {'a': [1, 2], 'b': [[1, 2], [1, 2]]}
    monkeypatch.setattr(bounded_yaml, 'MAX_VALUES', VALUES - 1)
    with pytest.raises(BoundedYamlError, match=f'^line 2: more than {VALUES - 1} values$'):
        load_yaml(ALIASES)


def test_text_up_to_its_limits_is_read(monkeypatch):
    assert str(load_yaml(nested(DEEPEST))) == nested(DEEPEST)
    assert load_yaml(LONGEST_SCALAR * 'x') == LONGEST_SCALAR * 'x'
    # What is quoted is no number.
    assert load_yaml(f'"{2 * LONGEST_SCALAR * "9"}"') == 2 * LONGEST_SCALAR * '9'
    monkeypatch.setattr(bounded_yaml, 'LONGEST_TEXT', 5)
    assert load_yaml('12345') == 12345
    with pytest.raises(BoundedYamlError, match='more than 5 characters'):
        load_yaml('123456')


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        (nested(DEEPEST + 1), 'line 1: nested deeper than 32 levels'),
        ('a: 1\nb: ' + (LONGEST_SCALAR + 1) * '9', 'line 2: value of more than 3000 characters'),
        ('a: &a {b: *a}', r'line 1: \*a stands within itself'),
        ('a: *x', 'not valid YAML: found undefined alias'),
        ('[', 'not valid YAML: '),
        ('!!int x', 'not valid YAML: a value cannot be read: ValueError'),
        ('!!python/object/apply:os.getcwd []', 'not valid YAML: could not determine a constr'),
    ],
)
def test_refusal_says_why_in_one_line(text, said):
    with pytest.raises(BoundedYamlError, match=f'^{said}') as error:
        load_yaml(text)
    assert '\n' not in str(error.value)


def test_file_that_cannot_be_read_is_named(tmp_path):
    path = tmp_path / 'some.yaml'
    with pytest.raises(BoundedYamlError, match=r'some\.yaml: No such file'):
        read_text(path)
    path.write_bytes(b'\xff\xfe')
    with pytest.raises(BoundedYamlError, match=r'some\.yaml: not text: '):
        read_yaml(path)
    path.write_text('[')
    with pytest.raises(BoundedYamlError, match=r'some\.yaml: not valid YAML: '):
        read_yaml(path)


def test_mark_of_spreadsheets_is_passed_over(tmp_path):
    path = tmp_path / 'some.yaml'
    path.write_text('a: 1', encoding='utf-8-sig')
    assert read_yaml(path) == {'a': 1}
