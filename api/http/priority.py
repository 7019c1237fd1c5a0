"""Which of the service's threads goes first where cores are short: the event loop, which takes stops, then its workers.

The force loop, the stop process and a simulated bench have real-time priority, and the event loop has to find a core
beside them: at normal priority it waited for one a third of the time while another core had room.
"""

import contextlib
import functools
import inspect
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rig.realtime import ask_fifo

# A core that is short is the clients' loss: those that look on go on asking, one that stops waits.
NICE = -15
# Below whatever else has real-time priority here.
PRIORITY = 1


def lead() -> None:
    """This thread goes before all at normal priority, where granted, and what it begins does not.

    Not on a single core, of which a service that is flooded would leave the recorder nothing.
    """
    if len(os.sched_getaffinity(0)) > 1:
        ask_fifo(PRIORITY, alone=True)


def go_at(nice: int) -> None:
    """Every thread of this process at this priority, where granted."""
    with contextlib.suppress(OSError):
        for thread in Path("/proc/self/task").iterdir():
            os.setpriority(os.PRIO_PROCESS, int(thread.name), nice)


def follow() -> None:
    """This thread at the niceness of the process' first, where granted: the leader waits for what it holds."""
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, os.getpriority(os.PRIO_PROCESS, os.getpid()))


def following(endpoint: Callable[..., Any]) -> Callable[..., Any]:
    """``endpoint``; one that is given a thread ``follow``s there."""
    if inspect.iscoroutinefunction(endpoint):
        return endpoint

    @functools.wraps(endpoint)
    def answered(*args: Any, **stated: Any) -> Any:
        follow()
        return endpoint(*args, **stated)

    return answered
