"""A microcontroller with StandardFirmata on its wire: an Uno with six analogue inputs, of which a glove has some.

What it leaves out stands in the documents: it does not reset when the port is opened, and digital pins do nothing.
"""

from collections.abc import Iterator

from drivers.firmata.codec import (
    CAPABILITY,
    CAPABILITY_QUERY,
    END_SYSEX,
    FIRMWARE,
    MAPPING,
    MAPPING_QUERY,
    NO_ANALOG,
    REPORT_ANALOG,
    SAMPLING_INTERVAL,
    START_SYSEX,
    VERSION,
    reading,
    seven_bits,
    sysex,
)
from mock_devices.firmata.glove import GlovePlant
from mock_devices.interfaces import NEVER_NS
from mock_devices.wire import OnWire, Wire

NAME, PROTOCOL, FIRMWARE_VERSION = "StandardFirmata.ino", (2, 5), (2, 5)
# An Uno: two pins of the serial line, twelve digital ones, six analogue ones; modes and bits of each.
SERIAL_PINS, DIGITAL_PINS, ANALOG_PINS = 2, 12, 6
DIGITAL_MODES = bytes([0, 1, 11, 1, 1, 1, 4, 14])
ANALOG_MODES = bytes([0, 1, 11, 1, 1, 1, 2, 10])
INTERVAL_MS, LEAST_INTERVAL_MS = 19, 10
LONGEST = 64  # StandardFirmata's own buffer of a message


class BoardRequests:
    """Finds what a client asks for: a head and its data; holds one message."""

    def __init__(self) -> None:
        self._held = bytearray()

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Requests completed by ``data``."""
        for byte in data:
            if byte & 0x80 and byte != END_SYSEX:
                self._held.clear()
            self._held.append(byte)
            if self._complete():
                yield bytes(self._held)
                self._held.clear()
            elif len(self._held) > LONGEST:
                self._held.clear()

    def _complete(self) -> bool:
        head = self._held[0]
        if head == START_SYSEX:
            return self._held[-1] == END_SYSEX
        return len(self._held) == (2 if head & 0xF0 in (REPORT_ANALOG, 0xD0) else 3 if head < START_SYSEX else 1)


class FirmataMock(OnWire):
    """Runs from ``start_ns`` on. ``silent`` sends nothing; ``stuck`` repeats the readings it had."""

    name = "glove"

    def __init__(self, wire: Wire, plant: GlovePlant, start_ns: int) -> None:
        super().__init__(wire)
        self.silent = self.stuck = False
        self.plant = plant
        self._start_ns = self.now_ns = start_ns
        self._requests = BoardRequests()
        self._interval_ns = INTERVAL_MS * 1_000_000
        self._reported: set[int] = set()
        self._due_ns = NEVER_NS
        self._last: dict[int, int] = {}

    @property
    def due_ns(self) -> int:
        """When the inputs are next read."""
        return self._due_ns

    @property
    def time_s(self) -> float:
        """Since it was powered, by the last turn."""
        return (self.now_ns - self._start_ns) * 1e-9

    def tick(self, now_ns: int) -> None:
        """Reads its reported inputs, the lowest first, and sends them."""
        self.now_ns = now_ns
        if now_ns < self._due_ns:
            return
        self._due_ns += self._interval_ns
        if not self.stuck:
            self._last = {channel: self.plant.counts(channel, self.time_s) for channel in sorted(self._reported)}
        self._send(b"".join(reading(channel, counts) for channel, counts in self._last.items()))

    def receive(self, now_ns: int) -> None:
        """Does what is asked."""
        self.now_ns = now_ns
        for request in self._requests.feed(self._wire.read()):
            self._execute(request, now_ns)

    def _execute(self, request: bytes, now_ns: int) -> None:
        head = request[0]
        if head == START_SYSEX and len(request) > 2:
            self._answer(request[1], request[2:-1])
        elif head == VERSION:
            self._send(bytes([VERSION, *PROTOCOL]))
        elif head & 0xF0 == REPORT_ANALOG and head & 0x0F < ANALOG_PINS:
            (self._reported.add if request[1] else self._reported.discard)(head & 0x0F)
            self._due_ns = (now_ns + self._interval_ns) if self._reported else NEVER_NS

    def _answer(self, command: int, data: bytes) -> None:
        if command == FIRMWARE:
            name = b"".join(seven_bits(byte) for byte in NAME.encode())
            self._send(sysex(FIRMWARE, bytes(FIRMWARE_VERSION) + name))
        elif command == MAPPING_QUERY:
            none = bytes([NO_ANALOG]) * (SERIAL_PINS + DIGITAL_PINS)
            self._send(sysex(MAPPING, none + bytes(range(ANALOG_PINS))))
        elif command == CAPABILITY_QUERY:
            ends = bytes([NO_ANALOG])
            pins = [b""] * SERIAL_PINS + [DIGITAL_MODES] * DIGITAL_PINS + [ANALOG_MODES] * ANALOG_PINS
            self._send(sysex(CAPABILITY, b"".join(modes + ends for modes in pins)))
        elif command == SAMPLING_INTERVAL and len(data) == 2:
            self._interval_ns = max(data[0] | data[1] << 7, LEAST_INTERVAL_MS) * 1_000_000

    def _send(self, data: bytes) -> None:
        if not self.silent and data:
            self._wire.write(data)
