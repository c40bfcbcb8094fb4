"""The suite as a system: launch files, the drive cycle, and the traction command."""
