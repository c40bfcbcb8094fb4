"""The bags of the repository, for all tests across packages."""

from pathlib import Path

BAGS = Path(__file__).resolve().parents[1] / 'bags'
"""Folder of the bags."""

NAMES = sorted(path.parent.name for path in BAGS.glob('*/metadata.yaml'))
"""Their names, sorted."""
