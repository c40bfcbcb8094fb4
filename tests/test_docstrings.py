"""The documented interface: docstrings with units on all that is public, cores without ROS."""

import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGES = ('traction_model', 'traction_controller', 'traction_node', 'torque_gate', 'tractor_io')
# What the nodes need rclpy for; everything else is a core.
SHELLS = {
    'traction_node.node',
    'traction_node.run',
    'traction_node.probe',
    'traction_node.running_system',
}


def core_modules():
    for name in PACKAGES:
        package = importlib.import_module(name)
        yield name
        for module in pkgutil.walk_packages(package.__path__, f'{name}.'):
            if not module.name.endswith('_node') and module.name not in SHELLS:
                yield module.name


CORES = list(core_modules())


def plain(thing):
    """The Python function behind a kernel, a classmethod or a cached function."""
    for attribute in ('py_func', '__wrapped__', '__func__'):
        thing = getattr(thing, attribute, thing)
    return thing


def public_things():
    """(name, class, function or property) of all that the cores' modules define themselves."""
    for module_name in CORES:
        module = importlib.import_module(module_name)
        for name, thing in vars(module).items():
            if name.startswith('_') or getattr(plain(thing), '__module__', '') != module_name:
                continue
            if inspect.isclass(thing):
                yield f'{module_name}.{name}', thing
                for member, value in vars(thing).items():
                    if member.startswith('_') or member == 'model_config':
                        continue
                    if inspect.isfunction(plain(value)) or isinstance(value, property):
                        yield f'{module_name}.{name}.{member}', value
            elif inspect.isfunction(plain(thing)):
                yield f'{module_name}.{name}', thing


THINGS = dict(public_things())


def sections(docstring):
    """Sections of a numpydoc text: {'Parameters': [(names, type, description), ...], ...}."""
    found, entries = {}, None
    lines = inspect.cleandoc(docstring).splitlines()
    for number, line in enumerate(lines):
        following = lines[number + 1] if number + 1 < len(lines) else ''
        if line and following and set(following) == {'-'} and len(following) == len(line):
            entries = found.setdefault(line, [])
        elif entries is None or not line or set(line) == {'-'}:
            continue
        elif not line.startswith(' '):
            names, _, kind = line.partition(' : ')
            entries.append([names, kind or names, ''])
        elif entries:
            entries[-1][2] += ' ' + line.strip()
    return found


# Integers are counts, numbers of rows or choices.
NUMERIC = re.compile(r'\b(float|ndarray|array_like)\b')
# A unit, alone or within a product, or words that say that there is none.
UNITS = re.compile(
    r'(?<![\w.])(m|s|ns|N|Pa|W|kg|rad|Hz|1)(?!\w)[\^*/·0-9]*'
    r'|\[\w+\]|unit|dimensionless|slip|share|-1 to 1|relative|number of|pulses|packed',
    re.IGNORECASE,
)


def test_there_is_something_to_document():
    assert len(CORES) > 15
    assert len(THINGS) > 100


@pytest.mark.parametrize('name', THINGS)
def test_docstring(name):
    thing = THINGS[name]
    docstring = inspect.getdoc(thing)
    assert docstring, f'{name} has no docstring'
    said = sections(docstring)
    for section in ('Parameters', 'Returns', 'Attributes'):
        for names, kind, description in said.get(section, []):
            # 'bool' and text need none; of arrays only those of numbers do.
            if NUMERIC.search(kind) and not re.search(r'bool|of str', kind):
                told = f'{names} {description}'
                assert UNITS.search(told), f'{name}: {section}: {names} is given without unit'


@pytest.mark.parametrize(
    'name', [name for name, thing in THINGS.items() if inspect.isfunction(plain(thing))]
)
def test_every_argument_is_documented(name):
    function = plain(THINGS[name])
    said = sections(inspect.getdoc(function))
    documented = {
        part.strip('* ') for names, _, _ in said.get('Parameters', []) for part in names.split(',')
    }
    signature = inspect.signature(function)
    expected = {
        parameter for parameter in signature.parameters if parameter not in ('self', 'cls')
    }
    # One-line functions may say it all in their summary.
    if expected and documented:
        assert documented == expected
    returned = signature.return_annotation
    # What text or object comes back, the summary says.
    if documented and re.search('float|int|NDArray|tuple|dict', str(returned)):
        assert 'Returns' in said or 'Yields' in said, f'{name} says not what it returns'


WITHOUT_ROS = """
import importlib
import importlib.abc
import sys

class Blocked(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] in ('rclpy', 'traction_interfaces', 'sensor_msgs', 'std_msgs'):
            raise ImportError(f'{name} imported by a core')
        return None

sys.meta_path.insert(0, Blocked())
for name in sys.argv[1:]:
    importlib.import_module(name)
"""


def test_cores_never_import_ros():
    done = subprocess.run(
        [sys.executable, '-c', WITHOUT_ROS, *CORES], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_every_core_is_looked_at():
    # What is not a core says so by its name, or is one of the shells above.
    for name in PACKAGES:
        folder = Path(importlib.import_module(name).__file__).parent
        for path in folder.rglob('*.py'):
            module = '.'.join((name, *path.relative_to(folder).with_suffix('').parts))
            if path.stem != '__init__':
                imports = re.search(r'^\s*(import|from) rclpy', path.read_text(), re.MULTILINE)
                assert not imports or path.stem.endswith('_node') or module in SHELLS
