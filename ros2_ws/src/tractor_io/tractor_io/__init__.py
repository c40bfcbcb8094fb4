"""Bags and the CAN bus: the ways from the suite to files and to a tractor."""
