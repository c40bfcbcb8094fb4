"""Control laws: torque of one wheel, or of a group, from its slip."""
