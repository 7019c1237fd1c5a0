"""Firmata 2.5, bytes only (https://github.com/firmata/protocol): what a board says, and what is said to it.

There is neither checksum nor sequence number. Bytes above 0x7F begin a message and never stand inside one, so a damaged
message is noticed where its data are cut short, and what is lost shows in time alone.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from drivers.roles import LinkCounters

ANALOG, REPORT_ANALOG, VERSION, START_SYSEX, END_SYSEX = 0xE0, 0xC0, 0xF9, 0xF0, 0xF7
FIRMWARE, MAPPING_QUERY, MAPPING, SAMPLING_INTERVAL = 0x79, 0x69, 0x6A, 0x7A
CAPABILITY_QUERY, CAPABILITY = 0x6B, 0x6C
NO_ANALOG = 127
# A capability report of the largest board that StandardFirmata knows has some 700 bytes.
LONGEST = 2048
DATA_BYTES = {ANALOG: 2, 0x90: 2, REPORT_ANALOG: 1, 0xD0: 1}


@dataclass(frozen=True)
class PinReading:
    """One analogue input: its number and its counts."""

    channel: int
    counts: int


@dataclass(frozen=True)
class Sysex:
    """A message of any length: its number and its data, seven bits a byte."""

    command: int
    data: bytes


@dataclass(frozen=True)
class Protocol:
    """Version of the protocol that the firmware speaks."""

    major: int
    minor: int


FirmataMessage = PinReading | Sysex | Protocol


def seven_bits(value: int) -> bytes:
    """Fourteen bits in two bytes, the lower first."""
    return bytes([value & 0x7F, value >> 7 & 0x7F])


def sysex(command: int, data: bytes = b"") -> bytes:
    """A message of any length; ``data`` has seven bits a byte."""
    return bytes([START_SYSEX, command]) + data + bytes([END_SYSEX])


def reading(channel: int, counts: int) -> bytes:
    """What a board sends of one analogue input."""
    return bytes([ANALOG | channel]) + seven_bits(counts)


def report(channel: int, on: bool) -> bytes:
    """Asks for one analogue input every sampling interval, or for it no more."""
    return bytes([REPORT_ANALOG | channel, on])


def sampling_interval(interval_ms: int) -> bytes:
    """Asks for another interval."""
    return sysex(SAMPLING_INTERVAL, seven_bits(interval_ms))


def firmware_of(data: bytes) -> tuple[str, str]:
    """Name and version in the data of a firmware report; the name's characters come in two bytes each."""
    version = f"{data[0]}.{data[1]}" if len(data) > 1 else ""
    pairs = zip(data[2::2], data[3::2], strict=False)
    return bytes(low | high << 7 & 0xFF for low, high in pairs).decode("latin-1"), version


def analog_channels(data: bytes) -> frozenset[int]:
    """Analogue inputs that a board has, from the data of its mapping: one byte a pin."""
    return frozenset(channel for channel in data if channel != NO_ANALOG)


class FirmataParser:
    """Messages out of pieces of any size; holds at most one message between calls."""

    def __init__(self, counters: LinkCounters) -> None:
        self._counters = counters
        self._held = bytearray()

    def feed(self, data: bytes) -> list[FirmataMessage]:
        """Messages completed by ``data``; what belongs to none is counted as discarded."""
        return [message for byte in data for message in self._byte(byte)]

    def _byte(self, byte: int) -> Iterator[FirmataMessage]:
        held = self._held
        if byte == END_SYSEX and held[:1] == bytes([START_SYSEX]):
            yield from self._sysex(bytes(held[1:]))
        elif byte & 0x80:
            self._drop()
            held.append(byte)
            return
        elif held and len(held) < LONGEST:
            held.append(byte)
            yield from self._short()
            return
        else:
            held.append(byte)
            self._drop()
            return
        held.clear()

    def _drop(self) -> None:
        self._counters.discarded_bytes += len(self._held)
        self._held.clear()

    def _sysex(self, content: bytes) -> Iterator[FirmataMessage]:
        if content:
            self._counters.frames += 1
            yield Sysex(content[0], content[1:])
        else:
            self._counters.discarded_bytes += 2

    def _short(self) -> Iterator[FirmataMessage]:
        """The message held, where it is a short one and complete."""
        head, *data = self._held
        if head == START_SYSEX:
            return
        kind = head if head >= START_SYSEX else head & 0xF0
        needed = 2 if kind == VERSION else DATA_BYTES.get(kind)
        if needed is None:
            self._drop()
        elif len(data) == needed:
            self._held.clear()
            self._counters.frames += 1
            yield from _meaning(kind, head & 0x0F, data)


def _meaning(kind: int, channel: int, data: list[int]) -> Iterator[FirmataMessage]:
    if kind == ANALOG:
        yield PinReading(channel, data[0] | data[1] << 7)
    elif kind == VERSION:
        yield Protocol(data[0], data[1])
