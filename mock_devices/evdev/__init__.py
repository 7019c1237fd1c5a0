"""Simulated foot switch."""
