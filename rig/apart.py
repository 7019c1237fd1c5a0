"""Work on a long recording by a process of its own: a thread that reads one keeps a service from answering.

`python -c "from rig.apart import main; main()"` takes the work on standard input and puts what it found on its output.
"""

import os
import pickle
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
        raise DataError(
            f"{file}: the process that was to read it ended with code {done.returncode}, of -9 most often because"
            f" memory ran out ({_last_line(done.stderr)}); free some, and record again"
        )
    found = pickle.loads(done.stdout)
    if isinstance(found, RigError):
        raise found
    return cast(Found, found)


def _last_line(said: bytes) -> str:
    return (said.decode(errors="replace").strip().splitlines() or ["it said nothing"])[-1]


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
