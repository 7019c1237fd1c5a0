"""Zaber's ASCII protocol, bytes only: commands, and the replies, notes and alerts that come back.

Layouts: zaber.com, ASCII protocol manual, message format. A command is `/1 1 07 move abs 50000:B5`, its reply
`@01 1 07 OK BUSY WR 0:9B`; between them the checksum is the sum of all characters behind the first, negated.
"""

import re
from typing import Literal, NamedTuple

from drivers.roles import LinkCounters

NUMBERS = 100  # a command's number has two digits
# The manual's longest line is 80 characters, which some devices exceed in what they list.
LONGEST = 512
SPEED_PER_STEP = 1.6384  # units of speed in a microstep a second: devices count in 1/10,000 s of 16,384 fractions
ACCELERATION_PER_STEP = SPEED_PER_STEP / 10_000
# What is said is printable ASCII; anything else is a damaged line, whatever its checksum.
_DATA = rb"([ -9;-~]*)"
_REPLY = re.compile(rb"([@!])(\d\d) (\d)(?: (\d\d))?(?: (OK|RJ))? (BUSY|IDLE) (--|[A-Z]{2})(?: " + _DATA + rb")?")
_NOTE = re.compile(rb"#(\d\d) (\d)(?: (\d\d))? " + _DATA)


class ZaberReply(NamedTuple):
    """What a device said; ``number`` is that of the command, None where it has none."""

    kind: Literal["@", "!", "#"]
    device: int
    axis: int
    number: int | None
    accepted: bool
    busy: bool
    flag: str
    data: str


def checksum(text: bytes) -> bytes:
    """Two upper-case digits over ``text`` without its first character."""
    return b"%02X" % (-sum(text[1:]) & 0xFF)


def encode_command(device: int, axis: int, number: int, command: str) -> bytes:
    """One command; an empty one asks for the state alone."""
    text = f"/{device} {axis} {number:02d} {command}".rstrip().encode()
    return text + b":" + checksum(text) + b"\n"


def encode_reply(reply: ZaberReply, with_checksum: bool = True) -> bytes:
    """One line of a device."""
    number = "" if reply.number is None else f" {reply.number:02d}"
    head = f"{reply.kind}{reply.device:02d} {reply.axis}{number}"
    state = f" {'BUSY' if reply.busy else 'IDLE'} {reply.flag}"
    verdict = {"@": f" {'OK' if reply.accepted else 'RJ'}{state}", "!": state, "#": ""}[reply.kind]
    text = f"{head}{verdict}{' ' + reply.data if reply.data else ''}".encode()
    return text + (b":" + checksum(text) if with_checksum else b"") + b"\r\n"


class LineDecoder:
    """Holds less than one line of 512 characters between calls, whatever comes, and never raises.

    While ``demanding``, a line without checksum is as bad as one whose checksum is wrong.
    """

    def __init__(self, counters: LinkCounters) -> None:
        self.demanding = False
        self._counters = counters
        self._rest = b""

    @property
    def held(self) -> int:
        """Bytes kept for the next call."""
        return len(self._rest)

    def feed(self, data: bytes) -> list[ZaberReply]:
        """Good lines completed by ``data``, oldest first."""
        *lines, rest = (self._rest + data).replace(b"\r", b"\n").split(b"\n")
        if len(rest) > LONGEST:
            self._counters.discarded_bytes += len(rest)
            rest = b""
        self._rest = rest
        return [reply for line in lines if line and (reply := self._decoded(line)) is not None]

    def _decoded(self, line: bytes) -> ZaberReply | None:
        text, mark, digits = line.partition(b":")
        bad_sum = digits != checksum(text) if mark else self.demanding
        reply = None if bad_sum else _parsed(text)
        if reply is None:
            self._counters.checksum_errors += bad_sum
            self._counters.discarded_bytes += len(line)
        else:
            self._counters.frames += 1
        return reply


def _parsed(text: bytes) -> ZaberReply | None:
    note = _NOTE.fullmatch(text)
    if note:
        device, axis, number, data = (part.decode() if part else "" for part in note.groups())
        return ZaberReply("#", int(device), int(axis), int(number) if number else None, True, False, "--", data)
    match = _REPLY.fullmatch(text)
    if not match:
        return None
    kind, device, axis, number, verdict, state, flag, data = (part.decode() if part else "" for part in match.groups())
    if (kind == "@") is not bool(verdict):
        return None
    known: Literal["@", "!"] = "@" if kind == "@" else "!"
    count = int(number) if number else None
    return ZaberReply(known, int(device), int(axis), count, verdict != "RJ", state == "BUSY", flag, data)


class Scale(NamedTuple):
    """Millimetres to microsteps; ``direction`` is -1 where microsteps shrink into the tissue."""

    per_mm: float
    direction: int

    def steps(self, position_mm: float) -> int:
        """Microsteps from home."""
        return round(self.direction * position_mm * self.per_mm)

    def mm(self, steps: float) -> float:
        """Position [mm]."""
        return self.direction * steps / self.per_mm

    def speed(self, speed_mm_s: float) -> int:
        """The device's number for a speed, never 0: that would mean its own greatest."""
        return max(1, round(speed_mm_s * self.per_mm * SPEED_PER_STEP))

    def acceleration(self, acceleration_mm_s2: float) -> int:
        """The device's number for an acceleration, never 0: that would mean none of the limits there are."""
        return max(1, round(acceleration_mm_s2 * self.per_mm * ACCELERATION_PER_STEP))
