"""Rewrite the wheel builder's prefix in the ROS 2 wheels of a virtual environment.

The CMake exports and the ament index of the `ros-jazzy-*` wheels name the prefix of the
interpreter they were built with (`/opt/python/cp3XX-cp3XX`). Unless that prefix is replaced by
the virtual environment's, CMake looks for headers, and ament for packages, in a folder that is
not there.
"""

import re
import sys
import sysconfig
from pathlib import Path

BUILDER = re.compile(r'/opt/python/cp3\d+-cp3\d+')
BUILDER_HEADERS = re.compile(BUILDER.pattern + r'/include/python3\.\d+')
BUILDER_SITE_PACKAGES = re.compile(BUILDER.pattern + r'/lib/python3\.\d+/site-packages')


def relocated(text, prefix, headers, site_packages):
    """Text of one file with the builder's folders replaced.

    Parameters
    ----------
    text : str
        Content of a CMake export or an ament index entry.
    prefix, headers, site_packages : str
        Folder of the virtual environment, of `Python.h`, of the installed Python packages.

    Returns
    -------
    str
        The text unchanged where it does not name the builder's prefix.
    """
    text = BUILDER_HEADERS.sub(lambda _: headers, text)
    text = BUILDER_SITE_PACKAGES.sub(lambda _: site_packages, text)
    return BUILDER.sub(lambda _: prefix, text)


def relocate(prefix, headers, site_packages):
    """Rewrite every file of `prefix`/share with the wheel builder's prefix.

    Parameters
    ----------
    prefix, headers, site_packages : path-like
        As for `relocated`.

    Returns
    -------
    int
        Number of files rewritten: 0 on a second run.
    """
    share = Path(prefix, 'share')
    index = share / 'ament_index' / 'resource_index' / 'parent_prefix_path'
    count = 0
    for path in [*share.glob('*/cmake/*.cmake'), *index.glob('*')]:
        text = path.read_text(encoding='utf-8')
        new = relocated(text, str(prefix), str(headers), str(site_packages))
        if new != text:
            path.write_text(new, encoding='utf-8')
            count += 1
    return count


if __name__ == '__main__':
    paths = sysconfig.get_paths()
    relocate(sys.prefix, paths['include'], paths['purelib'])
