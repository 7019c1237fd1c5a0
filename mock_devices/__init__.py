"""The simulated bench: the wire protocols of the real products, backed by one simulated bench."""
