"""Control laws: torque of one wheel, or of a group of wheels, from its slip."""
