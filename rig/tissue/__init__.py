"""Elastic, viscous and memory laws of tissue, and fitting them to recordings."""
