"""A simulated Motive."""
