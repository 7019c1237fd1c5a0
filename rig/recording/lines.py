"""JSON lines over a pipe, read without ever blocking: how recorder and controller talk."""

import json
import os
import select


class Lines:
    """The reading end. ``ended`` is set once the other side has closed the pipe."""

    def __init__(self, fd: int) -> None:
        self._fd = fd
        self._rest = b""
        self.ended = False

    def wait(self, timeout_s: float) -> list[bytes]:
        """Whole lines that are there, after waiting up to ``timeout_s`` for the first."""
        if self.ended or not select.select([self._fd], [], [], timeout_s)[0]:
            return []
        data = os.read(self._fd, 65_536)
        self.ended = not data
        *lines, self._rest = (self._rest + data).split(b"\n")
        return [line for line in lines if line.strip()]


def parse(line: bytes) -> dict[str, object]:
    """The JSON object in ``line``; empty where it is none."""
    try:
        value = json.loads(line)
    except ValueError:
        return {}
    return value if isinstance(value, dict) else {}


def encode(message: dict[str, object]) -> bytes:
    """One line."""
    return json.dumps(message).encode() + b"\n"
