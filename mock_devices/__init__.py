"""The stage set: the wire protocols of the real products, backed by one simulated bench."""
