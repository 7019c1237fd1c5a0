"""Which computer this is: what was measured of timing on one says nothing of another."""

import hashlib
import platform
from pathlib import Path

MACHINE_ID = Path("/etc/machine-id")
DIGITS = 8  # one in four thousand million: a lab has a handful


def computer_id(machine_id: Path = MACHINE_ID) -> str:
    """Host name and a digest of the machine's own number, which containers and copied disks may share or lack."""
    number = machine_id.read_text().strip() if machine_id.is_file() else ""
    return f"{platform.node()}-{hashlib.sha256((platform.node() + number).encode()).hexdigest()[:DIGITS]}"
