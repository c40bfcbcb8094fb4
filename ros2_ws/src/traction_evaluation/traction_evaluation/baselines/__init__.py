"""Baselines: control laws that the shipped ones are compared with."""
