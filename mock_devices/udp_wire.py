"""A device's UDP socket: it answers whoever spoke last, and a client that is gone hears nothing of it."""

import contextlib
import socket

# The largest datagram that IPv4 carries.
LARGEST_BYTES = 65_507


class UdpWire:
    """One datagram a write and a read."""

    def __init__(self, port: int = 0) -> None:
        self._port = port
        self._peer: tuple[str, int] | None = None
        self._open()
        self._port = self._socket.getsockname()[1]
        self.endpoint = f"127.0.0.1:{self._port}"

    def _open(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", self._port))
        self._socket.setblocking(False)

    def filenos(self) -> list[int]:
        """The socket."""
        return [self._socket.fileno()] if self._socket.fileno() >= 0 else []

    def read(self) -> bytes:
        """The next datagram, whose sender is the client from now on."""
        with contextlib.suppress(BlockingIOError, ConnectionError):
            if self._socket.fileno() >= 0:
                data, self._peer = self._socket.recvfrom(LARGEST_BYTES)
                return data
        return b""

    def write(self, data: bytes) -> None:
        """One datagram to the client there is."""
        if self._peer and self._socket.fileno() >= 0:
            with contextlib.suppress(OSError):
                self._socket.sendto(data, self._peer)

    def close(self) -> None:
        """Pulls the plug: from now on the other end hears that nobody is there."""
        self._peer = None
        self._socket.close()

    def plug(self) -> None:
        """In again, at the port it had."""
        if self._socket.fileno() < 0:
            self._open()
