"""Whether the loop whose word this is still lives, as the stop process sees it."""

import os
import selectors
import time
from collections.abc import Callable

from controller.stop.word import StopWord

# Ten cycles of the slowest loop; one that wakes half as late stops by itself.
SILENT_NS = 200_000_000
# A loop that its supervisor has started is there after half a second.
ATTACH_S = 10.0


class LoopLife:
    """Whether the loop's process lives."""

    def __init__(self, page: StopWord, now: Callable[[], float]) -> None:
        self._page, self._now = page, now
        self._begun = now()
        self._pid = 0
        self._process = -1

    @property
    def gone(self) -> bool:
        """Whether a loop was there and has ended."""
        pid = self._page.loop_pid
        if pid != self._pid:
            self._follow(pid)
        if self._process >= 0 and _ended(self._process):
            os.close(self._process)
            self._process = -1
        return self._pid != 0 and self._process < 0

    def over(self) -> bool:
        """Whether nothing is left that could be stopped: it has ended, or has never come."""
        return self.gone or (self._page.loop_pid == 0 and self._now() - self._begun > ATTACH_S)

    def state(self) -> str:
        """In a word."""
        if self.gone:
            return "gone"
        if self._page.loop_beat_ns == 0:
            return "starting"
        silent = time.monotonic_ns() - self._page.loop_beat_ns > SILENT_NS
        return "silent" if silent else "running"

    def _follow(self, pid: int) -> None:
        if self._process >= 0:
            os.close(self._process)
        self._pid = pid
        try:
            self._process = os.pidfd_open(pid)
        except OSError:
            self._process = -1


def _ended(process: int) -> bool:
    with selectors.DefaultSelector() as selector:
        selector.register(process, selectors.EVENT_READ)
        return bool(selector.select(0))
