"""A port whose other end is a function: what is written is answered at once."""

import os
from collections.abc import Callable

from drivers.ports import PortClosed


class ScriptedPort:
    """``answer`` turns each write into the bytes that come back; ``push`` makes bytes arrive unasked."""

    address = "/dev/scripted"

    def __init__(self, answer: Callable[[bytes], bytes] = lambda _: b"") -> None:
        self.written: list[bytes] = []
        self.closed = False
        self._answer = answer
        self._arrivals, self._far_end = os.pipe()
        os.set_blocking(self._arrivals, False)

    def push(self, data: bytes) -> None:
        os.write(self._far_end, data)

    def fileno(self) -> int:
        return self._arrivals

    def read(self) -> bytes:
        self._check()
        try:
            return os.read(self._arrivals, 65536)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> None:
        self._check()
        self.written.append(data)
        self.push(self._answer(data))

    def _check(self) -> None:
        if self.closed:
            raise PortClosed(f"{self.address}: closed")

    def set_baud(self, baud: int) -> None:
        raise AssertionError("no driver here changes the baud")

    def send_break(self) -> None:
        raise AssertionError("no driver here sends a break")

    def close(self) -> None:
        if not self.closed:
            self.closed = True
            os.close(self._arrivals)
            os.close(self._far_end)
