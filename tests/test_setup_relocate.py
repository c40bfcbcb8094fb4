"""Set-up: the wheel builder's prefix goes."""

import sys
from pathlib import Path

import pytest
from relocate import BUILDER, relocate, relocated

EXPORT = (
    '  INTERFACE_INCLUDE_DIRECTORIES "/opt/python/cp312-cp312/include/python3.12;'
    '/opt/python/cp312-cp312/lib/python3.12/site-packages/numpy/_core/include"\n'
    '  INTERFACE_LINK_LIBRARIES "/opt/python/cp312-cp312/lib/libx.so;${_IMPORT_PREFIX}/lib"\n'
)


def test_each_of_the_builders_folders_is_replaced():
    text = relocated(EXPORT, '/home/user/suite/.venv', '/usr/include/python3.12', '/site')
    assert text == (
        '  INTERFACE_INCLUDE_DIRECTORIES "/usr/include/python3.12;/site/numpy/_core/include"\n'
        '  INTERFACE_LINK_LIBRARIES "/home/user/suite/.venv/lib/libx.so;${_IMPORT_PREFIX}/lib"\n'
    )


def test_backslashes_in_a_folder_are_kept():
    assert relocated('/opt/python/cp313-cp313', r'/odd\1name', '', '') == r'/odd\1name'


def test_files_that_name_the_builder_are_rewritten_once(tmp_path):
    cmake = tmp_path / 'share' / 'std_msgs' / 'cmake' / 'export.cmake'
    index = tmp_path / 'share' / 'ament_index' / 'resource_index' / 'parent_prefix_path' / 'rcl'
    other = tmp_path / 'share' / 'std_msgs' / 'cmake' / 'other.cmake'
    for path, text in [
        (cmake, EXPORT),
        (index, '/opt/python/cp311-cp311'),
        (other, 'set(x 1)\n'),
    ]:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    assert relocate(tmp_path, '/headers', '/site') == 2
    assert index.read_text() == str(tmp_path)
    assert not BUILDER.search(cmake.read_text())
    assert other.read_text() == 'set(x 1)\n'
    assert relocate(tmp_path, '/headers', '/site') == 0


def test_nothing_in_this_environment_names_the_builder():
    share = Path(sys.prefix, 'share')
    if not (share / 'ament_index').is_dir():
        pytest.skip('ROS is installed on this machine, so no wheels are used')
    left = [
        path
        for path in share.rglob('*')
        if path.is_file() and BUILDER.pattern.encode()[:11] in path.read_bytes()
    ]
    assert left == []
