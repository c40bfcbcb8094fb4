"""Closed loop, faults, verification, replay, golden files, and their reports."""
