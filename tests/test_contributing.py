"""CONTRIBUTING.md: every path and every make target that it names exists."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ROOT / 'ros2_ws' / 'src'
TEXT = (ROOT / 'CONTRIBUTING.md').read_text(encoding='utf-8')
QUOTED = sorted(set(re.findall(r'`([^`]+)`', TEXT)))
# Names of targets follow `make`; paths have a slash or are a file's name.
MADE = [name.removeprefix('make ') for name in QUOTED if name.startswith('make ')]
PATHS = sorted(
    {
        part
        for name in QUOTED
        for part in name.split()
        if ('/' in part or re.fullmatch(r'[\w-]+\.(md|py|xml|yaml)', part)) and '.venv' not in part
    }
)
IN_PACKAGES = ('config/', 'nodes/', 'test/', 'setup.py', 'package.xml')


@pytest.mark.parametrize('target', MADE)
def test_make_target_exists(target):
    makefile = (ROOT / 'Makefile').read_text(encoding='utf-8')
    assert re.search(rf'^{target}:', makefile, re.MULTILINE)


@pytest.mark.parametrize('path', PATHS)
def test_path_exists(path):
    if path in IN_PACKAGES:
        assert list(SOURCES.glob(f'*/{path}')) or list(SOURCES.glob(f'*/*/{path}'))
    else:
        assert (SOURCES / path).exists() or (ROOT / path).exists()


def test_paths_and_targets_are_found():
    assert {'test', 'lint', 'golden'} <= set(MADE)
    assert 'traction_interfaces/config/topics.yaml' in PATHS
    assert 'ros2_ws/src/traction_model/test/test_slip.py' in PATHS


def test_it_is_one_screen():
    assert len(TEXT.splitlines()) <= 60
