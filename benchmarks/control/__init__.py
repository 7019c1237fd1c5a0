"""The force law against its rivals on the same axis, sensor, tissue and tests; `python -m benchmarks.control`."""
