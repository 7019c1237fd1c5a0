"""Opening a CAN adapter: python-can sets it up and closes it, the loop reads and writes its descriptor directly.

python-can reads the line byte by byte, which costs more than the rest of a cycle, and never looks at refusals.
"""

import array
import contextlib
import fcntl
import os
import re
import select
import termios
import time
from collections.abc import Callable
from typing import Protocol, cast

import can
from can.interfaces.slcan import slcanBus

from drivers.can.health import LOAD_NS, BusHealth, Counted
from drivers.can.slcan import BITRATE_COMMANDS, FLAGS_LINE, CanFrame, SlcanDecoder, decode_flags, encode_frame
from drivers.ports import PortClosed, read_waiting
from rig.errors import DeviceError, UsageError

ADAPTER_TIMEOUT_S = 0.5  # thirty deliveries of a USB adapter (16 ms)
TEXT = frozenset(b"\a\r\n" + bytes(range(0x20, 0x7F)))
# As often as load and errors are renewed, and nothing to a line that carries thousands of frames a second.
FLAGS_NS = LOAD_NS
NEVER_NS = 1 << 62
LINE_END, FLAGS_OR_REFUSAL = re.compile(rb"[\r\a]"), re.compile(rb"(?:^|[\r\n])(%b)\r|\a" % FLAGS_LINE.pattern)


class CanLink(Protocol):
    """An open way to a CAN bus; ``wait`` is the only method that sleeps."""

    @property
    def decoder(self) -> Counted:
        """What the link counts."""

    @property
    def health(self) -> BusHealth:
        """Load, errors and state of the bus."""

    def fileno(self) -> int:
        """Descriptor that turns readable when frames may have come."""

    def read(self) -> list[CanFrame]:
        """Frames that have arrived, possibly none; raises PortClosed."""

    def wait(self, timeout_s: float) -> None:
        """Sleeps until something arrives or the time is over."""

    def send(self, *frames: CanFrame) -> None:
        """Hands over ``frames`` in one write; raises PortClosed."""

    def close(self) -> None:
        """Gives the port back; may be called twice and never raises."""


