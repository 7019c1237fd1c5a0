"""Bota SensONE serial protocol, bytes only.

Commands are ASCII without a terminator, acknowledged by ``r,0,<command>,<code>`` with code 0 for success; after a reset
the sensor prints who it is. In run mode it sends frames of 37 little-endian bytes: ``AA``, status u16, Fx Fy Fz [N]
Mx My Mz [N m] f32, time u32 [us], temperature f32 [degC], and the CRC-16/X-25 of the 34 bytes between header and CRC.

Source: the maker's `bota_serial_example.py` and its ROS 2 driver (`RokubiminiSerialImpl.cpp` and command header).
"""

import re
import struct
from enum import IntFlag
from typing import NamedTuple

from drivers.crc import crc16_x25
from drivers.framing import FrameDecoder
from drivers.roles import LinkCounters
from rig.errors import UsageError

DEFAULT_BAUD = 460_800
BAUD_CODES = {9_600: 0, 57_600: 1, 115_200: 2, 230_400: 3, 460_800: 4}
BITS_PER_BYTE = 10
COMMAND_BYTES_MAX = 64  # what the maker's own driver allows a command

HEADER = b"\xaa"
FRAME_BYTES = 37
CONVERTER_HZ = 51_200
SINC_LENGTHS = (51, 64, 128, 205, 256, 512)
RATE_TOLERANCE = 0.01  # the 1004 Hz of 51 samples are sold as 1000; the next rate is 20 % away

CONFIG_MODE = b"C"
RUN_MODE = b"R"
SOFT_RESET = b"I"
HARD_RESET = b"#"

_PAYLOAD = struct.Struct("<H6fIf")
_CRC = struct.Struct("<H")
_ACK = re.compile(rb"r,\d,(\w),(\d)")
_NAME = re.compile(rb"name:\s([^\r\n]*)\r")
_SERIAL = re.compile(rb"S/N:\s([^\r\n]*)\r")
_FIRMWARE = re.compile(rb"FW version:\s([^\r\n]*)\r")


class StatusBits(IntFlag):
    """Bits of the status word; 4-15 are reserved."""

    SKIPPED_SAMPLES = 1
    OVERRANGE = 2
    INVALID = 4
    RAW = 8


class ForceFrame(NamedTuple):
    """One reading, in the order of the wire."""

    status: int
    fx_N: float
    fy_N: float
    fz_N: float
    mx_N_m: float
    my_N_m: float
    mz_N_m: float
    time_us: int
    temperature_C: float


class Ack(NamedTuple):
    """The answer to a command: ``code`` 0 is success; ``end`` is the offset behind it in the text searched."""

    code: int
    end: int


class BootText(NamedTuple):
    """What the sensor says of itself after a reset."""

    name: str
    serial: str
    firmware: str


def encode_communication(temperature_compensation: bool, calibrated: bool, baud: int) -> bytes:
    """Sets binary frames at ``baud``; ``calibrated`` gives newtons instead of raw converter counts."""
    return f"c,{temperature_compensation:d},{calibrated:d},0,{BAUD_CODES[baud]}".encode()


def encode_filter(sinc: int, chop: bool = False, fast: bool = False, fir_disabled: bool = True) -> bytes:
    """Sets the converter's sinc filter and with it the rate, see ``rate_Hz``."""
    return f"f,{sinc},{chop:d},{fast:d},{fir_disabled:d}".encode()


def rate_Hz(sinc: int) -> float:
    """Frames a second at this filter length."""
    return CONVERTER_HZ / sinc


def sinc_for(wanted_Hz: float) -> int:
    """The filter length whose rate is nearest; raises UsageError where that is more than 1 % away."""
    sinc = min(SINC_LENGTHS, key=lambda length: abs(rate_Hz(length) - wanted_Hz))
    if abs(rate_Hz(sinc) - wanted_Hz) > RATE_TOLERANCE * wanted_Hz:
        possible = ", ".join(f"{rate_Hz(length):.0f}" for length in SINC_LENGTHS)
        raise UsageError(
            f"force.rate_Hz {wanted_Hz:g}: a bota-sensone gives {possible} Hz; write one of these (within 1 %)"
        )
    return sinc


def line_rate_Hz(baud: int) -> float:
    """The most frames a second a serial line carries, 8N1."""
    return baud / BITS_PER_BYTE / FRAME_BYTES


def encode_frame(frame: ForceFrame) -> bytes:
    """The 37 bytes of a frame."""
    payload = _PAYLOAD.pack(*frame)
    return HEADER + payload + _CRC.pack(crc16_x25(payload))


def make_decoder(counters: LinkCounters) -> FrameDecoder[ForceFrame]:
    """A new decoder of this product's frames."""
    return FrameDecoder(HEADER, FRAME_BYTES, _is_good, _decode_frame, counters)


def _decode_frame(raw: bytes) -> ForceFrame:
    return ForceFrame._make(_PAYLOAD.unpack_from(raw, 1))


def _is_good(raw: bytes) -> bool:
    return crc16_x25(raw[1:35]) == raw[35] | raw[36] << 8


def find_ack(text: bytes, command: bytes) -> Ack | None:
    """The first answer in ``text``, which may hold frames too, to the command that begins like ``command``."""
    for match in _ACK.finditer(text):
        if match[1] == command[:1]:
            return Ack(int(match[2]), match.end())
    return None


def find_boot_text(text: bytes) -> BootText | None:
    """Name, serial number and firmware from the text after a reset; None until all three have come."""
    matches = [pattern.search(text) for pattern in (_NAME, _SERIAL, _FIRMWARE)]
    found = [match[1].decode("ascii", "replace").strip() for match in matches if match]
    return BootText(*found) if len(found) == len(matches) else None
