"""Links between the pages: every file and every heading that a page refers to exists."""

import re
from pathlib import Path

import pytest

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
