"""Recorded drives: arrays, figures, pictures."""
