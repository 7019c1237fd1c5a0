"""A terminal's window: what is written there is read, as long as it is open."""

import contextlib
import os
import select
import threading
from collections.abc import Iterator

LOOK_S = 0.05


class Window:
    """``terminal`` is the program's end."""

    def __init__(self) -> None:
        self._ours, self.terminal = os.openpty()
        self._closing = threading.Event()
        self._reader = threading.Thread(target=self._read, name="window")
        self._reader.start()

    def _read(self) -> None:
        while not self._closing.is_set():
            if select.select([self._ours], [], [], LOOK_S)[0]:
                with contextlib.suppress(OSError):
                    os.read(self._ours, 65_536)

    def close(self) -> None:
        """By its cross: the kernel tells whoever is controlled from there. May be called twice."""
        if self._closing.is_set():
            return
        self._closing.set()
        self._reader.join()
        os.close(self._ours)
        os.close(self.terminal)


@contextlib.contextmanager
def window() -> Iterator[Window]:
    """Open until it is closed, at last with the block."""
    found = Window()
    try:
        yield found
    finally:
        found.close()
