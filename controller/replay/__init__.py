"""A recording played through the loop again: the same decisions, or the row where they differ."""
