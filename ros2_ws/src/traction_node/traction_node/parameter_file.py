"""Parameter files of ROS 2: paths, and parameters for a node."""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import yaml
from ament_index_python.packages import get_package_share_directory

from traction_node.bounded_yaml import load_yaml, read_yaml

Entry = tuple[str, dict[str, Any]]
"""Pattern of node names with namespace, such as '/**/torque_gate', and its parameters."""

_WILDCARDS = {'*', '**'}
_INTEGER = re.compile(r'[-+]?(0|[1-9][0-9]*|0[0-7]+|0x[0-9a-fA-F]+)')
_FLOAT = re.compile(
    r'[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)'
)


class _Loader(yaml.SafeLoader):
    """YAML with the numbers of rcl: ``1e6`` is a number; a date or ``1:30`` is a text."""

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
        keys = [self.construct_object(key, deep=True) for key, _ in node.value]
        for key in keys:
            if keys.count(key) > 1:
                raise yaml.constructor.ConstructorError(
                    None, None, f'{key} is given twice', node.start_mark
                )
        mapping: dict[Any, Any] = super().construct_mapping(node, deep)
        return mapping


_REPLACED = {f'tag:yaml.org,2002:{kind}' for kind in ('int', 'float', 'timestamp')}
_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag not in _REPLACED]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
# In this order, since a text that is no integer may be a float.
for _tag, _pattern in (('int', _INTEGER), ('float', _FLOAT)):
    _Loader.add_implicit_resolver(
        f'tag:yaml.org,2002:{_tag}', re.compile(f'^(?:{_pattern.pattern})$'), list('-+.0123456789')
    )


def config(package: str, name: str) -> Path:
    """Path of a parameter file shipped with a package of the suite.

    Parameters
    ----------
    package, name : str
        Package, and file name in its ``config`` folder.

    Returns
    -------
    Path
        The file as installed.
    """
    return Path(get_package_share_directory(package)) / 'config' / name


def parse(text: str) -> Any:
    """Content of a YAML text, with the numbers of rcl.

    Parameters
    ----------
    text : str
        A file, or a value of the command line.

    Returns
    -------
    object
        Mapping, list, number, boolean or text.

    Raises
    ------
    BoundedYamlError
        If it cannot be read; the text is one line.
    """
    return load_yaml(text, _Loader)


def read_entries(path: Path | str) -> list[Entry]:
    """Content of a parameter file, for all nodes.

    Parameters
    ----------
    path : Path or str
        YAML file; node names may stand below namespaces, parameters below groups.

    Returns
    -------
    list of tuple
        Patterns of node names with leading slash, and parameters by name, in the order of the
        file. A parameter of a group has its name behind that of the group and a dot.

    Raises
    ------
    ValueError
        If it is no parameter file; the text has its path.
    """
    content = read_yaml(path, _Loader)
    try:
        return list(_entries('', content))
    except ValueError as error:
        raise ValueError(f'{path}: {error}') from error


def _entries(prefix: str, content: object) -> Iterator[Entry]:
    if not isinstance(content, dict) or (not prefix and 'ros__parameters' in content):
        where = f' below {prefix}' if prefix else ''
        raise ValueError(f'expected node names, each with ros__parameters{where}')
    for key, value in content.items():
        if key != 'ros__parameters':
            yield from _entries(f'{prefix}/{str(key).strip("/")}', value)
        elif isinstance(value, dict):
            yield prefix, dict(_flat('', value))
        elif value is not None:
            raise ValueError(f'{prefix}: ros__parameters must be parameters by name')


def _flat(group: str, values: dict[Any, Any]) -> Iterator[tuple[str, Any]]:
    for key, value in values.items():
        name = f'{group}{key}'
        if isinstance(value, dict):
            yield from _flat(f'{name}.', value)
        else:
            yield name, value


def matches(pattern: str, node: str) -> bool:
    """True if a pattern of a parameter file matches a node.

    Parameters
    ----------
    pattern : str
        Such as '/**/torque_gate': ``*`` is one name, ``**`` any number of them.
    node : str
        Name with namespace, such as '/tractor1/torque_gate'.
    """
    parts = {'**': r'(/[^/]+)*', '*': r'/[^/]+'}
    names = pattern.strip('/').split('/')
    expression = ''.join(parts.get(name, '/' + re.escape(name)) for name in names)
    return re.fullmatch(expression, node) is not None


def for_any_node(pattern: str) -> bool:
    """True if a pattern matches any node, so that a node may lack some of its parameters."""
    return pattern.rsplit('/', 1)[-1] in _WILDCARDS


def node_parameters(path: Path | str, node: str, known: Sequence[str]) -> dict[str, Any]:
    """Parameters for one node in a file.

    Parameters
    ----------
    path : Path or str
        Parameter file.
    node : str
        Name with namespace, such as '/tractor1/torque_gate'.
    known : sequence of str
        Parameters of the node. Others are ignored if the file has them for any node, as in
        ``/**``.

    Returns
    -------
    dict of str to object
        Values by name; values for the node by its name override values for any node.

    Raises
    ------
    ValueError
        If it is no parameter file; the text has its path.
    """
    entries = [entry for entry in read_entries(path) if matches(entry[0], node)]
    found: dict[str, Any] = {}
    for pattern, values in entries:
        if for_any_node(pattern):
            found |= {name: value for name, value in values.items() if name in known}
    for pattern, values in entries:
        if not for_any_node(pattern):
            found |= values
    return found


def read_parameters(path: Path | str) -> dict[str, dict[str, Any]]:
    """Parameters by node from a parameter file, in any namespace.

    Parameters
    ----------
    path : Path or str
        YAML file.

    Returns
    -------
    dict of str to dict
        By name of the node without namespace; ``**`` for those of any node.

    Raises
    ------
    ValueError
        If it is no parameter file, or if a parameter of one node has different values in two
        namespaces.
    """
    found: dict[str, dict[str, Any]] = {}
    for pattern, given in read_entries(path):
        values = found.setdefault(
            '**' if for_any_node(pattern) else pattern.rsplit('/', 1)[-1], {}
        )
        for name, value in given.items():
            if values.setdefault(name, value) != value:
                raise ValueError(
                    f'{path}: {pattern}: {name} is {value} here and {values[name]} in another '
                    'namespace'
                )
    return found


def take_parameter_files(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Split the command line of a node into parameter files and the other arguments.

    Parameters
    ----------
    arguments : sequence of str
        Command line; parameter files stand between ``--ros-args`` and ``--``.

    Returns
    -------
    rest, files : list of str
        Other arguments, and the files in order: a later one overrides an earlier one.
    """
    rest: list[str] = []
    files: list[str] = []
    of_ros = False
    left = iter(arguments)
    for argument in left:
        of_ros = argument != '--' if of_ros else argument == '--ros-args'
        if of_ros and argument == '--params-file':
            file = next(left, None)
            if file is None:
                raise ValueError('--params-file needs the path of a parameter file')
            files.append(file)
        else:
            rest.append(argument)
    return rest, files
