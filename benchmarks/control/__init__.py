"""The force law against alternatives on the same axis, sensor, tissue and tests; `python -m benchmarks.control`."""
