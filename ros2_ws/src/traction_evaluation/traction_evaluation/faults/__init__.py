"""Faults put into the running suite, and what it makes of them."""
