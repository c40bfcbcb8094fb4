"""Control laws that others are compared with."""
