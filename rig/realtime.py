"""What a process asks of the kernel to come in time; each says whether it was granted, and none is required."""

import ctypes
import os
import struct
from pathlib import Path

PR_SET_TIMERSLACK = 29
MCL_CURRENT_AND_FUTURE = 3
WAKE_LATENCY = Path("/dev/cpu_dma_latency")


def ask_fifo(priority: int, *, alone: bool = False) -> str:
    """FIFO scheduling of this thread at ``priority``; why it was refused, empty where it was granted.

    What it begins inherits that, unless it is to be ``alone``.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | alone * os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except (OSError, AttributeError) as error:
        return str(error)
    return ""


def lock_memory() -> bool:
    """Keeps all of this process in memory, now and later."""
    return _libc_call("mlockall", MCL_CURRENT_AND_FUTURE)


def shorten_timer_slack() -> bool:
    """Lets sleeps of this thread end within 1 ns of their time, as far as the kernel can."""
    return _libc_call("prctl", PR_SET_TIMERSLACK, 1, 0, 0, 0)


def keep_cores_awake(device: Path = WAKE_LATENCY) -> bool:
    """Bounds the time in which idle cores wake to 0 us while this process lives (Linux, PM quality of service).

    A core that sleeps deeply takes 0.1 ms to begin with what has come, which the clocks of devices are read through.
    """
    try:
        fd = os.open(device, os.O_WRONLY | os.O_CLOEXEC)
        os.write(fd, struct.pack("i", 0))
    except OSError:
        return False
    return True


def _libc_call(name: str, *arguments: int) -> bool:
    try:
        return int(getattr(ctypes.CDLL(None), name)(*arguments)) == 0
    except (OSError, AttributeError):
        return False
