"""Parameter files: numbers, namespaces, wildcards, and errors."""

import pytest

from traction_node.parameter_file import (
    matches,
    node_parameters,
    parse,
    read_parameters,
    take_parameter_files,
)


@pytest.mark.parametrize(
    ('text', 'value'),
    [
        ('3e4', 30000.0),
        ('1e6', 1e6),
        ('-2.5E-3', -0.0025),
        ('+.5', 0.5),
        ('7', 7),
        ('-12', -12),
        # Octal and hexadecimal, as strtol reads them for rcl.
        ('010', 8),
        ('0x1F', 31),
        ('[1e3, 2]', [1000.0, 2]),
        # YAML 1.1 would make 5400 and a date of these.
        ('1:30', '1:30'),
        ('2026-01-31', '2026-01-31'),
        ('e5', 'e5'),
        ('true', True),
        ('"1e6"', '1e6'),
    ],
)
def test_values(text, value):
    found = parse(text)
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    ('pattern', 'node', 'expected'),
    [
        ('/gate', '/gate', True),
        ('/gate', '/tractor1/gate', False),
        ('/tractor1/gate', '/tractor1/gate', True),
        ('/**/gate', '/gate', True),
        ('/**/gate', '/a/b/gate', True),
        ('/**/gate', '/torque_gate', False),
        ('/*/gate', '/a/gate', True),
        ('/*/gate', '/a/b/gate', False),
        ('/**', '/a/b/gate', True),
        ('/*', '/a/gate', False),
    ],
)
def test_patterns(pattern, node, expected):
    assert matches(pattern, node) is expected


FILE = """
gate:
  ros__parameters: {timeout: 0.1}
/**:
  ros__parameters: {timeout: 0.3, machine_id: blue, filter: {cutoff: 2e1}}
tractor1:
  gate:
    ros__parameters:
      filter: {cutoff: 5}
"""


def test_what_is_for_one_node(tmp_path):
    path = tmp_path / 'robot.yaml'
    path.write_text(FILE)
    known = ['timeout', 'filter.cutoff']
    # Values by name override values for any node, in any order; machine_id is no parameter of the
    # gate.
    assert node_parameters(path, '/gate', known) == {'timeout': 0.1, 'filter.cutoff': 20.0}
    assert node_parameters(path, '/tractor1/gate', known) == {'timeout': 0.3, 'filter.cutoff': 5}
    assert read_parameters(path) == {
        'gate': {'timeout': 0.1, 'filter.cutoff': 5},
        '**': {'timeout': 0.3, 'machine_id': 'blue', 'filter.cutoff': 20.0},
    }


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('- a\n', 'expected node names'),
        ('', 'expected node names'),
        ('ros__parameters: {a: 1}\n', 'expected node names'),
        ('gate: 3\n', 'below /gate'),
        ('gate:\n  ros__parameters: [1]\n', '/gate: ros__parameters must be'),
        ('gate:\n  ros__parameters: {a: 1, a: 2}\n', 'a is given twice'),
        ('gate: {ros__parameters: {a: [}}\n', 'expected'),
        (
            'x: {gate: {ros__parameters: {a: 1}}}\ny: {gate: {ros__parameters: {a: 2}}}\n',
            '/y/gate: a is 2 here and 1 in another namespace',
        ),
    ],
)
def test_what_is_wrong_is_named_with_its_file(tmp_path, text, said):
    path = tmp_path / 'own.yaml'
    path.write_text(text)
    with pytest.raises(ValueError, match=said) as error:
        read_parameters(path)
    assert str(error.value).startswith(f'{path}: ')
    with pytest.raises(ValueError, match=r'absent\.yaml: No such file'):
        read_parameters(tmp_path / 'absent.yaml')


def test_files_of_a_command_line():
    line = ['gate', '--params-file', 'mine', '--ros-args', '-p', 'a:=1', '--params-file', 'one',
            '--params-file', 'two', '--', '--params-file', 'mine']  # fmt: skip
    rest, files = take_parameter_files(line)
    assert files == ['one', 'two']
    assert rest == ['gate', '--params-file', 'mine', '--ros-args', '-p', 'a:=1', '--',
                    '--params-file', 'mine']  # fmt: skip
    with pytest.raises(ValueError, match='--params-file needs'):
        take_parameter_files(['gate', '--ros-args', '--params-file'])
