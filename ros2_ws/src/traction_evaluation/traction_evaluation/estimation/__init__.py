"""Errors of slip estimation, against ground truth and recorded field data."""
