"""Speed checks, run by hand: ``python -m benchmarks.NAME``."""
