"""Estimation of slip, speed, soil and pose from what the vehicle measures."""
