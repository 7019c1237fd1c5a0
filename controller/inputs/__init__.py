"""Inputs beside the loop: a process of their own, and what the loop takes from it."""
