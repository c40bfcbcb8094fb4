"""Synthesis of gains, and certificates of stability and performance."""
