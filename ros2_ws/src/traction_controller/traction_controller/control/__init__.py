"""Slip control: torque of every wheel from its slip."""
