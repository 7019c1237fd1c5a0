"""A thread that waits in the maker's library, since that has no descriptor to wait on, and hands on what came."""

import contextlib
import os
import threading
import time
from collections import deque
from collections.abc import Callable
from types import ModuleType
from typing import Any, NamedTuple

from drivers.lsl.library import ClockCorrection
from rig.errors import DeviceError

# Samples of ten seconds at 1 kHz: whoever takes none for so long has lost them, which is counted.
MOST = 10_000
WAIT_S = 0.1
# The library measures anew about every two seconds; clocks of 300 ppm drift apart by 1.5 ms meanwhile.
CORRECT_EVERY_S = 5.0
LEAVE_S = 2.0

Ask = Callable[[ModuleType, Any, float], ClockCorrection]


class Pulled(NamedTuple):
    """One sample as the library gave it."""

    values: tuple[float, ...]
    stamp_s: float
    arrival_ns: int


class Puller:
    """Runs from its making to ``close``. What it holds is bounded; ``dropped`` counts what found no place."""

    def __init__(self, pylsl: ModuleType, inlet: Any, ask: Ask) -> None:
        self._pylsl, self._inlet, self._ask = pylsl, inlet, ask
        self._held: deque[Pulled | ClockCorrection] = deque()
        self._error = ""
        self.dropped = 0
        self._event = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="lsl", daemon=True)
        self._thread.start()

    def fileno(self) -> int:
        """Turns readable when something came."""
        return self._event

    def take(self) -> list[Pulled | ClockCorrection]:
        """What came since the last call; raises DeviceError where the stream is lost, once nothing is left of it."""
        with contextlib.suppress(BlockingIOError):
            os.eventfd_read(self._event)
        found = [self._held.popleft() for _ in range(len(self._held))]
        if self._error and not found:
            raise DeviceError(self._error)
        return found

    def close(self) -> None:
        """Ends the thread, within a deadline; may be called twice."""
        self._ending.set()
        self._thread.join(LEAVE_S)
        if self._event >= 0 and not self._thread.is_alive():
            os.close(self._event)
            self._event = -1

    def _run(self) -> None:
        due_s = time.monotonic() + CORRECT_EVERY_S
        while not self._ending.is_set():
            try:
                self._pull()
                if time.monotonic() >= due_s:
                    due_s = time.monotonic() + CORRECT_EVERY_S
                    self._correct()
            except RuntimeError as error:
                self._error = f"the stream is lost: {error}; start its program again"
                os.eventfd_write(self._event, 1)
                return

    def _pull(self) -> None:
        values, stamp_s = self._inlet.pull_sample(timeout=WAIT_S)
        if values is None:
            return
        self._hold(Pulled(tuple(map(float, values)), float(stamp_s), time.monotonic_ns()))

    def _correct(self) -> None:
        """A measurement that does not succeed leaves the one before."""
        with contextlib.suppress(self._pylsl.util.TimeoutError):
            self._hold(self._ask(self._pylsl, self._inlet, WAIT_S))

    def _hold(self, item: Pulled | ClockCorrection) -> None:
        if len(self._held) >= MOST:
            self.dropped += 1
            return
        self._held.append(item)
        os.eventfd_write(self._event, 1)
