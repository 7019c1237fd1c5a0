"""A simulated load-cell transmitter."""
