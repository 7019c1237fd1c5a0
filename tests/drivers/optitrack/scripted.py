"""A link whose other end is a table: each message that is sent is answered by a datagram."""

import os
from collections.abc import Iterator

from drivers.optitrack import packets


class ScriptedLink:
    """``answers`` by message number, of the first the bytes that ``spoilt`` says; ``push`` makes one arrive unasked."""

    def __init__(self) -> None:
        self.answers: dict[int, bytes] = {}
        self.spoilt: dict[int, int] = {}
        self.sent: list[int] = []
        self.closed = False
        self._waiting: list[bytes] = []
        self._readable = os.eventfd(0, os.EFD_NONBLOCK)

    def push(self, datagram: bytes) -> None:
        self._waiting.append(datagram)
        os.eventfd_write(self._readable, 1)

    def fileno(self) -> int:
        return self._readable

    def datagrams(self) -> Iterator[bytes]:
        if self._waiting:
            os.eventfd_read(self._readable)
        while self._waiting:
            yield self._waiting.pop(0)

    def send(self, datagram: bytes) -> None:
        message, _ = packets.split(datagram)
        self.sent.append(message)
        if message in self.answers:
            self.push(self.answers[message][: self.spoilt.pop(message, None)])

    def close(self) -> None:
        self.closed = True
