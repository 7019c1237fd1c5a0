"""Every fault of the bench, at random moments, against what is declared to notice it: `python -m benchmarks.faults`."""
