"""Samples of an SDK that blocks or calls back, for a loop that does neither.

What the SDK gives is put into a bounded queue together with its time of arrival, and an eventfd turns readable. The
driver that owns the source takes all of it in ``poll``. A full queue loses its oldest item and counts it: a loop must
know what is newest. The consumer never waits for a lock that a producer holds.
"""

import contextlib
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from typing import Generic, NamedTuple, TypeVar

from rig.errors import DeviceError, RigError

Item = TypeVar("Item")
# A second of 1 kHz: a loop that looks less often than that has stopped for it long ago.
CAPACITY = 1000
# An SDK's own read has a time-out of a tenth of a second to a second; whoever needs more says so.
CLOSE_S = 2.0


class Stamped(NamedTuple, Generic[Item]):
    """One item, and when it came on the host's monotonic clock."""

    item: Item
    arrival_ns: int


class ThreadedSource(Generic[Item]):
    """Either ``read`` is called again and again by a thread of its own, or the SDK's callback calls ``put``.

    ``read`` may block, for less than ``close_s``; what it returns is put, an empty answer is none. What it raises ends
    it and is raised by the next ``take``. ``name`` says in messages whose source this is.
    """

    def __init__(
        self,
        name: str,
        read: Callable[[], Iterable[Item]] | None = None,
        capacity: int = CAPACITY,
        close_s: float = CLOSE_S,
        now: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self.dropped = 0
        self._name, self._read, self._close_s, self._now = name, read, close_s, now
        self._items: deque[Stamped[Item]] = deque()
        self._capacity = capacity
        self._fd = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._putting = threading.Lock()
        self._ending = threading.Event()
        self._failure: BaseException | None = None
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begins to read; an SDK that calls back is told by its driver."""
        if self._read and not self._thread:
            self._thread = threading.Thread(target=self._run, args=(self._read,), name=self._name, daemon=True)
            self._thread.start()

    def fileno(self) -> int:
        """Descriptor that turns readable when there is something to take."""
        return self._fd

    def put(self, item: Item) -> None:
        """From any thread: one item that came now; after ``close`` it is thrown away."""
        arrived = Stamped(item, self._now())
        with self._putting:
            if self._fd < 0:
                return
            while len(self._items) >= self._capacity:
                with contextlib.suppress(IndexError):  # taken meanwhile
                    self._items.popleft()
                    self.dropped += 1
            self._items.append(arrived)
            self._wake()

    def fail(self, error: BaseException) -> None:
        """From any thread: the source is at its end; the first cause is kept, and raised by ``take``."""
        with self._putting:
            self._failure = self._failure or error
            if self._fd >= 0:
                self._wake()

    def take(self) -> list[Stamped[Item]]:
        """All that came, oldest first; raises DeviceError once nothing is left before a failure."""
        if self._fd < 0:
            raise DeviceError(f"{self._name}: this end closed it; start the device again")
        with contextlib.suppress(BlockingIOError):
            os.eventfd_read(self._fd)
        taken: list[Stamped[Item]] = []
        with contextlib.suppress(IndexError):
            while len(taken) < self._capacity:
                taken.append(self._items.popleft())
        if self._failure and not taken:
            raise self._told(self._failure) from self._failure
        return taken

    def close(self) -> bool:
        """Ends reading; False where the SDK did not come back in time, whose thread then ends with the process."""
        self._ending.set()
        if self._thread and self._thread is not threading.current_thread():
            self._thread.join(self._close_s)
        with self._putting:
            if self._fd >= 0:
                os.close(self._fd)
            self._fd = -1
        return not (self._thread and self._thread.is_alive())

    def _run(self, read: Callable[[], Iterable[Item]]) -> None:
        try:
            while not self._ending.is_set():
                for item in read():
                    self.put(item)
        except BaseException as error:  # whatever an SDK raises is said where the device is polled
            self.fail(error)

    def _wake(self) -> None:
        # A counter at its end is readable already.
        with contextlib.suppress(BlockingIOError):
            os.eventfd_write(self._fd, 1)

    def _told(self, error: BaseException) -> DeviceError:
        what = str(error) if isinstance(error, RigError) else f"{type(error).__name__}: {error}"
        return DeviceError(f"{self._name}: its reading ended: {what}; check power and cable, then start it again")
