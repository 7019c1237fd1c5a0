"""Calibrations as jobs: the service asks, and a person at the bench does."""
