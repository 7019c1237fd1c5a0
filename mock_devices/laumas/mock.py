"""A load-cell transmitter on its wire: a Modbus RTU slave with the registers of the LAUMAS TLU manual, page 30.

What of the status register is an error is not in what was read of the manual: here it is bit 0, as `ERROR_BIT` says.
Commands (40006) and set-points are not served: a write is exception 1, a register outside the table exception 2.
"""

import struct

from drivers.crc import crc16_modbus
from drivers.laumas.codec import EXCEPTION, MOST_REGISTERS, READ
from mock_devices.interfaces import NEVER_NS, SensorPlant
from mock_devices.robotiq.mock import ILLEGAL_ADDRESS, ILLEGAL_FUNCTION, ILLEGAL_VALUE, RequestFinder
from mock_devices.wire import OnWire, Wire

ERROR_BIT = 0x0001
FIRMWARE, KIND, YEAR, PROGRAM = 105, 4, 2021, 0
COUNTS_PER_N = 10_000
CONVERSIONS = 8  # behind one weight: its converter is faster than it is asked
WEIGHT_MAX = 999_999  # six digits
DIVISION = 0


class LaumasMock(OnWire):
    """Slave 1 on ``plant``, of which it shows Fz; answers at once.

    Faults, to be set at any time: ``silent`` answers nothing; ``frozen`` repeats its weight; ``invalid`` sets the error
    bit; ``corrupt_every`` spoils the checksum of every n-th answer; ``refusing`` answers with exception 2.
    """

    name = "force"

    def __init__(self, wire: Wire, plant: SensorPlant, serial_number: int = 4711, latency_ms: float = 0.0) -> None:
        super().__init__(wire)
        self.serial_number = str(serial_number)
        self.latency_ms = latency_ms
        self.slave = 1
        self.silent = self.frozen = self.invalid = self.refusing = False
        self.corrupt_every = 0
        self.tare = 0
        self._plant, self._number = plant, serial_number
        self._requests = RequestFinder()
        self._answers = self._gross = 0

    @property
    def due_ns(self) -> int:
        """It does nothing by itself."""
        return NEVER_NS

    def tick(self, now_ns: int) -> None:
        """Nothing is due."""

    def receive(self, now_ns: int) -> None:  # noqa: ARG002 - an answer depends on what is weighed now
        """Answers requests to its address."""
        for request in self._requests.feed(self._wire.read()):
            if request[0] == self.slave and not self.silent:
                self._send(self._answer(request))

    def _answer(self, request: bytes) -> bytes:
        function = request[1]
        if function != READ:
            return bytes([function | EXCEPTION, ILLEGAL_FUNCTION])
        address, count = struct.unpack(">HH", request[2:6])
        registers = self._registers()
        if not 1 <= count <= MOST_REGISTERS:
            return bytes([READ | EXCEPTION, ILLEGAL_VALUE])
        if address + count > len(registers) or self.refusing:
            return bytes([READ | EXCEPTION, ILLEGAL_ADDRESS])
        return struct.pack(f">BB{count}H", READ, 2 * count, *registers[address : address + count])

    def _registers(self) -> list[int]:
        """40001 to 40016."""
        if not self.frozen:
            mean_N = sum(self._plant.wrench()[2] for _ in range(CONVERSIONS)) / CONVERSIONS
            self._gross = round(mean_N * COUNTS_PER_N)
        status = ERROR_BIT if self.invalid or self._plant.overrange() or abs(self._gross) > WEIGHT_MAX else 0
        weights = [_words(value) for value in (self._gross, self._gross - self.tare, 0)]
        about = [FIRMWARE, KIND, YEAR, self._number & 0xFFFF, PROGRAM, 0, status]
        return [*about, *(word for words in weights for word in words), DIVISION, 0, 0]

    def _send(self, answer: bytes) -> None:
        self._answers += 1
        text = bytes([self.slave]) + answer
        raw = text + crc16_modbus(text).to_bytes(2, "little")
        if self.corrupt_every and self._answers % self.corrupt_every == 0:
            raw = raw[:-1] + bytes([raw[-1] ^ 0xFF])
        self._wire.write(raw)


def _words(value: int) -> tuple[int, int]:
    """High word first."""
    high, low = struct.unpack(">HH", struct.pack(">i", value))
    return high, low
