"""Ports move bytes and nothing else: a serial line or a TCP connection, never blocking once open.

An address is a device path (``/dev/ttyUSB0``), ``tcp://host:port`` or ``udp://host:port``.
"""

import array
import contextlib
import fcntl
import os
import select
import socket
import termios
import time
from collections.abc import Callable
from typing import Protocol

import serial

from drivers.udp_port import UdpPort, udp_address
from rig.errors import DeviceError

CONNECT_TIMEOUT_S = 2.0  # a first packet that was lost is sent again after 1 s (RFC 6298)
CHUNK = 65536


class PortClosed(DeviceError):
    """The other end is gone: cable cut, adapter unplugged, connection closed."""


class Port(Protocol):
    """A byte pipe; every method returns at once."""

    address: str

    def fileno(self) -> int:
        """Descriptor to wait on."""

    def read(self) -> bytes:
        """What has arrived, possibly nothing; raises PortClosed."""

    def write(self, data: bytes) -> None:
        """Hands over all of ``data``; raises PortClosed, also where the other end does not take it."""

    def set_baud(self, baud: int) -> None:
        """Changes the line's speed where there is one."""

    def send_break(self) -> None:
        """Sends a serial break where there is a line."""

    def close(self) -> None:
        """Gives the port back; may be called twice."""


def read_waiting(tty: int, waiting: "array.array[int]") -> bytes:
    """Bytes that have come on descriptor ``tty``, possibly none; raises OSError where the other end is gone.

    Asks how much is there (into ``waiting``), and reads only then: read and poll of an empty tty wait for a kernel
    worker.
    """
    try:
        fcntl.ioctl(tty, termios.FIONREAD, waiting)
        return os.read(tty, CHUNK) if waiting[0] else b""
    except BlockingIOError:
        return b""


class SerialPort:
    """A serial line opened by pyserial for this process alone, then used through its descriptor."""

    def __init__(self, path: str, baud: int) -> None:
        self.address = path
        try:
            self._serial = serial.Serial(path, baud, timeout=0, write_timeout=0, exclusive=True)
        except (serial.SerialException, ValueError, OSError) as error:
            raise DeviceError(
                f"{path}: cannot be opened: {_plain(error)}; check the port name and who else uses it"
            ) from error
        self._fd = self._serial.fileno()
        self._waiting = array.array("i", [0])

    def fileno(self) -> int:
        """Descriptor to wait on."""
        return self._fd

    def read(self) -> bytes:
        """What has arrived; a hang-up makes the question itself fail, so nothing else need look for it."""
        self._check_open()
        try:
            return read_waiting(self._fd, self._waiting)
        except OSError as error:
            raise PortClosed(f"{self.address}: the line is gone ({_plain(error)}); check the cable") from error

    def _check_open(self) -> None:
        if self._fd < 0:
            raise PortClosed(f"{self.address}: this end closed the line; start the device again")

    def write(self, data: bytes) -> None:
        """Writes all of ``data`` or raises."""
        self._check_open()
        try:
            while data:
                data = data[os.write(self._fd, data) :]
        except OSError as error:
            raise PortClosed(
                f"{self.address}: the line takes no more bytes ({_plain(error)}); check the cable"
            ) from error

    def set_baud(self, baud: int) -> None:
        """Changes the line's speed."""
        self._serial.baudrate = baud

    def send_break(self) -> None:
        """Sends a break; a pseudo-terminal loses it silently."""
        self._serial.send_break(0.25)

    def close(self) -> None:
        """Gives the line back, and forgets a descriptor whose number the next file opened will get."""
        self._fd = -1
        with contextlib.suppress(OSError, serial.SerialException):
            self._serial.close()


class TcpPort:
    """A TCP connection with Nagle's algorithm off."""

    def __init__(self, host: str, port: int) -> None:
        self.address = f"tcp://{host}:{port}"
        try:
            self._socket = socket.create_connection((host, port), CONNECT_TIMEOUT_S)
        except OSError as error:
            raise DeviceError(f"{self.address}: no connection: {_plain(error)}; check address and power") from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setblocking(False)

    def fileno(self) -> int:
        """Descriptor to wait on."""
        return self._socket.fileno()

    def read(self) -> bytes:
        """What has arrived."""
        try:
            data = self._socket.recv(CHUNK)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise PortClosed(f"{self.address}: connection lost ({_plain(error)})") from error
        if not data:
            raise PortClosed(f"{self.address}: the other end closed the connection")
        return data

    def write(self, data: bytes) -> None:
        """Sends all of ``data`` or raises."""
        try:
            while data:
                data = data[self._socket.send(data) :]
        except OSError as error:
            raise PortClosed(f"{self.address}: connection lost ({_plain(error)})") from error

    def set_baud(self, baud: int) -> None:
        """A connection has no speed."""

    def send_break(self) -> None:
        """A connection has no break."""

    def close(self) -> None:
        """Closes the connection."""
        self._socket.close()


def open_port(address: str, baud: int) -> Port:
    """The port at ``address``; raises DeviceError with one sentence."""
    if address.startswith("udp://"):
        return UdpPort(*udp_address(address))
    if not address.startswith("tcp://"):
        return SerialPort(address, baud)
    host, _, port = address.removeprefix("tcp://").rpartition(":")
    if not host or not port.isdecimal():
        raise DeviceError(f"{address}: not a TCP address; write tcp://host:port")
    return TcpPort(host, int(port))


def read_until(port: Port, enough: Callable[[bytes], bool], timeout_s: float) -> bytes:
    """What arrives until it is ``enough`` or the time is over; for set-up only, it waits.

    The last look comes after the end of the time: what came while this process was paused is no silence.
    """
    deadline = time.monotonic() + timeout_s
    data, over = b"", False
    while not (over or enough(data)):
        left_s = deadline - time.monotonic()
        over = left_s <= 0
        select.select([port.fileno()], [], [], max(left_s, 0.0))
        data += port.read()
    return data


def _plain(error: Exception) -> str:
    return error.strerror if isinstance(error, OSError) and error.strerror else str(error)
