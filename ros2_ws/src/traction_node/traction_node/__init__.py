"""How a node of the suite spins, declares parameters, reports its health and ends."""
