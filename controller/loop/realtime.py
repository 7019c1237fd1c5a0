"""Real-time privileges: each is tried, none is required, and what was granted is reported."""

import contextlib
import ctypes
import fcntl
import gc
import os
from collections.abc import Iterator

from controller.claims import state_folder

MCL_CURRENT_AND_FUTURE = 3
PR_SET_TIMERSLACK = 29
# Longer than nearly all wake-ups take: with 120 us the slowest hundredth stayed as late. A quarter of a core at 1 kHz.
SPIN_NS = 250_000


def acquire(priority: int) -> dict[str, str]:
    """Asks for FIFO scheduling at ``priority`` (0: no), locked memory, a core of its own and fine timers."""
    granted = {
        "scheduler": _scheduler(priority),
        "memory": _lock_memory(),
        "core": _pin(),
        "timer_slack": _timer_slack(),
    }
    gc.collect()
    gc.freeze()
    gc.disable()
    return granted | {"garbage_collector": "frozen"}


@contextlib.contextmanager
def promptly(priority: int) -> Iterator[None]:
    """FIFO scheduling of this thread at ``priority`` (0: no), where granted, until the block ends."""
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    if priority:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, *before)


def raise_priority(priority: int) -> None:
    """FIFO scheduling at ``priority`` (0: no) and locked memory where granted, and nothing else."""
    _scheduler(priority)
    _lock_memory()
    gc.freeze()


def spin_ns(granted: dict[str, str]) -> int:
    """How long before each cycle the loop may stop sleeping and watch the clock: without FIFO scheduling not at all."""
    return SPIN_NS if granted["scheduler"].startswith("SCHED_FIFO") else 0


def _scheduler(priority: int) -> str:
    if priority == 0:
        return "normal (not asked for)"
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        with contextlib.suppress(OSError):
            os.nice(-10)
        return "normal (SCHED_FIFO not granted)"
    return f"SCHED_FIFO {priority}"


def _lock_memory() -> str:
    libc = ctypes.CDLL(None, use_errno=True)
    return "locked" if libc.mlockall(MCL_CURRENT_AND_FUTURE) == 0 else "not locked (not granted)"


def _pin() -> str:
    cores = sorted(os.sched_getaffinity(0), reverse=True)
    if len(cores) < 2:
        return "not pinned (one core)"
    core = next((core for core in cores if _take(core)), cores[0])
    try:
        os.sched_setaffinity(0, {core})
    except OSError:
        return "not pinned (not granted)"
    return f"pinned to {core}"


def _take(core: int) -> bool:
    """Takes a core for as long as this process lives: two loops that watch the clock on one leave others no time."""
    fd = os.open(state_folder() / f"core-{core}", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(fd)
        return False
    return True


def _timer_slack() -> str:
    libc = ctypes.CDLL(None, use_errno=True)
    return "1 ns" if libc.prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0) == 0 else "default"
