"""A tractor's CAN bus: J1939, the bridge, a simulated tractor's control units."""
