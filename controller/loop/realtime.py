"""Real-time privileges: each is tried, none is required, and what was granted is reported."""

import contextlib
import fcntl
import gc
import os
import sys
from collections.abc import Iterator

from controller.claims import state_folder
from rig.realtime import ask_fifo, keep_cores_awake, lock_memory, shorten_timer_slack

# Longer than nearly all wake-ups take: with 120 us the slowest hundredth stayed as late. A quarter of a core at 1 kHz.
SPIN_NS = 250_000
# A thread that computes may hold the interpreter for so long, half a cycle of the loop; Python's own is 5 ms.
SWITCH_S = 0.0005


def acquire(priority: int) -> dict[str, str]:
    """Asks for FIFO scheduling at ``priority`` (0: no), memory locked, cores awake, one its own, and fine timers."""
    granted = {
        "scheduler": _scheduler(priority),
        "memory": "locked" if lock_memory() else "not locked (not granted)",
        "core": _pin(),
        "idle_cores": "awake" if priority and keep_cores_awake() else "sleep",
        "timer_slack": "1 ns" if shorten_timer_slack() else "default",
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
        ask_fifo(priority)
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, *before)


def raise_priority(priority: int) -> None:
    """FIFO scheduling at ``priority`` (0: no) and locked memory where granted, and nothing else."""
    _scheduler(priority)
    lock_memory()
    gc.freeze()


def switch_promptly(within_s: float = SWITCH_S) -> None:
    """No thread of this process waits long for another that computes."""
    sys.setswitchinterval(within_s)


def spin_ns(granted: dict[str, str]) -> int:
    """How long before each cycle the loop may stop sleeping and watch the clock: without FIFO scheduling not at all."""
    return SPIN_NS if granted["scheduler"].startswith("SCHED_FIFO") else 0


def _scheduler(priority: int) -> str:
    if priority == 0:
        return "normal (not asked for)"
    if not ask_fifo(priority):
        return f"SCHED_FIFO {priority}"
    with contextlib.suppress(OSError):
        os.nice(-10)
    return "normal (SCHED_FIFO not granted)"


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
