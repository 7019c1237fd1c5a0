"""Elastic, viscous and relaxing laws of tissue, and fitting them to recordings."""
