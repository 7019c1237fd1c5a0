"""Stops while no loop runs, at the start and in a calibration: a thread looks at the stop word and answers it.

The axis is braked by who moves it: the driver, which asks ``interrupted`` while it waits.
"""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Self

from controller.stop.word import Deed, Responder
from rig.errors import SafetyStop

LOOK_S = 0.002
SENTENCE = "stopped by a person: nothing moves; start again when that is safe"
# As the loop names such a stop, so that programs know it for none of the bench's own.
BY_A_PERSON = "operator_stop"


class StartGuard:
    """``with StartGuard(responder) as guard:`` around all that happens without a loop."""

    def __init__(self, responder: Responder, now: Callable[[], int] = time.monotonic_ns) -> None:
        self._responder, self._now = responder, now
        self._lock = threading.Lock()
        self._stopped = self._moving = False
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._look_on, name="stop-word", daemon=True)

    def __enter__(self) -> Self:
        self.look()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._thread.join()

    def interrupted(self) -> bool:
        """Whether a stop has been asked for."""
        return self._stopped

    @contextlib.contextmanager
    def moving(self) -> Iterator[None]:
        """Around what moves the axis; raises SafetyStop where a stop was asked for before or meanwhile."""
        with self._lock:
            self.refuse()
            self._moving = True
        deed = Deed.AXIS_LOST
        try:
            yield
            deed = Deed.START_ENDED
            self.refuse()
        except SafetyStop as stop:
            deed = Deed.START_BRAKED if deed is Deed.AXIS_LOST else deed
            raise SafetyStop(str(stop), BY_A_PERSON if self._stopped else stop.code) from stop
        finally:
            with self._lock:
                self._moving = False
                self._responder.answer(deed, self._now())

    def refuse(self) -> None:
        """Raises SafetyStop where a stop has been asked for."""
        if self._stopped:
            raise SafetyStop(SENTENCE, BY_A_PERSON)

    def look(self) -> None:
        """Takes what is asked, and answers it where nothing moves."""
        with self._lock:
            if self._responder.take(self._now()):
                self._stopped = True
                if not self._moving:
                    self._responder.answer(Deed.START_ENDED, self._now())

    def _look_on(self) -> None:
        while not self._over.wait(LOOK_S):
            self.look()
