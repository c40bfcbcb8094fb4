"""Layout: imports run one way, and `package.xml` files name what is imported.

The graph of imports is read from the source, inside functions too; only what stands under
``if TYPE_CHECKING`` is left out. A text that is the name of a module, as in a table of what is
imported later, counts as an import.
"""

import ast
import re
from functools import cache
from pathlib import Path

import pytest
from catkin_pkg.package import parse_package

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ROOT / 'ros2_ws' / 'src'
PACKAGES = {xml.parent.name: parse_package(str(xml)) for xml in SOURCES.glob('*/package.xml')}
WITH_CODE = sorted(name for name in PACKAGES if (SOURCES / name / name).is_dir())

DOTTED = re.compile(r'[a-z_]\w*(\.[a-z_]\w*)+')


def module_name(path, folder):
    """Dotted name of a module in a folder of packages."""
    parts = path.relative_to(folder).with_suffix('').parts
    return '.'.join(parts[:-1] if parts[-1] == '__init__' else parts)


def is_type_checking(node):
    """True if a node is an ``if TYPE_CHECKING`` block."""
    return isinstance(node, ast.If) and any(
        getattr(part, 'id', getattr(part, 'attr', '')) == 'TYPE_CHECKING'
        for part in ast.walk(node.test)
    )


def names_used(text, module='', is_package=False):
    """Dotted names that a module imports; those of ``from ... import`` are joined.

    Texts that look like the name of a module in a package are returned, too.
    """
    todo = [ast.parse(text)]
    while todo:
        node = todo.pop()
        if is_type_checking(node):
            todo.extend(node.orelse)
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ''
            if node.level:
                above = module.split('.')[: None if is_package else -1]
                above = above[: len(above) - node.level + 1]
                base = '.'.join([*above, *filter(None, [node.module])])
            yield from (f'{base}.{alias.name}' for alias in node.names)
        elif isinstance(node, ast.Constant) and DOTTED.fullmatch(str(node.value)):
            yield str(node.value)
        todo.extend(ast.iter_child_nodes(node))


@cache
def modules():
    """Path of every module of the suite by its name; tests left out."""
    return {
        module_name(path, SOURCES / name): path
        for name in WITH_CODE
        for path in sorted((SOURCES / name / name).rglob('*.py'))
    }


def known_module(name, known):
    """Longest beginning of a dotted name that is a module, or None."""
    while name and name not in known:
        name = name.rpartition('.')[0]
    return name or None


def edges(sources):
    """Modules that each module imports, by name.

    Parameters
    ----------
    sources : mapping
        Text and whether it is an ``__init__``, by name of the module.
    """
    return {
        name: {
            target
            for used in names_used(text, name, is_package)
            if (target := known_module(used, sources)) and target != name
        }
        for name, (text, is_package) in sources.items()
    }


@cache
def imports():
    """Modules of the suite that each of them imports."""
    return edges(
        {
            name: (path.read_text(encoding='utf-8'), path.name == '__init__.py')
            for name, path in modules().items()
        }
    )


def circle(graph):
    """Return a circle of a graph as the names along it, or an empty list."""
    state, path = {}, []

    def visit(node):
        state[node] = 'open'
        path.append(node)
        for other in sorted(graph.get(node, ())):
            if state.get(other) == 'open':
                return [*path[path.index(other) :], other]
            if other not in state and (found := visit(other)):
                return found
        path.pop()
        state[node] = 'done'
        return []

    for node in sorted(graph):
        if node not in state and (found := visit(node)):
            return found
    return []


def merged(graph, place):
    """Graph of the places that the nodes of a graph lie in."""
    result = {}
    for node, others in graph.items():
        here = result.setdefault(place(node), set())
        here |= {place(other) for other in others} - {place(node)}
    return result


def folder_of(module):
    """Folder of a module; what lies beside the folders stands for itself."""
    path = modules()[module]
    if path.name == '__init__.py':
        return module
    folder = module.rpartition('.')[0]
    return module if folder in PACKAGES else folder


def test_modules_do_not_import_in_a_circle():
    assert not circle(imports())


def test_folders_do_not_import_in_a_circle():
    assert not circle(merged(imports(), folder_of))


def test_packages_do_not_import_in_a_circle():
    assert not circle(merged(imports(), lambda module: module.partition('.')[0]))


def test_packages_do_not_depend_in_a_circle():
    assert not circle(
        {name: depends(name) | depends(name, test=True) - {name} for name in PACKAGES}
    )


