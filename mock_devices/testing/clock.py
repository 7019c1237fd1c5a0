"""Clocks for tests."""

import time
from dataclasses import dataclass


@dataclass
class Clock:
    """Monotonic time that goes on only where a test says so; called it gives nanoseconds."""

    now_ns: int = 1_000_000_000

    def __call__(self) -> int:
        return self.now_ns

    def seconds(self) -> float:
        """The same in seconds."""
        return self.now_ns / 1e9

    def advance(self, duration_s: float) -> None:
        """Lets time pass."""
        self.now_ns += round(duration_s * 1e9)


def long_ago() -> int:
    """A running clock, behind every time that a test names [ns]."""
    return time.monotonic_ns() - (1 << 60)
