"""Estimation of slip, speed, soil and pose from the sensors of the vehicle."""
