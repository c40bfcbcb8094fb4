"""Bags: reader, writer, import, repair, player and recorder."""
