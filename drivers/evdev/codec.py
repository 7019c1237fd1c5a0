"""Input events of Linux, bytes only: 24 bytes each (linux/input.h)."""

import struct
from typing import NamedTuple

# Seconds and microseconds of a 64-bit computer, type, code, value.
EVENT = struct.Struct("<qqHHi")
EV_KEY = 1
UP, DOWN = 0, 1


class KeyChange(NamedTuple):
    """A key that went down or came up, and when by the clock of the events."""

    at_ns: int
    code: int
    down: bool


class EventParser:
    """Bytes to changes of keys; repeats of a held key and other events are passed over."""

    def __init__(self) -> None:
        self._rest = b""

    def changes(self, data: bytes) -> list[KeyChange]:
        """Changes completed by ``data``, in order."""
        whole = self._rest + data
        end = len(whole) - len(whole) % EVENT.size
        self._rest = whole[end:]
        return [
            KeyChange(seconds * 1_000_000_000 + micros * 1000, code, value == DOWN)
            for seconds, micros, kind, code, value in EVENT.iter_unpack(whole[:end])
            if kind == EV_KEY and value in (UP, DOWN)
        ]

    def feed(self, data: bytes) -> list[int]:
        """Codes of keys that went down in ``data``, in order."""
        return [change.code for change in self.changes(data) if change.down]


def event(at_ns: int, kind: int, code: int, value: int) -> bytes:
    """One event as the kernel writes it."""
    return EVENT.pack(at_ns // 1_000_000_000, at_ns % 1_000_000_000 // 1000, kind, code, value)
