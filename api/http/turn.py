"""One thing at a time begins at the bench, and what moves ends with the turn of whoever began it."""

import contextlib
import threading
from collections.abc import Callable, Iterator

from api.http.lease import LeaseRegistry


class Turn:
    """Held while the bench begins anything: a start, a recovery, a job. ``lease`` is that of who began it, if any."""

    def __init__(self, control: Callable[[], LeaseRegistry]) -> None:
        self._control, self._lock = control, threading.RLock()
        self.lease = ""

    def __enter__(self) -> None:
        self._lock.acquire()

    def __exit__(self, *_: object) -> None:
        self._lock.release()

    @contextlib.contextmanager
    def under(self, lease: str) -> Iterator[None]:
        """The same under ``lease``; raises RequestRefused where that was lost while the turn was waited for."""
        with self:
            before, self.lease = self.lease, lease
            try:
                if lease:
                    self._control().check(lease)
                yield
            finally:
                self.lease = before

    @property
    def taken(self) -> bool:
        """Whether another thread has it."""
        free = self._lock.acquire(blocking=False)
        if free:
            self._lock.release()
        return not free

    @property
    def attended(self) -> bool:
        """False where somebody else is in control: a recovery takes longer than a lease lasts, and goes on alone."""
        held = self._control().lease
        return not self.lease or held is None or held.id == self.lease
