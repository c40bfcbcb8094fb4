"""Replay of bags through the suite, and golden files."""
