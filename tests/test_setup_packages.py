"""Lint of packages: errors name the fault."""

from pathlib import Path

import pytest
from check_packages import problems

ROOT = Path(__file__).resolve().parents[1]

XML = """<?xml version="1.0"?>
<package format="3">
  <name>one</name>
  <version>0.1.0</version>
  <description>One package.</description>
  <maintainer email="someone@example.org">Someone</maintainer>
  <license>Apache-2.0</license>
  <export><build_type>ament_python</build_type></export>
</package>
"""
SETUP = """from setuptools import setup
setup(name='one', version='0.1.0', description='One package.', license='Apache-2.0',
      maintainer='Someone', maintainer_email='someone@example.org', packages=[])
"""


@pytest.fixture
def src(tmp_path):
    (tmp_path / 'one').mkdir()
    (tmp_path / 'one' / 'package.xml').write_text(XML)
    (tmp_path / 'one' / 'setup.py').write_text(SETUP)
    return tmp_path


def edit(path, old, new):
    path.write_text(path.read_text().replace(old, new))


def test_this_workspace_has_no_problems():
    assert problems(ROOT / 'ros2_ws' / 'src') == []


def test_consistent_package_has_no_problems(src):
    assert problems(src) == []


@pytest.mark.parametrize(
    ('file', 'old', 'new', 'problem'),
    [
        ('package.xml', '<name>one', '<name>two', 'names two, but lies in one'),
        ('package.xml', '0.1.0', '0.2.0', 'version is "0.2.0", but "0.1.0" in setup.py'),
        ('setup.py', 'Apache-2.0', 'MIT', 'license is "Apache-2.0", but "MIT" in setup.py'),
        ('package.xml', '<license>Apache-2.0</license>', '', 'license'),
        ('package.xml', '<name>one', '<name>One', 'naming conventions'),
    ],
)
def test_problem_is_named(src, file, old, new, problem):
    edit(src / 'one' / file, old, new)
    found = problems(src)
    assert any(problem in line and 'package.xml' in line for line in found), found


def test_packages_of_different_versions_are_named(src):
    other = src / 'two'
    other.mkdir()
    (other / 'package.xml').write_text(XML.replace('>one<', '>two<').replace('0.1.0', '0.2.0'))
    [line] = problems(src)
    assert line.endswith('packages have different versions (0.1.0: one; 0.2.0: two)')
