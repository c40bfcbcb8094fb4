"""Vehicle: wheels, axles, load transfer, and couplings between wheels."""
