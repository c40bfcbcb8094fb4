"""Soil: its laws and parameters, terrain, ruts, and curves for soil without parameters."""
