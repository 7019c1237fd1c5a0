"""A limit on the time that somebody else's code may take."""

import contextlib
import signal
import threading
from collections.abc import Iterator


@contextlib.contextmanager
def within(limit_s: float) -> Iterator[None]:
    """Raises TimeoutError in what takes longer, as far as it runs in the main thread and Python can interrupt it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def late(*_: object) -> None:
        raise TimeoutError(f"not done within {limit_s:g} s")

    before = signal.signal(signal.SIGALRM, late)
    # Again and again, as what is raised in it may be swallowed there.
    left_s = signal.setitimer(signal.ITIMER_REAL, limit_s, limit_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        signal.setitimer(signal.ITIMER_REAL, *left_s)
