"""Baselines: control laws for comparison with the shipped ones."""
