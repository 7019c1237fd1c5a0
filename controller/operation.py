"""What is under way, in the one form that the command line, HTTP and the page all show."""

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

State = Literal["running", "succeeded", "failed", "stopped"]


@dataclass(frozen=True)
class Progress:
    """A snapshot of an operation."""

    name: str
    state: State = "running"
    done: float = 0.0
    total: float = 1.0
    unit: str = ""
    message: str = ""
    result: Mapping[str, object] = field(default_factory=dict)


class Operation:
    """A named piece of work with progress and a way to stop it; safe to read and stop from any thread."""

    def __init__(self, name: str, total: float = 1.0, unit: str = "") -> None:
        self._lock = threading.Lock()
        self._progress = Progress(name, total=total, unit=unit)
        self._stop = threading.Event()

    @property
    def progress(self) -> Progress:
        """How it stands now."""
        with self._lock:
            return self._progress

    def advance(self, done: float, message: str) -> None:
        """Says how far it is."""
        self._change(done=done, message=message)

    def finish(self, state: State, message: str, result: Mapping[str, object] | None = None) -> None:
        """Says how it ended."""
        self._change(state=state, message=message, result=result or {})

    def _change(self, **changes: object) -> None:
        with self._lock:
            self._progress = replace(self._progress, **changes)  # type: ignore[arg-type]

    def stop(self) -> None:
        """Asks it to end soon."""
        self._stop.set()

    @property
    def stopping(self) -> bool:
        """Whether it was asked to end."""
        return self._stop.is_set()
