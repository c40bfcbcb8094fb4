"""Nodes: messages to the cores and back."""
