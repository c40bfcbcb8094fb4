"""The suite as a system: launch files, drive cycle and the command `traction`."""
