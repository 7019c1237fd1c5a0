"""CAN by a raw socket of the kernel (SocketCAN): the codec of ``struct can_frame``, and the link that owns the socket.

The machines this was made on have no AF_CAN: codec and link were run over a pair of SEQPACKET sockets, which keep
frames apart as a raw CAN socket does; ``open_socket`` alone has never met a kernel with CAN.
"""

import contextlib
import errno
import json
import select
import socket
import struct
import subprocess
import time
from collections.abc import Callable
from typing import NamedTuple

from drivers.can.health import BusHealth, BusState
from drivers.can.slcan import CanFrame
from drivers.ports import PortClosed
from rig.errors import DeviceError

# linux/can.h and linux/can/error.h
RAW_ERROR_FILTER = 2  # linux/can/raw.h
_FRAME = struct.Struct("=IB3x8s")
_EXTENDED, _REMOTE, _ERROR = 0x8000_0000, 0x4000_0000, 0x2000_0000
_ID_BITS = 0x1FFF_FFFF
TX_TIMEOUT, LOST_ARBITRATION, CONTROLLER, PROTOCOL, TRANSCEIVER, NO_ACK = 0x01, 0x02, 0x04, 0x08, 0x10, 0x20
BUS_OFF, BUS_ERROR, RESTARTED = 0x40, 0x80, 0x100
_WARNING, _PASSIVE, _ACTIVE_AGAIN = 0x0C, 0x30, 0x40
FRAME_BYTES = _FRAME.size
# Sent in a row into a full buffer: with two frames a millisecond a quarter of a second in which nobody acknowledged.
FULL_LARGEST = 500
FULL = (errno.ENOBUFS, errno.EAGAIN)
# An interface's rate is what its clock divides into, and ISO 11898-1 lets no oscillator be farther off; rates that are
# in use differ by 6 % at least (750 and 800 kbit/s).
OFF_LARGEST = 0.0158
SHOWN_S = 2.0  # `ip` asks the kernel alone, and answers in milliseconds


class ErrorFrame(NamedTuple):
    """What the controller reports instead of a frame: classes of error, and details of the controller's state."""

    classes: int
    controller: int

    def state(self, before: BusState) -> BusState:
        """The bus' state after it."""
        if self.classes & BUS_OFF:
            return BusState.OFF
        if self.classes & RESTARTED or (self.classes & CONTROLLER and self.controller & _ACTIVE_AGAIN):
            return BusState.ACTIVE
        if self.classes & CONTROLLER and self.controller & _PASSIVE:
            return BusState.PASSIVE
        if self.classes & CONTROLLER and self.controller & _WARNING:
            return BusState.WARNING
        return before


def encode(frame: CanFrame) -> bytes:
    """The 16 bytes of ``struct can_frame``; raises ValueError where it is not a classical frame."""
    can_id, data, extended, remote = frame
    if len(data) > 8 or not 0 <= can_id < (1 << 29 if extended else 1 << 11):
        raise ValueError(f"not a classical CAN frame: identifier {can_id:#x}, {len(data)} bytes")
    flags = (_EXTENDED if extended else 0) | (_REMOTE if remote else 0)
    return _FRAME.pack(can_id | flags, len(data), bytes(8) if remote else data)


def decode(raw: bytes) -> CanFrame | ErrorFrame | None:
    """What the kernel handed over; None where it is no classical frame."""
    if len(raw) != FRAME_BYTES:
        return None
    word, size, data = _FRAME.unpack(raw)
    if word & _ERROR:
        return ErrorFrame(word & _ID_BITS, data[1])
    extended, remote = bool(word & _EXTENDED), bool(word & _REMOTE)
    can_id = word & _ID_BITS
    if size > 8 or (not extended and can_id >= 1 << 11):
        return None
    return CanFrame(can_id, bytes(size) if remote else data[:size], extended, remote)


