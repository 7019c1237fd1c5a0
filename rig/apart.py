"""Work on a long recording by a process of its own: a thread that reads one keeps a service from answering.

`python -c "from rig.apart import main; main()"` takes the work on standard input and puts what it found on its output.
"""

import os
import pickle
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from subprocess import run
from typing import TypeVar, cast

from rig.errors import DataError, RigError

Found = TypeVar("Found")
# Three quarters of a minute: a process takes as long to start as it works on that.
LONG_BYTES = 8_000_000
# A third of a normal program's share of a busy computer: a fit may wait for a page, and never the other way.
NICENESS = 5
# What a traceback ends with is one line.
LONGEST_LINE = 300
PROGRAM = "from rig.apart import main; main()"


def apart(file: Path, work: Callable[..., Found], *given: object) -> Found:
    """What ``work`` makes of what is ``given``; by a process of its own where the recording in ``file`` is long.

    ``work`` is a function of a module. Raises what it raises of `RigError`, and DataError where its process ended.
    """
    if not file.is_file() or file.stat().st_size < LONG_BYTES:
        return work(*given)
    done = run(
        [sys.executable, "-P", "-c", PROGRAM], input=pickle.dumps((work, given)), capture_output=True, check=False,
        start_new_session=True,  # Ctrl-C is for who records
    )  # fmt: skip
    if done.returncode:
        said = last_line(done.stderr.decode(errors="replace")) or "it said nothing"
        raise DataError(
            f"{file}: the process that was to read it {how_ended(done.returncode)}, so it was not read ({said});"
            " see that memory is free, and record again"
        )
    found = pickle.loads(done.stdout)
    if isinstance(found, RigError):
        raise found
    return cast(Found, found)


def how_ended(code: int) -> str:
    """What a process with this return code did."""
    if code == -signal.SIGKILL:
        return "was killed, most often because memory ran out"
    return f"was ended by signal {-code}" if code < 0 else f"ended with code {code}"


def last_line(said: str) -> str:
    """The last one that is not blank; empty where there is none."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    return lines[-1][:LONGEST_LINE] if lines else ""


def stand_back(niceness: int = NICENESS, whom: int = 0) -> None:
    """This process, or the thread ``whom``, at ``niceness``; where its own is more only root may take that back."""
    os.setpriority(os.PRIO_PROCESS, whom, max(os.getpriority(os.PRIO_PROCESS, whom), niceness))


def main() -> None:
    """Reads the work, does it, ends."""
    stand_back()
    work, given = pickle.load(sys.stdin.buffer)
    try:
        found = work(*given)
    except RigError as error:
        found = error
    pickle.dump(found, sys.stdout.buffer)
