"""Who opens and closes a serial line: a device that is powered by its port starts when somebody plugs in.

A pseudo-terminal does not tell its master; inotify does (Linux).
"""

import contextlib
import ctypes
import os
import struct

_OPEN, _CLOSE = 0x20, 0x18  # linux/inotify.h: IN_OPEN; IN_CLOSE_WRITE and IN_CLOSE_NOWRITE
_EVENT = struct.Struct("iIII")


class OpenWatch:
    """Watches the line at ``path``; ``clients`` have it open now. Raises OSError where it cannot be watched."""

    def __init__(self, path: str) -> None:
        self.clients = 0
        library = ctypes.CDLL(None, use_errno=True)
        self._fd = library.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
        if self._fd < 0 or library.inotify_add_watch(self._fd, os.fsencode(path), _OPEN | _CLOSE) < 0:
            number = ctypes.get_errno()
            self.close()
            raise OSError(number, "the line cannot be watched")

    def filenos(self) -> list[int]:
        """Descriptor to wait on."""
        return [self._fd] if self._fd >= 0 else []

    def opened(self) -> bool:
        """Whether somebody has opened the line since the last call."""
        opens = 0
        for mask in self._masks():
            opens += bool(mask & _OPEN)
            self.clients = max(self.clients + bool(mask & _OPEN) - bool(mask & _CLOSE), 0)
        return opens > 0

    def _masks(self) -> list[int]:
        data = b""
        with contextlib.suppress(OSError):
            data = os.read(self._fd, 65536)
        masks, at = [], 0
        while at + _EVENT.size <= len(data):
            _watch, mask, _cookie, length = _EVENT.unpack_from(data, at)
            masks.append(mask)
            at += _EVENT.size + length
        return masks

    def close(self) -> None:
        """Ends the watch."""
        if self._fd >= 0:
            os.close(self._fd)
        self._fd = -1


class PortPower:
    """Power from the port at ``path``; where that cannot be ``watched``, as no line can, somebody always has it."""

    def __init__(self, path: str) -> None:
        self._watch = _watch(path)
        self.watched = self._watch is not None

    def filenos(self) -> list[int]:
        """Descriptors to wait on."""
        return self._watch.filenos() if self._watch else []

    def opened(self) -> bool:
        """Whether somebody has opened the port since the last call."""
        return self._watch is not None and self._watch.opened()

    def taken(self) -> bool:
        """Whether somebody has it open."""
        self.opened()
        return self._watch is None or self._watch.clients > 0

    def close(self) -> None:
        """Ends the watch."""
        if self._watch:
            self._watch.close()


def _watch(path: str) -> OpenWatch | None:
    if not path.startswith("/"):
        return None
    try:
        return OpenWatch(path)
    except (OSError, AttributeError):
        return None
