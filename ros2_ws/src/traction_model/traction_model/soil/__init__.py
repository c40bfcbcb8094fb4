"""Soil: laws and their parameters, terrain, ruts, and empirical traction curves."""
