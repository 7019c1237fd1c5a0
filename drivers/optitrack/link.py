"""The socket to Motive: commands go to one port, frames come from it or from another of the same computer."""

import socket
from collections.abc import Iterator

from drivers.udp_port import AT_ONCE, BUFFER_BYTES, LARGEST_BYTES, udp_address
from rig.errors import DeviceError

COMMAND_PORT = 1510


class MotiveLink:
    """Hears whatever ``udp://host:port`` sends from any of its ports, and nobody else."""

    def __init__(self, address: str) -> None:
        self.address = address
        host, port = udp_address(address)
        try:
            self._peer = socket.gethostbyname(host), port
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
            self._socket.bind(("0.0.0.0", 0))
        except OSError as error:
            raise DeviceError(f"{address}: cannot be opened: {error.strerror}; check address and network") from error
        self._socket.setblocking(False)

    def fileno(self) -> int:
        """Descriptor to wait on."""
        return self._socket.fileno()

    def datagrams(self) -> Iterator[bytes]:
        """What has come, so much at once that no flood can hold up a loop; raises DeviceError."""
        for _ in range(AT_ONCE):
            try:
                data, sender = self._socket.recvfrom(LARGEST_BYTES)
            except BlockingIOError:
                return
            except OSError as error:
                raise DeviceError(f"{self.address}: the network is gone ({error.strerror})") from error
            if sender[0] == self._peer[0]:
                yield data

    def send(self, datagram: bytes) -> None:
        """To the command port; raises DeviceError."""
        try:
            self._socket.sendto(datagram, self._peer)
        except OSError as error:
            raise DeviceError(f"{self.address}: cannot be reached ({error.strerror}); check the network") from error

    def close(self) -> None:
        """Gives the socket back."""
        self._socket.close()
