"""The last check of every wheel torque before the hardware."""
