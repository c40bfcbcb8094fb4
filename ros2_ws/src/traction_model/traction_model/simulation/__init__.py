"""Motion of vehicles over time, one or many at once, and their sensors."""
