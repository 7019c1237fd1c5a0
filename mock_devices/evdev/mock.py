"""A foot switch: the byte stream of its input events, through a FIFO where there is no input device to make."""

import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from drivers.evdev.codec import DOWN, EV_KEY, UP, event
from mock_devices.interfaces import NEVER_NS

KEY_B = 48
SYN = (0, 0, 0)


class SwitchMock:
    """Pressed and let go by ``press``; ``clock_ns`` stamps its events, as the kernel does by the time of day."""

    name = "switch"
    due_ns = NEVER_NS

    def __init__(self, path: Path, clock_ns: Callable[[], int] = time.time_ns, key: int = KEY_B) -> None:
        self._path, self._clock_ns, self._key = path, clock_ns, key
        self._fd = -1
        self.plug()

    def plug(self) -> None:
        """Puts it in; the same address leads here."""
        if self._fd < 0:
            self._path.unlink(missing_ok=True)
            os.mkfifo(self._path, 0o600)
            # For reading too, so that the end is there before anyone listens, and nobody waits.
            self._fd = os.open(self._path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)

    def press(self, down: bool) -> None:
        """Its key goes down, or comes up."""
        if self._fd >= 0:
            now_ns = self._clock_ns()
            os.write(self._fd, event(now_ns, EV_KEY, self._key, DOWN if down else UP) + event(now_ns, *SYN))

    def endpoints(self) -> dict[str, str]:
        """Where its events come."""
        return {"events": str(self._path)}

    def filenos(self) -> list[int]:
        """It is told nothing."""
        return []

    def tick(self, now_ns: int) -> None:
        """Nothing is due."""

    def receive(self, now_ns: int) -> None:
        """Nothing comes."""

    def close(self) -> None:
        """Pulls it out: whoever listens sees the end."""
        if self._fd >= 0:
            os.close(self._fd)
            self._path.unlink(missing_ok=True)
        self._fd = -1


def own_path() -> Path:
    """A place for a FIFO of this process."""
    return Path(tempfile.mkdtemp(prefix="tissue-rig-switch-")) / "events"
