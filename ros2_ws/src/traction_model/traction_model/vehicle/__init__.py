"""Wheels, vehicles, and how their wheels are coupled."""
