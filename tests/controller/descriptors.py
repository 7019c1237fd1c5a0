"""Open files of this process: what a test that gives something back leaves as it was."""

import gc
from pathlib import Path


def open_files() -> int:
    """How many there are now, those of objects that nobody holds any more left out."""
    gc.collect()
    return len(list(Path("/proc/self/fd").iterdir()))
