"""CAN bus of a tractor: J1939, the bridge, and simulated control units."""
