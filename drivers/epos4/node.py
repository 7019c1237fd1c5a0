"""The conversation with one CANopen node: SDO transfers with a deadline, heartbeats both ways, emergencies."""

import time
from collections.abc import Callable

from drivers.can.bus import CanLink
from drivers.can.slcan import CanFrame
from drivers.canopen.nmt import (
    EMERGENCY_ID,
    HEARTBEAT_ID,
    SDO_REQUEST_ID,
    SDO_RESPONSE_ID,
    Emergency,
    NmtCommand,
    NmtState,
    decode_emergency,
    decode_heartbeat,
    encode_heartbeat,
    encode_nmt,
)
from drivers.canopen.sdo import ABORT_TEXTS, Download, Transfer, Upload
from drivers.epos4.objects import Entry
from rig.errors import DeviceError

SDO_TIMEOUT_S = 1.0  # a drive answers within milliseconds, a busy computer stalls for tenths of a second
BOOT_TIMEOUT_S = 3.0  # three times an answer: a node that boots and one that is absent look the same until then
REPEAT_S = 0.2
TRIES = 3
NO_OBJECT = (0x06020000, 0x06090011)  # CiA 301: neither the object, nor the sub-index
Handler = Callable[[bytes, int], None]


class Node:
    """``handlers`` take data and time of arrival by identifier; the host's heartbeat starts with ``beat``."""

    def __init__(
        self, link: CanLink, number: int, host: int, beat_ms: int, name: str, now: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self.link = link
        self.name = name
        self.number = number
        self.timeout_s = SDO_TIMEOUT_S
        self.state: NmtState | None = None
        self.heard_ns = now()
        self.restarted = False
        self.emergency = Emergency(0, 0, b"")
        self.handlers: dict[int, Handler] = {
            SDO_RESPONSE_ID + number: self._take_sdo,
            EMERGENCY_ID + number: self._take_emergency,
            HEARTBEAT_ID + number: self._take_heartbeat,
        }
        self._now = now
        self._transfer: Transfer | None = None
        self._heartbeat = encode_heartbeat(host, NmtState.OPERATIONAL)
        self._beat_ns = beat_ms * 1_000_000
        self._beat_due_ns: int | None = None

    def is_in(self, state: NmtState) -> bool:
        """Whether the node's last heartbeat said ``state``."""
        return self.state is state

    def receive(self, now_ns: int) -> None:
        """Hands everything that has arrived to its handler."""
        for can_id, data, extended, remote in self.link.read():
            handler = self.handlers.get(can_id)
            if handler and not (extended or remote):
                handler(data, now_ns)

    def beat(self, now_ns: int) -> None:
        """Sends the host's heartbeat if it is due; the first call starts it, and with it the drive's watch."""
        if self._beat_due_ns is None or now_ns >= self._beat_due_ns:
            self._beat_due_ns = now_ns + self._beat_ns
            self.link.send(self._heartbeat)

    def pump(self, timeout_s: float) -> None:
        """Waits until something arrives or the time is over, and keeps the heartbeat going if it was started."""
        if self._beat_due_ns is not None:
            self.beat(self._now())
            timeout_s = min(timeout_s, (self._beat_due_ns - self._now()) / 1e9)
        self.link.wait(timeout_s)
        self.receive(self._now())

    def order(self, command: NmtCommand) -> None:
        """Sends an NMT command."""
        self.link.send(encode_nmt(command, self.number))

    def read(self, entry: Entry) -> int:
        """The object's value; raises DeviceError."""
        return self._value(entry, self._upload(entry, self.timeout_s, TRIES))

    def probe(self, entry: Entry) -> int:
        """The object's value from a node that may still be booting: asks again until it answers."""
        return self._value(entry, self._upload(entry, BOOT_TIMEOUT_S, round(BOOT_TIMEOUT_S / REPEAT_S)))

    def read_text(self, entry: Entry) -> str:
        """The object's text; raises DeviceError."""
        return self._upload(entry, self.timeout_s, TRIES).decode("latin-1").strip("\0 ")

    def write(self, entry: Entry, value: int, tries: int = TRIES) -> None:
        """Writes the object; raises DeviceError. ``tries`` is 1 where writing it twice is not like writing it once."""
        data = entry.pack(value)
        what = f"writing {value} to {entry}"
        self._run(lambda: Download(entry.index, entry.sub, data), what, self.timeout_s * tries / TRIES, tries)

    def _upload(self, entry: Entry, timeout_s: float, tries: int) -> bytes:
        return self._run(lambda: Upload(entry.index, entry.sub), f"reading {entry}", timeout_s, tries)

    def _value(self, entry: Entry, data: bytes) -> int:
        value = entry.unpack(data)
        if value is None:
            raise DeviceError(f"{self.name}: reading {entry} gave {len(data)} bytes instead of {entry.size}")
        return value

    def _run(self, begin: Callable[[], Transfer], what: str, timeout_s: float, tries: int) -> bytes:
        """Begins anew where no answer comes, or one that makes no sense: one damaged line must not cost a start."""
        for _ in range(tries):
            self._transfer = transfer = begin()
            self._request(transfer)
            deadline_ns = self._now() + round(timeout_s / tries * 1e9)
            while not transfer.ended and (left_ns := deadline_ns - self._now()) > 0:
                self.pump(left_ns / 1e9)
            if transfer.done or (transfer.abort is not None and not transfer.garbled):
                break
        return self._outcome(transfer, what, timeout_s, tries)

    def _outcome(self, transfer: Transfer, what: str, timeout_s: float, tries: int) -> bytes:
        if transfer.abort is not None:
            reason = ABORT_TEXTS.get(transfer.abort, "no text for this code")
            failure = NoObject if transfer.abort in NO_OBJECT else DeviceError
            raise failure(f"{self.name}: refused {what}: {transfer.abort:08X} {reason}")
        if not transfer.done:
            raise NoAnswer(
                f"{self.name}: does not answer: {what} took longer than {timeout_s:g} s, tries: {tries}; "
                "check its power, the CAN cable, axis.node and axis.bitrate"
            )
        return transfer.data

    def _request(self, transfer: Transfer) -> None:
        self.link.send(CanFrame(SDO_REQUEST_ID + self.number, transfer.request))

    def _take_sdo(self, data: bytes, _now_ns: int) -> None:
        if self._transfer and self._transfer.feed(data):
            self._request(self._transfer)

    def _take_emergency(self, data: bytes, _now_ns: int) -> None:
        self.emergency = decode_emergency(data) or self.emergency

    def _take_heartbeat(self, data: bytes, now_ns: int) -> None:
        state = decode_heartbeat(data)
        if state is None:
            return
        self.restarted |= state is NmtState.BOOT_UP
        self.state = state
        self.heard_ns = now_ns


class NoObject(DeviceError):
    """The node has no such object."""


class NoAnswer(DeviceError):
    """The node let a request go unanswered; whether it obeyed is not known."""
