"""Evaluation: closed loop, faults, verification, field data, replay, golden files, reports."""
