"""Slip control in closed loop: loop, trials, scenarios and report."""
