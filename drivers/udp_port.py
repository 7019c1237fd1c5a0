"""A UDP port: bound, connected to one peer, never blocking. Each read is one datagram, and none is cut unnoticed."""

import socket
from collections.abc import Iterator

from rig.errors import DeviceError

# The largest that IPv4 carries; what devices of a bench send is below 1,500 bytes.
LARGEST_BYTES = 65_507
# A quarter of a second at 7,000 records of 36 bytes, each kept by the kernel as about 800; it takes what is allowed.
BUFFER_BYTES = 1 << 21
# Datagrams taken at once: ten cycles of 7,000 a second. What comes faster than that waits, and cannot hold up a loop.
AT_ONCE = 70


def udp_address(address: str) -> tuple[str, int]:
    """Host and port of ``udp://host:port``; raises DeviceError."""
    host, _, port = address.removeprefix("udp://").rpartition(":")
    if not address.startswith("udp://") or not host or not port.isdecimal() or not 0 < int(port) < 1 << 16:
        raise DeviceError(f"{address}: not a UDP address; write udp://host:port")
    return host.strip("[]"), int(port)


class UdpPort:
    """A socket that hears ``host`` at ``port`` alone; ``local_port`` 0: any.

    ``cut`` counts datagrams that were longer than ``largest`` bytes, none of which is handed on.
    """

    def __init__(self, host: str, port: int, local_port: int = 0, largest: int = LARGEST_BYTES) -> None:
        self.address = f"udp://{host}:{port}"
        self.cut = 0
        self._largest = largest
        try:
            family, kind, protocol, _, peer = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind, protocol)
        except OSError as error:
            raise self._refused(error) from error
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
            self._socket.bind(("::" if family == socket.AF_INET6 else "0.0.0.0", local_port))
            self._socket.connect(peer)
        except OSError as error:
            self._socket.close()
            raise self._refused(error) from error
        self._socket.setblocking(False)

    def _refused(self, error: OSError) -> DeviceError:
        return DeviceError(f"{self.address}: cannot be opened: {error.strerror}; check address and network")

    def fileno(self) -> int:
        """Descriptor to wait on."""
        return self._socket.fileno()

    def read(self) -> bytes:
        """The next datagram, nothing where none has come; raises DeviceError where nobody listens at the other end."""
        return next(self.datagrams(1), b"")

    def datagrams(self, most: int = AT_ONCE) -> Iterator[bytes]:
        """Datagrams that have come, ``most`` of them at once."""
        for _ in range(most):
            try:
                data = self._socket.recv(self._largest + 1)
            except BlockingIOError:
                return
            except OSError as error:
                raise self._lost(error) from error
            if len(data) > self._largest:
                self.cut += 1
            else:
                yield data

    def write(self, data: bytes) -> None:
        """Sends one datagram; raises DeviceError, also where the one before it met nobody."""
        try:
            self._socket.send(data)
        except OSError as error:
            raise self._lost(error) from error

    def _lost(self, error: OSError) -> DeviceError:
        if self._socket.fileno() < 0:
            return DeviceError(f"{self.address}: this end closed the port; start the device again")
        return DeviceError(f"{self.address}: nobody answers there ({error.strerror}); check address, power and network")

    def set_baud(self, baud: int) -> None:
        """Datagrams have no speed."""

    def send_break(self) -> None:
        """Datagrams have no break."""

    def close(self) -> None:
        """Gives the port back."""
        self._socket.close()