def test_circles_are_found():
    # a -> b -> c -> a, by a function's import, a relative one, and a text.
    sources = {
        'p': ('', True),
        'p.a': ('def f():\n    import p.b', False),
        'p.b': ('from . import c', False),
        'p.c': ("PLACE = 'p.a'", False),
        'p.d': ('if TYPE_CHECKING:\n    import p.e\nelse:\n    from p.a import f', False),
        'p.e': ('from p import d', False),
    }
    graph = edges(sources)
    assert graph == {
        'p': set(),
        'p.a': {'p.b'},
        'p.b': {'p.c'},
        'p.c': {'p.a'},
        'p.d': {'p.a'},
        'p.e': {'p.d'},
    }
    assert circle(graph) == ['p.a', 'p.b', 'p.c', 'p.a']
    assert not circle({'a': {'b', 'c'}, 'b': {'c'}, 'c': set()})


# What a package is called in package.xml, where that is not the name that is imported.
KEYS = {
    'can': 'python3-can',
    'cantools': 'python3-cantools-pip',
    'hypothesis': 'python3-hypothesis',
    'lz4': 'python3-lz4',
    'matplotlib': 'python3-matplotlib',
    'numba': 'python3-numba',
    'numpy': 'python3-numpy',
    'pydantic': 'python3-pydantic',
    'pytest': 'python3-pytest',
    'rich': 'python3-rich',
    'scipy': 'python3-scipy',
    'typer': 'python3-typer',
    'yaml': 'python3-yaml',
    'zstandard': 'python3-zstandard',
}
ROS = {'ament_index_python', 'launch', 'launch_ros', 'rcl_interfaces', 'rclpy'}


def depends(name, test=False):
    """Packages of the suite, or keys of others, that a package.xml names."""
    package = PACKAGES[name]
    found = package.test_depends if test else package.exec_depends
    return {str(entry.name) for entry in found}


def key_of(used):
    """Key of what a dotted name belongs to; None for the standard library and what is unknown."""
    top = used.partition('.')[0]
    if top in PACKAGES or top in ROS or top.endswith(('_msgs', '_srvs')):
        return top
    return KEYS.get(top)


def keys_in(name, *folders):
    """Keys of what a package's modules import, each with one file that does."""
    found = {}
    for folder in folders:
        for path in sorted((SOURCES / name / folder).rglob('*.py')):
            for used in names_used(path.read_text(encoding='utf-8')):
                key = key_of(used)
                if key not in (None, name):
                    found.setdefault(key, str(path.relative_to(SOURCES)))
    return found


@pytest.mark.parametrize('name', WITH_CODE)
def test_package_names_what_it_imports(name):
    imported = keys_in(name, name, 'launch')
    # pytest loads a plug-in by itself: that is no use outside tests.
    known = depends(name) | depends(name, test=True) & {'python3-pytest'}
    assert not {key: path for key, path in imported.items() if key not in known}


@pytest.mark.parametrize('name', WITH_CODE)
def test_tests_import_what_their_package_names(name):
    known = depends(name) | depends(name, test=True)
    imported = keys_in(name, 'test')
    assert not {key: path for key, path in imported.items() if key not in known}


@pytest.mark.parametrize('name', WITH_CODE)
def test_package_needs_what_it_names(name):
    imported = keys_in(name, name, 'launch')
    text = '\n'.join(
        path.read_text(encoding='utf-8')
        for folder in (name, 'launch', 'config')
        for path in sorted((SOURCES / name / folder).rglob('*'))
        if path.suffix in ('.py', '.yaml')
    )
    # Messages are often imported by the table of topics.
    checked = {key for key in depends(name) if key in (*WITH_CODE, 'rclpy', *KEYS.values())}
    # Executables of other packages are started by name.
    assert not {key for key in checked - set(imported) if not re.search(rf"['\"]{key}['\"]", text)}


def test_every_folder_has_a_subject_of_its_own():
    subjects = {}
    for name, path in modules().items():
        if path.name == '__init__.py':
            subject = ast.get_docstring(ast.parse(path.read_text(encoding='utf-8')))
            assert subject, name
            subjects.setdefault(subject.splitlines()[0], []).append(name)
    # Every package may have a folder of nodes.
    assert not [
        names
        for names in subjects.values()
        if len(names) > 1 and not all(name.endswith('.nodes') for name in names)
    ]
