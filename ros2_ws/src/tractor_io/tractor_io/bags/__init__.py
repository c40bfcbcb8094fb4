"""Bags: reading, writing, import, repair, player and recorder."""
