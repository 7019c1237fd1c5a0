"""A Robotiq FT 300 on its wire: a Modbus RTU slave that turns into a stream, and back.

A server library would not do: a real slave is silent for other ids and bad checksums, and deaf while it streams. Where
the manuals leave it open, registers outside the published map answer exception 2 and only the stream output can be
selected.
"""

import re
import struct
from collections import deque
from collections.abc import Iterator

from drivers.crc import modbus_starts
from drivers.robotiq.codec import (
    ACCELERATION,
    COUNT_MAX,
    EXCEPTION,
    FIRMWARE,
    FORCES,
    FRAME_NS,
    OUTPUT_SELECT,
    PRODUCTION_YEAR,
    READ,
    SERIAL_NUMBER,
    SLAVE_ID,
    STOP_BURST,
    STREAM_HZ,
    STREAM_OUTPUT,
    WRITE,
    encode_frame,
    is_intact,
    to_counts,
    with_crc,
)
from mock_devices.interfaces import NEVER_NS, SAMPLES_KEPT, SensorPlant
from mock_devices.wire import OnWire, Wire

ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE = 1, 2, 3
READ_COUNT_MAX = 125  # registers in one answer (Modbus application protocol 1.1b3, 6.3)
REQUEST_BYTES_MAX = 256  # a frame on a serial line (Modbus over serial line 1.02, 2.3)
FIXED_SIZE_FUNCTIONS = range(1, 7)
COUNTED_FUNCTIONS = (15, 16)
KNOWN = re.compile(rb"(?s).(?=[\x01-\x06\x0f\x10].{2})")  # any slave, one of these functions, room for a checksum

FIRMWARE_NAME = "FTS"
FIRMWARE_VERSION = (2, 0, 4)
SERIAL_PREFIX = "FTS"
YEAR = 2019
AT_REST_MILLI_G = (0, 0, 1000)