class SlcanLink:
    """An SLCAN adapter that belongs to this process alone."""

    def __init__(self, path: str, bitrate: int, now: Callable[[], int] = time.monotonic_ns) -> None:
        """Opens, sets the bit rate and waits for a first answer; raises DeviceError or UsageError in one sentence."""
        self.path = path
        self.decoder = SlcanDecoder()
        self.health = BusHealth(bitrate)
        self._now, self._flags_due_ns = now, NEVER_NS
        self._waiting = array.array("i", [0])
        self._poller = select.poll()
        self._lock = _locked(path)
        try:
            self._bus = _opened(path, bitrate)
        except BaseException:
            os.close(self._lock)
            raise
        self._fd = self._bus.fileno()
        self._poller.register(self._fd, select.POLLIN)
        try:
            self._await_answer(now)
        except BaseException:
            self.close()
            raise

    def fileno(self) -> int:
        """Descriptor of the serial line behind the adapter."""
        return self._fd

    def read(self) -> list[CanFrame]:
        """Frames that have arrived, possibly none; raises PortClosed."""
        data = self._read_raw()
        frames, now_ns = self.decoder.feed(data) if data else [], self._now()
        self.health.refused = self.decoder.refused
        self.health.passed(frames, now_ns)
        self._look_at_flags(now_ns)
        return frames

    def _look_at_flags(self, now_ns: int) -> None:
        while self.decoder.replies:
            flags = decode_flags(self.decoder.replies.popleft())
            if flags is not None:
                self.health.flagged(flags)
        if now_ns >= self._flags_due_ns:
            self._flags_due_ns = now_ns + FLAGS_NS
            self._write(b"F\r")

    def wait(self, timeout_s: float) -> None:
        """Sleeps until something arrives or the time is over; for set-up only."""
        self._poller.poll(max(timeout_s, 0.0) * 1000)

    def send(self, *frames: CanFrame) -> None:
        """Hands over ``frames`` in one write; raises PortClosed, also where the adapter takes no more."""
        self._write(b"".join(map(encode_frame, frames)))
        self.health.passed(frames, self._now())

    def _write(self, lines: bytes) -> None:
        try:
            while lines:
                lines = lines[os.write(self._fd, lines) :]
        except OSError as error:
            raise self._gone(error.strerror) from error

    def close(self) -> None:
        """Closes channel and port through python-can; may be called twice and never raises."""
        with contextlib.suppress(can.CanError, OSError, termios.error):
            self._bus.shutdown()
        with contextlib.suppress(OSError, termios.error):
            self._bus.serialPortOrig.close()
        if self._lock >= 0:
            os.close(self._lock)
        self._lock = -1

    def _read_raw(self) -> bytes:
        try:
            return read_waiting(self._fd, self._waiting)
        except OSError as error:
            raise self._gone(error.strerror) from error

    def _gone(self, why: str | None) -> PortClosed:
        return PortClosed(f"{self.path}: the CAN adapter is gone ({why}); check its cable, then connect again")

    def _await_answer(self, now: Callable[[], int]) -> None:
        """Adapters differ in what they say to V, and old ones refuse it with BEL; all of them answer a line of text."""
        termios.tcflush(self._fd, termios.TCIFLUSH)
        answer = self._answered(b"V\r", LINE_END, now)
        if any(byte not in TEXT for byte in answer):
            raise DeviceError(
                f"{self.path}: this is not a CAN adapter: asked for its version (V) and got {answer[:12].hex(' ')}; "
                "another device is plugged in here, check axis.port"
            )
        if not answer:
            raise DeviceError(
                f"{self.path}: no CAN adapter answers: asked for its version (V) and got nothing within "
                f"{ADAPTER_TIMEOUT_S:g} s; check axis.port and the adapter's power"
            )
        # Many adapters know no F. What it says first is of the time before.
        said = FLAGS_OR_REFUSAL.search(self._answered(b"F\r", FLAGS_OR_REFUSAL, now))
        if said and said[1]:
            self._flags_due_ns = now() + FLAGS_NS

    def _answered(self, command: bytes, whole: re.Pattern[bytes], now: Callable[[], int]) -> bytes:
        """What comes until it is ``whole``, or the time is over."""
        self._write(command)
        deadline_ns = now() + int(ADAPTER_TIMEOUT_S * 1e9)
        answer = b""
        while not whole.search(answer) and now() < deadline_ns:
            self.wait((deadline_ns - now()) / 1e9)
            answer += self._read_raw()
        return answer


def _locked(path: str) -> int:
    """A descriptor that holds the port's advisory lock, taken before the first byte is sent into someone's session."""
    try:
        fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise DeviceError(f"{path}: cannot be opened: {error.strerror}; check the port of the CAN adapter") from error
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        termios.tcgetattr(fd)
    except BlockingIOError as error:
        os.close(fd)
        raise DeviceError(f"{path}: is in use by another session; close that one first") from error
    except (OSError, termios.error) as error:
        os.close(fd)
        raise DeviceError(f"{path}: is not a serial port; check the port of the CAN adapter") from error
    return fd


def _opened(path: str, bitrate: int) -> slcanBus:
    if bitrate not in BITRATE_COMMANDS:
        rates = ", ".join(str(rate) for rate in BITRATE_COMMANDS)
        raise UsageError(f"axis.bitrate {bitrate}: the adapter cannot do it; choose one of {rates} bit/s")
    try:
        bus = can.Bus(
            interface="slcan", channel=path, bitrate=bitrate, sleep_after_open=0, timeout=0, ignore_config=True
        )
    except (can.CanError, ValueError, OSError) as error:
        raise DeviceError(f"{path}: python-can cannot open the adapter: {error}; check the port") from error
    return cast(slcanBus, bus)
