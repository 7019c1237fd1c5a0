"""`mbpoll`, a client of Modbus by libmodbus, unchanged, on a simulated line."""

import shutil
import subprocess

from tests.lacking import lacking


def mbpoll(line: str, slave: int, baud: int, *options: str, write: int | None = None) -> str:
    """What it prints, once; registers are counted from 0."""
    if not shutil.which("mbpoll"):
        lacking("no mbpoll here; it is a package of Debian: apt-get install mbpoll")
    command = ["mbpoll", "-m", "rtu", "-b", str(baud), "-P", "none", "-a", str(slave), "-0", "-1", "-o", "2", *options]
    value = [] if write is None else [str(write)]
    done = subprocess.run([*command, line, *value], capture_output=True, text=True, timeout=30, check=False)
    return done.stdout + done.stderr
