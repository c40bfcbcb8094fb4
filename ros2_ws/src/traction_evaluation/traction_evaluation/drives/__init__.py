"""Recorded drives: arrays over time, figures and pictures."""
