"""Modbus RTU as a load-cell transmitter of the LAUMAS TLB and TLU family answers it: bytes only.

Registers, of the TLU manual page 30: 40001 firmware, 40002 type, 40003 year, 40004 serial number, 40005 program, 40007
status, 40008 gross and 40010 net weight, 32 bits, high word first. On the wire 40001 is address 0.
"""

import struct
from typing import NamedTuple

from drivers.crc import crc16_modbus
from drivers.roles import LinkCounters

READ, EXCEPTION = 3, 0x80
ABOUT, STATUS = 0, 6
ABOUT_COUNT, WEIGHTS_COUNT = 5, 5
EXCEPTIONS = {1: "function not supported", 2: "no such register", 3: "value out of range"}
# Slave, function, count of bytes, and the checksum: what surrounds the registers of an answer.
AROUND = 5
MOST_REGISTERS = 32  # of one answer of this family
LONGEST = AROUND + 2 * MOST_REGISTERS
_WEIGHTS = struct.Struct(">Hii")


class ScaleWeights(NamedTuple):
    """The status word, and the weights in counts of the smallest digit."""

    status: int
    gross: int
    net: int


class RegisterAnswer(NamedTuple):
    """Registers read, or the code of the exception in their place."""

    registers: tuple[int, ...]
    exception: int = 0


def encode_read(slave: int, address: int, count: int) -> bytes:
    """Asks for ``count`` holding registers."""
    request = struct.pack(">BBHH", slave, READ, address, count)
    return request + crc16_modbus(request).to_bytes(2, "little")


def decode_weights(registers: tuple[int, ...]) -> ScaleWeights:
    """Status, gross and net weight of the five registers from 40007 on."""
    return ScaleWeights(*_WEIGHTS.unpack(struct.pack(f">{WEIGHTS_COUNT}H", *registers)))


class AnswerDecoder:
    """Answers of ``slave`` in whatever comes; holds less than one of them between calls, and never raises."""

    def __init__(self, slave: int, counters: LinkCounters) -> None:
        self._slave, self._counters = slave, counters
        self._rest = b""

    @property
    def held(self) -> int:
        """Bytes kept for the next call."""
        return len(self._rest)

    def reset(self) -> None:
        """What has come is no answer to what is asked next."""
        self._counters.discarded_bytes += len(self._rest)
        self._rest = b""

    def feed(self, data: bytes) -> list[RegisterAnswer]:
        """Answers completed by ``data``, oldest first."""
        self._rest += data
        answers = []
        while size := self._size():
            text = self._rest[:size]
            if crc16_modbus(text) == 0:
                answers.append(_decoded(text))
                self._rest = self._rest[size:]
                self._counters.frames += 1
            else:
                self._counters.checksum_errors += 1
                self._drop(1)
        return answers

    def _size(self) -> int:
        """Length of the answer at the beginning, 0 while it is not all there; what is none is dropped."""
        while self._rest:
            size = self._claimed()
            if size:
                return size if size <= len(self._rest) else 0
            self._drop(1)
        return 0

    def _claimed(self) -> int:
        """What the first bytes say about the length; 0 where no answer begins so."""
        head = self._rest[:3]
        if head[0] != self._slave or (len(head) > 1 and head[1] not in (READ, READ | EXCEPTION)):
            return 0
        if len(head) > 1 and head[1] == READ | EXCEPTION:
            return AROUND
        if len(head) < 3:
            return AROUND
        return AROUND + head[2] if head[2] <= 2 * MOST_REGISTERS and not head[2] % 2 and head[2] else 0

    def _drop(self, count: int) -> None:
        self._counters.discarded_bytes += count
        self._rest = self._rest[count:]


def _decoded(text: bytes) -> RegisterAnswer:
    if text[1] & EXCEPTION:
        return RegisterAnswer((), text[2])
    return RegisterAnswer(struct.unpack(f">{text[2] // 2}H", text[3:-2]))
