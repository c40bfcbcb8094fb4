"""Nodes: they pass messages to the cores and publish the results."""
