"""Sweeps of many drives on all cores."""
