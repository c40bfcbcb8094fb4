"""Check and limits of every wheel torque before the hardware."""
