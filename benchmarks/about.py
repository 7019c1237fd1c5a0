"""What a page of docs/validation begins with: when, which version, by which command, on which computer."""

import os
import platform
import sys
from datetime import datetime

from benchmarks.faults.trial import commit


def head(name: str, **more: str) -> str:
    """The table at the head of a page on what ``python -m benchmarks.NAME`` found; ``more`` are further lines of it."""
    busy = ", ".join(f"{load:.1f}" for load in os.getloadavg())
    said = {
        "date": f"{datetime.now():%Y-%m-%d}",
        "commit": commit(),
        "command": f"`{' '.join([f'python -m benchmarks.{name}', *sys.argv[1:]])}`",
        "computer": f"{os.cpu_count()} cores, {platform.system()} {platform.release()}, load at the start {busy}",
        **more,
    }
    return "\n".join(["| | |", "|---|---|", *(f"| {what} | {value} |" for what, value in said.items())]) + "\n"
