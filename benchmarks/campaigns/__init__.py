"""Campaigns that count how often the diagnosis is right: `python -m benchmarks.criticism --campaign NAME`."""

import os

# Sessions go side by side, a thread each; read when numpy is first imported, which is after this.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
