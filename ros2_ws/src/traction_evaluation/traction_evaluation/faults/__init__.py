"""Faults injected into the running suite, with the time until torque is safe."""
