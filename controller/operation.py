"""Work under way, in the one form that the command line, HTTP and the page all show."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, TypeVar

from rig.errors import RigError, SafetyStop

State = Literal["running", "succeeded", "failed", "stopped"]
T = TypeVar("T")


class Cancelled(RigError):
    """A computation was asked to end before its end, and has."""


@dataclass(frozen=True)
class Progress:
    """A snapshot. ``time_left_s`` is what the rest takes by plan, else at the pace so far; None where neither is known.

    ``log`` is what it said, a sentence each; ``result`` is what it returned, once it has succeeded.
    """

    name: str
    state: State = "running"
    done: float = 0.0
    total: float = 1.0
    unit: str = ""
    message: str = ""
    time_left_s: float | None = None
    log: tuple[str, ...] = ()
    result: object = None


class Operation:
    """A named piece of work with progress, a log and a way to cancel it; safe to read and cancel from any thread.

    ``watch`` is called with the newest snapshot after each change, in the thread that works.
    """

    def __init__(
        self, name: str, total: float = 1.0, unit: str = "", now_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._lock = threading.Lock()
        self._progress = Progress(name, total=total, unit=unit)
        self._cancel = threading.Event()
        self._now_s = now_s
        self._began_s = self._advanced_s = now_s()
        self._ends_s: float | None = None
        self.watch: Callable[[Progress], object] = lambda _: None

    @property
    def progress(self) -> Progress:
        """How it stands now."""
        with self._lock:
            return replace(self._progress, time_left_s=self._time_left_s())

    def _time_left_s(self) -> float | None:
        now = self._progress
        if now.state == "running" and self._ends_s is not None:
            return max(0.0, self._ends_s - self._now_s())
        if now.state != "running" or not now.done:
            return None
        took_s = self._advanced_s - self._began_s
        return max(0.0, took_s * (now.total - now.done) / now.done - (self._now_s() - self._advanced_s))

    def expect(self, rest_s: float) -> None:
        """Says how long the rest takes from now on, where that is planned."""
        self._ends_s = self._now_s() + rest_s

    def advance(self, done: float, message: str) -> None:
        """Says how far it is, and what comes now."""
        self._advanced_s = self._now_s()
        self._change(done=done, message=message)

    def step(self, message: str, done: float) -> None:
        """``advance`` for work that can end at once: raises Cancelled where it was asked to."""
        self.refuse_cancelled(message)
        self.advance(done, message)

    def refuse_cancelled(self, message: str) -> None:
        """Raises Cancelled, with what comes no more, where it was asked to end."""
        if self.cancelled:
            raise Cancelled(f"{self._progress.name} was cancelled before: {message}")

    def say(self, *sentences: str) -> None:
        """Adds to the log."""
        self._change(log=(*self._progress.log, *sentences))

    def run(self, work: Callable[[], T]) -> T:
        """What ``work`` returns or raises, and how that ended in the snapshot."""
        try:
            result = work()
        except (SafetyStop, Cancelled, KeyboardInterrupt) as stop:
            self._change(state="stopped", message=str(stop) or "interrupted")
            raise
        except RigError as error:
            self._change(state="failed", message=str(error))
            raise
        except BaseException as error:
            text = f"the job met an error of its own: {type(error).__name__}: {error}"
            self._change(state="failed", message=text)
            raise
        self._change(state="succeeded", message="done", result=result)
        return result

    def _change(self, **changes: object) -> None:
        with self._lock:
            self._progress = replace(self._progress, **changes)  # type: ignore[arg-type]
        self.watch(self.progress)

    def cancel(self) -> None:
        """Asks it to end soon."""
        self._cancel.set()

    @property
    def cancelled(self) -> bool:
        """Whether it was asked to end."""
        return self._cancel.is_set()
