"""A simulated Zaber axis."""
