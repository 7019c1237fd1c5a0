"""Simulated physiological streams."""
