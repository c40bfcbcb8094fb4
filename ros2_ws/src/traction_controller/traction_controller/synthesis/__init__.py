"""Synthesis of gains, and the proof of what they do."""
