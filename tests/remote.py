"""A mock in another process, spoken to line by line, and a wire in memory for one in this process."""

import contextlib
import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any


class Remote:
    """The process ``python -m MODULE``: it prints its endpoints, then answers each order; every line is JSON."""

    def __init__(self, module: str, *arguments: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            cwd=Path(__file__).parents[1],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.endpoints: dict[str, str] = self._answer()

    def order(self, **order: object) -> dict[str, Any]:
        """Sends an order and returns what is answered once it is obeyed."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(order) + "\n")
        self._process.stdin.flush()
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        answer: dict[str, Any] = json.loads(self._process.stdout.readline())
        return answer

    def close(self) -> None:
        """Ends the process."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.close()
        self._process.wait(10)
        self._process.stdout.close()


def say(answer: object) -> None:
    """The other end: one line of JSON."""
    sys.stdout.write(json.dumps(answer) + "\n")
    sys.stdout.flush()


def long_ago() -> int:
    """A running clock, behind every time that a test names [ns]."""
    return time.monotonic_ns() - (1 << 60)


class MemoryWire:
    """A wire without a kernel: what the client says waits in ``said``, what the mock wrote stands in ``sent``."""

    def __init__(self, endpoint: str = "memory") -> None:
        self.endpoint = endpoint
        self.said = b""
        self.sent: list[bytes] = []
        self.closed = False

    def filenos(self) -> list[int]:
        return []

    def read(self) -> bytes:
        said, self.said = self.said, b""
        return said

    def write(self, data: bytes) -> None:
        self.sent.append(data)

    def close(self) -> None:
        self.closed = True

    def take(self) -> bytes:
        """What the mock wrote since the last call."""
        data = b"".join(self.sent)
        self.sent.clear()
        return data
