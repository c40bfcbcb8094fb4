"""Edges of the suite: bags, the torque gate, and the nodes that serve them."""