class RequestFinder:
    """Finds intact Modbus RTU requests, to whatever slave, in a stream of bytes; holds at most 256 of them."""

    def __init__(self) -> None:
        self._buffer = b""

    @property
    def held(self) -> int:
        """Bytes kept for the next call."""
        return len(self._buffer)

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Requests completed by ``data``; damaged ones and noise are passed over."""
        self._buffer += data
        while True:
            found = next(self._intact(), None)
            if found is None:
                break
            at, size = found
            request, self._buffer = self._buffer[at : at + size], self._buffer[at + size :]
            yield request
        self._buffer = self._buffer[-REQUEST_BYTES_MAX:]

    def _intact(self) -> Iterator[tuple[int, int]]:
        # Most of noise is of unknown functions: a checksum for each byte of it would keep the other mocks waiting.
        buffer, whole = self._buffer, frozenset(modbus_starts(self._buffer))
        for at in sorted(whole.union(known.start() for known in KNOWN.finditer(buffer))):
            end = at + _request_bytes(buffer, at)
            if at in whole if end == len(buffer) else end < len(buffer) and is_intact(buffer[at:end]):
                yield at, end - at


def _request_bytes(buffer: bytes, at: int) -> int:
    """Length of the request that begins at ``at``, if one does; unknown functions run to the end."""
    left, function = len(buffer) - at, buffer[at + 1]
    if function in FIXED_SIZE_FUNCTIONS:
        return 8
    return 9 + buffer[at + 6] if left > 6 and function in COUNTED_FUNCTIONS else left


class RobotiqMock(OnWire):
    """Powered at ``start_ns``; its 100 Hz run ``drift_ppm`` fast against the bench's clock.

    A frame is sent when it would have passed a 19200 baud line: 8.3 ms after its sample was taken.

    Failures of the device, plain attributes to be set at any time: ``silent`` sends nothing; ``frozen`` repeats the
    last forces; ``invalid`` gives the converter's end on all channels; ``wrong_identity`` has firmware letters that are
    no force sensor's; ``corrupt_every`` n spoils the checksum of every n-th frame; ``mute_start`` starts the stream
    without answering; ``deaf`` streams on whatever comes; ``refuse_stream`` answers the start with exception 3.
    """

    name = "force"

    def __init__(
        self, wire: Wire, plant: SensorPlant, start_ns: int, drift_ppm: float = 0.0, serial_number: int = 1234
    ) -> None:
        super().__init__(wire)
        self.silent = self.frozen = self.invalid = self.wrong_identity = False
        self.corrupt_every = 0
        self.mute_start = self.deaf = self.refuse_stream = False
        self.sampled: deque[tuple[int, int]] = deque(maxlen=SAMPLES_KEPT)
        self._plant = plant
        self._number = serial_number
        self.serial_number = f"{SERIAL_PREFIX}-{serial_number:04d}"
        self._period_ns = 1e9 / STREAM_HZ / (1 + drift_ppm * 1e-6)
        self._requests = RequestFinder()
        self._stream_ns = start_ns
        self._due_ns = NEVER_NS
        self._frames = 0
        self._on_line = b""
        self._stop_bytes = 0
        self._counts = [0] * 6

    @property
    def due_ns(self) -> int:
        """When the next sample is taken or the frame of the last one has passed the line."""
        return self._due_ns

    @property
    def streaming(self) -> bool:
        """Whether the stream has the line."""
        return self._due_ns != NEVER_NS

    def tick(self, now_ns: int) -> None:
        """Takes a sample, or delivers the frame of the last one."""
        if now_ns < self._due_ns:
            return
        if self._on_line:
            self._send(self._on_line)
            self._on_line = b""
            self._due_ns = self._sample_ns(self._frames)
        else:
            self._on_line = self._frame()
            self._frames += 1
            self._due_ns += FRAME_NS

    def receive(self, now_ns: int) -> None:
        """Listens for a stop burst while streaming, for requests otherwise."""
        data = self._wire.read()
        if self.streaming:
            data = self._after_stop(data)
        for request in self._requests.feed(data):
            if request[0] == SLAVE_ID and not self.streaming:
                self._execute(request, now_ns)

    def _after_stop(self, data: bytes) -> bytes:
        """Stops the stream at the last byte of a full burst; returns what came behind it."""
        for index, byte in enumerate(data):
            self._stop_bytes = self._stop_bytes + 1 if byte == STOP_BURST[0] else 0
            if self._stop_bytes >= len(STOP_BURST) and not self.deaf:
                self._due_ns, self._on_line, self._stop_bytes = NEVER_NS, b"", 0
                return data[index + 1 :]
        return b""

    def _execute(self, request: bytes, now_ns: int) -> None:
        function = request[1]
        if function == READ:
            answer = self._read(*struct.unpack(">HH", request[2:6]))
        elif function == WRITE:
            answer = self._write(request, now_ns)
        else:
            answer = ILLEGAL_FUNCTION
        if isinstance(answer, int):
            answer = bytes([function | EXCEPTION, answer])
        if not (self.mute_start and self.streaming):
            self._send(with_crc(bytes([SLAVE_ID]) + answer))

    def _read(self, address: int, count: int) -> bytes | int:
        if not 1 <= count <= READ_COUNT_MAX:
            return ILLEGAL_VALUE
        registers = self._registers()
        values = [registers.get(number) for number in range(address, address + count)]
        known = [value & 0xFFFF for value in values if value is not None]
        if len(known) < count:
            return ILLEGAL_ADDRESS
        return struct.pack(f">BB{count}H", READ, 2 * count, *known)

    def _write(self, request: bytes, now_ns: int) -> bytes | int:
        address, count, size = struct.unpack(">HHB", request[2:7])
        if size != 2 * count:
            return ILLEGAL_VALUE
        if (address, count) != (OUTPUT_SELECT, 1):
            return ILLEGAL_ADDRESS
        if self.refuse_stream or int.from_bytes(request[7:9], "big") != STREAM_OUTPUT:
            return ILLEGAL_VALUE
        self._stream_ns, self._frames, self._stop_bytes = now_ns, 0, 0
        self._due_ns = self._sample_ns(0)
        return request[1:6]

    def _sample_ns(self, number: int) -> int:
        return self._stream_ns + round((number + 1) * self._period_ns)

    def _registers(self) -> dict[int, int]:
        """What can be read, by wire address."""
        firmware = b"KMS" if self.wrong_identity else FIRMWARE_NAME.encode()
        prefix = SERIAL_PREFIX.encode() + b"\0"
        groups = {
            FORCES: self._converted(),
            ACCELERATION: AT_REST_MILLI_G,
            OUTPUT_SELECT: (STREAM_OUTPUT if self.streaming else 0,),
            FIRMWARE: struct.unpack(">3H", firmware + bytes(FIRMWARE_VERSION)),
            SERIAL_NUMBER: (*struct.unpack(">2H", prefix), self._number & 0xFFFF, self._number >> 16),
            PRODUCTION_YEAR: (YEAR,),
        }
        return {first + index: value for first, values in groups.items() for index, value in enumerate(values)}

    def _converted(self) -> list[int]:
        if self.invalid:
            return [COUNT_MAX] * 6
        if not self.frozen:
            self._counts = to_counts(self._plant.wrench())
        return self._counts

    def _frame(self) -> bytes:
        raw = encode_frame(self._converted())
        self.sampled.append((int.from_bytes(raw[2:14], "little"), self._due_ns))
        if self.corrupt_every and (self._frames + 1) % self.corrupt_every == 0:
            raw = raw[:-1] + bytes([raw[-1] ^ 0xFF])
        return raw

    def _send(self, data: bytes) -> None:
        if not self.silent:
            self._wire.write(data)
