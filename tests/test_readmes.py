"""What the READMEs must not leave out: every parameter of every node, every topic."""

import importlib
import inspect
import pkgutil
import re
from pathlib import Path

import pytest

from traction_node.topics import topics

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ROOT / 'ros2_ws' / 'src'
PACKAGES = (
    'torque_gate',
    'traction_model',
    'traction_controller',
    'tractor_io',
    'traction_bringup',
)


def nodes():
    """(package, class) of every node: a behaviour, or what is one."""
    for name in PACKAGES:
        package = importlib.import_module(name)
        for module in pkgutil.walk_packages(package.__path__, f'{name}.'):
            if '.nodes.' in module.name or module.name.endswith('_node'):
                for thing in vars(importlib.import_module(module.name)).values():
                    own = inspect.isclass(thing) and thing.__module__ == module.name
                    if own and hasattr(thing, 'PARAMETERS'):
                        yield name, thing


NODES = {node.NAME: (package, node) for package, node in nodes()}


def test_every_node_is_found():
    assert {'plant_node', 'slip_estimator', 'slip_controller', 'torque_gate'} <= set(NODES)


@pytest.mark.parametrize('name', NODES)
def test_readme_lists_every_parameter(name):
    package, node = NODES[name]
    text = (SOURCES / package / 'README.md').read_text()
    assert f'`{name}`' in text or f'### {name}' in text
    for parameter in node.PARAMETERS:
        row = re.search(
            rf'^\| `{parameter.name}`( \*)? \| (?!in |out )(.*?) \|', text, re.MULTILINE
        )
        assert row, f'{package}/README.md does not list `{parameter.name}` of {name}'


@pytest.mark.parametrize('name', ['plant_node', 'slip_estimator', 'slip_controller'])
def test_readme_gives_the_defaults_that_are(name):
    package, node = NODES[name]
    text = (SOURCES / package / 'README.md').read_text()
    section = text[re.search(rf'^##.*\b{name}\b', text, re.MULTILINE).start() :]
    for parameter in node.PARAMETERS:
        row = re.search(
            rf'^\| `{parameter.name}`( \*)? \| (?!in |out )(.*?) \|', section, re.MULTILINE
        )
        said = row.group(2).strip('`')
        default = parameter.default
        if isinstance(default, bool | str):
            assert said == str(default).lower(), parameter.name
        elif isinstance(default, int | float):
            assert float(said) == default, parameter.name
        elif isinstance(default[0], str):
            assert said == f'[{", ".join(default)}]', parameter.name
        else:
            assert said == str(list(default)), parameter.name


@pytest.mark.parametrize('name', topics())
def test_every_topic_is_explained_somewhere(name):
    texts = [path.read_text() for path in (ROOT / 'README.md', *SOURCES.glob('*/README.md'))]
    assert any(f'`{name}`' in text for text in texts)
