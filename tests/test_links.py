"""Links between the pages: every file and every heading that a page refers to exists."""

import re
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted(
    path
    for pattern in ('*.md', 'docs/*.md', 'bags/*.md', 'ros2_ws/src/*/README.md')
    for path in ROOT.glob(pattern)
)


def anchors(page):
    """Anchors of a page's headings, as GitHub makes them."""
    text = re.sub(r'```.*?```', '', page.read_text(encoding='utf-8'), flags=re.DOTALL)
    found = set()
    for heading in re.findall(r'^#+ (.*)$', text, re.MULTILINE):
        words = re.sub(r'[^\w\- ]', '', heading.strip().lower())
        found.add(words.replace(' ', '-'))
    return found


def links():
    """(page, target) of every link to a file or heading of the project."""
    for page in PAGES:
        text = re.sub(r'```.*?```', '', page.read_text(encoding='utf-8'), flags=re.DOTALL)
        for target in re.findall(r'\]\(([^)\s]+)\)', text):
            if '://' not in target and not target.startswith('mailto:'):
                yield page, target


LINKS = [
    pytest.param(page, target, id=f'{page.relative_to(ROOT)}:{target}') for page, target in links()
]


@pytest.mark.parametrize(('page', 'target'), LINKS)
def test_link_leads_somewhere(page, target):
    file, _, anchor = target.partition('#')
    path = (page.parent / file).resolve() if file else page
    assert path.exists()
    if anchor and path.suffix == '.md':
        assert anchor in anchors(path)


def test_links_are_found():
    assert len({param.values[0] for param in LINKS}) > 5


SOURCES = ROOT / 'ros2_ws' / 'src'


def parameters():
    """Parameters that ship, as ``node.parameter``: a node may have the name of its package."""
    for path in SOURCES.glob('*/config/*.yaml'):
        for node, content in (yaml.safe_load(path.read_text(encoding='utf-8')) or {}).items():
            if isinstance(content, dict) and 'ros__parameters' in content:
                short = node.rsplit('/', 1)[-1]
                yield from (f'{short}.{name}' for name in content['ros__parameters'])


def named_modules():
    """(page, name) of every dotted name of the suite's Python packages that a page quotes."""
    known = set(parameters())
    folders = [path.name for path in SOURCES.iterdir() if (path / path.name).is_dir()]
    packages = '|'.join(sorted(folders))
    for page in PAGES:
        # What was is named there, too.
        if page.name != 'CHANGELOG.md':
            found = re.findall(rf'`((?:{packages})(?:\.\w+)+)', page.read_text(encoding='utf-8'))
            yield from ((page, name) for name in sorted(set(found) - known))


NAMED = [
    pytest.param(name, id=f'{page.relative_to(ROOT)}:{name}') for page, name in named_modules()
]


@pytest.mark.parametrize('name', NAMED)
def test_module_that_a_page_names_exists(name):
    parts = name.split('.')
    while parts:
        path = (SOURCES / parts[0]).joinpath(*parts)
        if path.is_dir() or path.with_suffix('.py').exists():
            break
        parts.pop()
    rest = name.split('.')[len(parts) :]
    text = path / '__init__.py' if path.is_dir() else path.with_suffix('.py')
    assert not rest or re.search(rf'\b{rest[0]}\b', text.read_text(encoding='utf-8'))


FILES = sorted(
    {
        (page, name)
        for page in PAGES
        if page.name != 'CHANGELOG.md'
        for name in re.findall(
            r'`([\w./-]+\.(?:py|md|msg|xml))`', page.read_text(encoding='utf-8')
        )
    }
)


@pytest.mark.parametrize(
    'name', [pytest.param(name, id=f'{page.relative_to(ROOT)}:{name}') for page, name in FILES]
)
def test_file_that_a_page_names_exists(name):
    assert (ROOT / name).exists() or list(SOURCES.rglob(name))
