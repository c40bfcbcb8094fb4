"""The package as a whole: light to import, complete without ROS."""

import subprocess
import sys

# What takes longer to import than all of the package, and what it does not need.
HEAVY = ('control', 'dask', 'matplotlib', 'pyarrow', 'rclpy', 'scipy.linalg', 'scipy.optimize')

IMPORTED = f"""
import sys
import traction_model
print(*(name for name in {HEAVY!r} if name in sys.modules))
"""


def test_import_brings_nothing_heavy():
    done = subprocess.run(
        [sys.executable, '-c', IMPORTED], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == []
