"""Verification of the model against Project Chrono, the paper and wheel tests."""
