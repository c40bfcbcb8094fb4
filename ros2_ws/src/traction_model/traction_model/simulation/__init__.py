"""Simulation of one or many vehicles over time, and of their sensors."""
