"""Robotiq FT 300 protocol, bytes only: Modbus RTU at 19200 8N1, slave 9, and a stream that takes the whole line.

Register numbers are wire addresses. A stream frame is 16 bytes: ``20 4E``, Fx Fy Fz as int16 in 0.01 N, Mx My Mz as
int16 in 0.001 N m, all little-endian, and the CRC-16/MODBUS of the 14 bytes before it, low byte first. While streaming
the sensor answers nothing; a burst of ``FF`` stops it.

Sources: FT 300 manual p. 65, FT 300-S manual p. 8, 33, 34, FT 150/300 manual p. 44; the maker's `rq_sensor_com.cpp`.
"""

import struct
from collections.abc import Sequence
from typing import NamedTuple

from drivers.crc import crc16_modbus
from drivers.framing import FrameDecoder
from drivers.roles import LinkCounters

DEFAULT_BAUD = 19_200
BITS_PER_BYTE = 10
SLAVE_ID = 9

FORCES = 180
ACCELERATION = 190
OUTPUT_SELECT = 410
FIRMWARE = 500
SERIAL_NUMBER = 510
PRODUCTION_YEAR = 514
STREAM_OUTPUT = 0x0200

STREAM_HZ = 100
STREAM_START = b"\x20\x4e"
FRAME_BYTES = 16
FRAME_NS = FRAME_BYTES * BITS_PER_BYTE * 1_000_000_000 // DEFAULT_BAUD
STOP_BURST = b"\xff" * 50

# Ranges as the maker states them.
FORCE_RANGE_N = 300.0
MOMENT_RANGE_N_m = 30.0
COUNTS_PER_N = 100
COUNTS_PER_N_m = 1000
COUNT_MAX = 0x7FFF  # a count has a signed 16-bit register

READ, WRITE = 3, 16
EXCEPTION = 0x80

_STREAM = struct.Struct("<6h")
_SCALE = (COUNTS_PER_N,) * 3 + (COUNTS_PER_N_m,) * 3


class Wrench(NamedTuple):
    """Forces in N, moments in N m."""

    fx_N: float
    fy_N: float
    fz_N: float
    mx_N_m: float
    my_N_m: float
    mz_N_m: float

    @property
    def in_range(self) -> bool:
        """Whether all six are inside what the maker specifies."""
        return max(map(abs, self[:3])) <= FORCE_RANGE_N and max(map(abs, self[3:])) <= MOMENT_RANGE_N_m


def with_crc(message: bytes) -> bytes:
    """The message as it goes on the line."""
    return message + crc16_modbus(message).to_bytes(2, "little")


def is_intact(message: bytes) -> bool:
    """Whether the last two bytes are the checksum of those before."""
    return len(message) >= 4 and crc16_modbus(message) == 0


def encode_read(address: int, count: int) -> bytes:
    """Request for ``count`` holding registers from ``address`` on."""
    return with_crc(struct.pack(">BBHH", SLAVE_ID, READ, address, count))


def encode_write(address: int, values: Sequence[int]) -> bytes:
    """Request to write ``values`` into the registers from ``address`` on."""
    count = len(values)
    return with_crc(struct.pack(f">BBHHB{count}H", SLAVE_ID, WRITE, address, count, 2 * count, *values))


START_STREAM = encode_write(OUTPUT_SELECT, [STREAM_OUTPUT])
STREAM_STARTED = with_crc(START_STREAM[:6])


def refusal(text: bytes) -> int | None:
    """The exception code with which a write was refused somewhere in ``text``."""
    start = bytes([SLAVE_ID, WRITE | EXCEPTION])
    at = text.find(start)
    while at >= 0:
        message = text[at : at + 5]
        if len(message) == 5 and is_intact(message):
            return message[2]
        at = text.find(start, at + 1)
    return None


def decode_forces(registers: Sequence[int]) -> Wrench:
    """Six registers from ``FORCES`` on: two's complement counts."""
    return _scaled([register - 0x10000 if register > COUNT_MAX else register for register in registers])


def decode_firmware(registers: Sequence[int]) -> str:
    """Three registers from ``FIRMWARE`` on, as ``FTS-1.2.3``; the first letter is F on a force sensor."""
    c0, c1, c2, major, minor, patch = struct.pack(">3H", *registers)
    return f"{c0:c}{c1:c}{c2:c}-{major}.{minor}.{patch}"


def decode_serial_number(registers: Sequence[int]) -> str:
    """Four registers from ``SERIAL_NUMBER`` on: three letters, then a number with its low word first."""
    c0, c1, c2, _ = struct.pack(">2H", *registers[:2])
    return f"{c0:c}{c1:c}{c2:c}-{registers[3] << 16 | registers[2]:04d}"


def to_counts(wrench: Sequence[float]) -> list[int]:
    """Six int16 counts as the converter gives them, held at its ends."""
    return [
        max(-COUNT_MAX - 1, min(COUNT_MAX, round(value * scale))) for value, scale in zip(wrench, _SCALE, strict=True)
    ]


def encode_frame(counts: Sequence[int]) -> bytes:
    """The 16 bytes of a stream frame."""
    return with_crc(STREAM_START + _STREAM.pack(*counts))


def make_decoder(counters: LinkCounters) -> FrameDecoder[Wrench]:
    """A new decoder of this product's stream frames."""
    return FrameDecoder(STREAM_START, FRAME_BYTES, is_intact, _decode_frame, counters)


def _decode_frame(raw: bytes) -> Wrench:
    return _scaled(_STREAM.unpack_from(raw, len(STREAM_START)))


def _scaled(counts: Sequence[int]) -> Wrench:
    return Wrench._make(count / scale for count, scale in zip(counts, _SCALE, strict=True))
