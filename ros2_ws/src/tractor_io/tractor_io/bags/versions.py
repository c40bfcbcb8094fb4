"""Versions of the software that writes a bag: the suite's packages, Python, ROS."""

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
"""Packages whose versions go into a bag: the suite's and the client library."""


def versions() -> dict[str, str]:
    """Versions of packages, Python and ROS.

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
