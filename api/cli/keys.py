"""Stop keys on the terminal, from before the bench starts until it has ended: no key pressed is thrown away."""

import contextlib
import os
import select
import sys
import termios
import threading
import tty
from collections.abc import Callable, Iterator
from typing import Self

from controller.stop.word import StopReason

STOP_KEYS = {"p": StopReason.PAIN, " ": StopReason.EMERGENCY, "s": StopReason.STOP}
LOOK_S = 0.1

Press = Callable[[StopReason], None]


class StopKeys:
    """Reads the terminal at ``fd`` in a thread; what is pressed before ``attach`` is handed over then."""

    def __init__(self, fd: int) -> None:
        self._fd = fd
        self._lock = threading.Lock()
        self._early: list[StopReason] = []
        self._press: Press | None = None
        self._over = threading.Event()
        self._before = termios.tcgetattr(fd)
        self._thread = threading.Thread(target=self._read, name="stop-keys", daemon=True)

    def __enter__(self) -> Self:
        # At once and without the flush that is the default: it would throw away what was pressed already.
        tty.setcbreak(self._fd, termios.TCSANOW)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()
        with contextlib.suppress(termios.error):  # the terminal may be gone by now
            termios.tcsetattr(self._fd, termios.TCSADRAIN, self._before)

    def attach(self, press: Press) -> None:
        """From now on keys go to ``press``, those pressed so far first."""
        with self._lock:
            self._press = press
            for kind in self._early:
                press(kind)
            self._early.clear()

    def _read(self) -> None:
        while not self._over.is_set():
            if not select.select([self._fd], [], [], LOOK_S)[0]:
                continue
            try:
                text = os.read(self._fd, 64).decode(errors="ignore").lower()
            except OSError:
                return
            if not text:
                return
            for key in text:
                if key in STOP_KEYS:
                    self._take(STOP_KEYS[key])

    def _take(self, kind: StopReason) -> None:
        with self._lock:
            if self._press:
                self._press(kind)
            else:
                self._early.append(kind)


@contextlib.contextmanager
def stop_keys() -> Iterator[Callable[[Press], None]]:
    """Where keys go is told to what this yields; without a terminal there are none."""
    if not sys.stdin.isatty():
        yield lambda _: None
        return
    with StopKeys(sys.stdin.fileno()) as keys:
        yield keys.attach
