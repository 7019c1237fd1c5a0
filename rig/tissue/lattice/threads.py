"""Run one compiled function on several parts of the block at once.

Compiled functions release the interpreter's lock, so plain threads do. Threads of OpenMP spin while they wait, which on
a busy machine costs whole scheduler slices, and their code takes longer to compile.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TypeVar, TypeVarTuple

Result = TypeVar("Result")
Arguments = TypeVarTuple("Arguments")
MOST_THREADS = 16  # a force of the study's block is then 0.2 ms each; handing out 16 parts takes 0.3 ms


def threads() -> int:
    """Threads to use: the cores this process may run on, at most 16."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(available, MOST_THREADS)


@lru_cache(maxsize=1)
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(MOST_THREADS, thread_name_prefix="lattice")


# A forked child has the pool but not its threads.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)


def in_parts(function: Callable[[*Arguments], Result], parts: Sequence[tuple[*Arguments]]) -> list[Result]:
    """``function(*part)`` for every part, the first on this thread; results in order."""
    others = [_pool().submit(function, *part) for part in parts[1:]]
    first = function(*parts[0])
    return [first, *(other.result() for other in others)]


def cut(size: int, count: int) -> list[tuple[int, int]]:
    """``size`` items in ``count`` nearly equal ranges."""
    return [(size * part // count, size * (part + 1) // count) for part in range(count)]
