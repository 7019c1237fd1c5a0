"""The mock's end of a wire: a pseudo-terminal or a listening TCP port, and the faults a wire can have."""

import contextlib
import os
import pty
import socket
import tty
from pathlib import Path
from typing import Protocol, runtime_checkable

from rig.errors import UsageError


class Wire(Protocol):
    """The far end of a port; what a client opens is ``endpoint``."""

    endpoint: str

    def filenos(self) -> list[int]:
        """Descriptors to wait on."""

    def read(self) -> bytes:
        """What the client sent."""

    def write(self, data: bytes) -> None:
        """Sends to the client; bytes nobody takes are lost, as on a wire."""

    def close(self) -> None:
        """Cuts the wire for good."""


@runtime_checkable
class Pluggable(Protocol):
    """A wire whose plug can be pulled and pushed in again."""

    def close(self) -> None:
        """Pulls it: the client sees a hang-up."""

    def plug(self) -> None:
        """Pushes it in again; the same address leads here."""


class OnWire:
    """What every mock answers about the wire it is on."""

    def __init__(self, wire: Wire) -> None:
        self._wire = wire

    def endpoints(self) -> dict[str, str]:
        """Kind of port to address."""
        return {"tcp" if ":" in self._wire.endpoint else "serial": self._wire.endpoint}

    def filenos(self) -> list[int]:
        """Descriptors to wait on."""
        return self._wire.filenos()

    def close(self) -> None:
        """Cuts the wire."""
        self._wire.close()


class PtyWire:
    """A serial line; its endpoint is a device path that any serial client opens.

    A pseudo-terminal has another name each time it is opened: only with a ``link`` to it can it be plugged in again.
    """

    def __init__(self, link: Path | None = None) -> None:
        self._link = link
        self._open()
        self.endpoint = str(link) if link else os.ttyname(self._slave)

    def _open(self) -> None:
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        if self._link:
            self._link.unlink(missing_ok=True)
            self._link.symlink_to(os.ttyname(self._slave))

    def plug(self) -> None:
        """A new line under the old name; raises UsageError without a link."""
        if self._link is None:
            raise UsageError("a line can be plugged in again only under a lasting name: serve with --links FOLDER")
        if self._master < 0:
            self._open()

    def filenos(self) -> list[int]:
        """The master side."""
        return [self._master] if self._master >= 0 else []

    def read(self) -> bytes:
        """What the client sent."""
        try:
            return os.read(self._master, 65536) if self._master >= 0 else b""
        except OSError:
            return b""

    def write(self, data: bytes) -> None:
        """A full line drops the rest, as an unread UART does."""
        if self._master >= 0:
            with contextlib.suppress(OSError):
                os.write(self._master, data)

    def close(self) -> None:
        """Closes both ends: the client sees a hang-up."""
        for fd in (self._slave, self._master):
            with contextlib.suppress(OSError):
                os.close(fd)
        if self._link:
            self._link.unlink(missing_ok=True)
        self._master = self._slave = -1


class TcpWire:
    """A listening port with one client at a time; a new client replaces the old one."""

    def __init__(self, port: int = 0) -> None:
        self._listen(port)
        self._client: socket.socket | None = None
        self._port = self._listener.getsockname()[1]
        self.endpoint = f"127.0.0.1:{self._port}"

    def _listen(self, port: int) -> None:
        self._listener = socket.create_server(("127.0.0.1", port))
        self._listener.setblocking(False)

    def plug(self) -> None:
        """Listens again, on the port it had."""
        if self._listener.fileno() < 0:
            self._listen(self._port)

    def filenos(self) -> list[int]:
        """Listener and client."""
        if self._listener.fileno() < 0:
            return []
        return [self._listener.fileno(), *([self._client.fileno()] if self._client else [])]

    def read(self) -> bytes:
        """Accepts a waiting client, then reads what it sent."""
        self._accept()
        try:
            data = self._client.recv(65536) if self._client else None
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if data == b"":
            self._drop()
        return data or b""

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            client, _ = self._listener.accept()
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._drop()
            self._client = client

    def _drop(self) -> None:
        if self._client:
            self._client.close()
        self._client = None

    def write(self, data: bytes) -> None:
        """Sends to the client there is."""
        try:
            if self._client:
                self._client.sendall(data)
        except OSError:
            self._drop()

    def close(self) -> None:
        """Closes client and listener."""
        self._drop()
        self._listener.close()
