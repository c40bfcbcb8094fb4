"""Versions of what makes a bag: the suite's packages, Python, ROS."""

import os
import platform
from xml.etree import ElementTree

from ament_index_python.packages import PackageNotFoundError, get_package_share_path

PACKAGES = (
    'torque_gate',
    'traction_bringup',
    'traction_controller',
    'traction_interfaces',
    'traction_model',
    'traction_node',
    'tractor_io',
    'rclpy',
)
"""Packages whose versions are told: the suite's own, and the client library they run on."""


def versions() -> dict[str, str]:
    """Look up versions.

    Returns
    -------
    dict of str to str
        By ``version PACKAGE``, ``version python`` and ``ros_distro``; packages that are not
        installed are left out.
    """
    found = {}
    for package in PACKAGES:
        try:
            manifest = ElementTree.parse(get_package_share_path(package) / 'package.xml')
        except (PackageNotFoundError, OSError, ElementTree.ParseError):
            continue
        found[f'version {package}'] = manifest.findtext('version', '').strip()
    found['version python'] = platform.python_version()
    found['ros_distro'] = os.environ.get('ROS_DISTRO', 'jazzy')
    return found
