"""Open files of this process: what a test that gives something back leaves as it was."""

from pathlib import Path


def open_files() -> int:
    """How many there are now."""
    return len(list(Path("/proc/self/fd").iterdir()))
