"""Slip control in closed loop: the loop, trials, scenarios, and the report."""
