"""Synthesis of gains, and certificates that prove what they guarantee."""