class SocketCanLink:
    """A raw CAN socket that belongs to this process."""

    def __init__(
        self, sock: socket.socket, name: str, bitrate: int, now: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self.decoder = self.health = BusHealth(bitrate)
        self._sock, self._name, self._now = sock, name, now
        sock.setblocking(False)
        self._poller = select.poll()
        self._poller.register(sock, select.POLLIN)
        self._full = 0

    def fileno(self) -> int:
        """The socket."""
        return self._sock.fileno()

    def read(self) -> list[CanFrame]:
        """Frames that have arrived, possibly none; raises PortClosed, also where the bus went off."""
        frames: list[CanFrame] = []
        while raw := self._received():
            self._take(decode(raw), len(raw), frames)
        self.decoder.frames += len(frames)
        self.decoder.passed(frames, self._now())
        if self.decoder.state is BusState.OFF:
            raise self._gone("its controller went off the bus after too many errors")
        return frames

    def _take(self, found: CanFrame | ErrorFrame | None, size: int, frames: list[CanFrame]) -> None:
        if isinstance(found, CanFrame):
            frames.append(found)
        elif found is None:
            self.decoder.discarded_bytes += size
        else:
            self.decoder.error_frames += 1
            self.decoder.state = found.state(self.decoder.state)

    def _received(self) -> bytes:
        try:
            return self._sock.recv(FRAME_BYTES + 1)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise self._gone(str(error.strerror)) from error

    def wait(self, timeout_s: float) -> None:
        """Sleeps until something arrives or the time is over; for set-up only."""
        self._poller.poll(max(timeout_s, 0.0) * 1000)

    def send(self, *frames: CanFrame) -> None:
        """Hands over ``frames``; one for which there is no room is counted, and raises PortClosed when that lasts."""
        for frame in frames:
            self._send(encode(frame))
        self.decoder.passed(frames, self._now())

    def _send(self, raw: bytes) -> None:
        try:
            self._sock.send(raw)
            self._full = 0
        except OSError as error:
            if error.errno not in FULL:
                raise self._gone(str(error.strerror)) from error
            self.decoder.refused += 1
            self._full += 1
            if self._full >= FULL_LARGEST:
                raise self._gone("its send buffer stays full, as no node acknowledges") from error

    def close(self) -> None:
        """Gives the socket back; may be called twice and never raises."""
        self._sock.close()

    def _gone(self, why: str) -> PortClosed:
        return PortClosed(
            f"{self._name}: the CAN bus is gone ({why}); check bit rate, terminators, cable and power of the nodes"
        )


def shown_by_ip(name: str) -> str:
    """What iproute2 says of the interface ``name``, JSON; "" where it knows none, or is not there."""
    command = ["ip", "-details", "-json", "link", "show", name]
    with contextlib.suppress(OSError, subprocess.SubprocessError):
        return subprocess.run(command, capture_output=True, text=True, timeout=SHOWN_S, check=False).stdout
    return ""


def bitrate_of(name: str, show: Callable[[str], str]) -> int:
    """What the interface is set to, bit/s; 0 of one that says nothing, as vcan."""
    try:
        about = json.loads(show(name))[0]["linkinfo"]["info_data"]
        # A controller with a list of fixed rates states its own beside that (iproute2, ip/iplink_can.c).
        return int(about["bittiming"]["bitrate"] if "bittiming" in about else about["bittiming_bitrate"])
    except (ValueError, LookupError, TypeError):
        return 0


def refuse_other_rate(name: str, bitrate: int, show: Callable[[str], str]) -> None:
    """Raises DeviceError where the interface is set to another rate than that."""
    real = bitrate_of(name, show)
    if real and abs(real - bitrate) > OFF_LARGEST * bitrate:
        raise DeviceError(
            f"{name}: the interface is set to {real} bit/s where axis.bitrate is {bitrate}; correct axis.bitrate, or"
            f" `ip link set {name} down`, then `ip link set {name} up type can bitrate {bitrate}`"
        )


def open_socket(name: str) -> socket.socket:
    """A raw socket on the interface ``name``, with all error frames; raises DeviceError in one sentence."""
    if not hasattr(socket, "AF_CAN"):
        raise DeviceError(f"{name}: this system's Python knows no SocketCAN; use another axis.interface")
    try:
        sock = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    except OSError as error:
        raise DeviceError(
            f"{name}: this kernel has no CAN ({error.strerror}); load can_raw, or use another axis.interface"
        ) from error
    try:
        sock.setsockopt(socket.SOL_CAN_RAW, RAW_ERROR_FILTER, _ID_BITS)
        sock.bind((name,))
    except OSError as error:
        sock.close()
        raise DeviceError(
            f"{name}: cannot be opened: {error.strerror}; bring it up with `ip link set {name} up type can bitrate N`"
        ) from error
    return sock
