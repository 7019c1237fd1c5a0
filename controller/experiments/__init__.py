"""Experiments: a protocol becomes programs of steps, the bench runs them, each into a recording of its own."""
