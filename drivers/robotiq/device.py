"""A Robotiq FT 300 in the role of force sensor.

The line has one owner at a time: our port stops a stream that may still run, then pymodbus reads who the sensor is,
then our port again starts the stream and keeps the line. The stream carries no counter and no status: capture time
follows from arrival and the time a frame takes on the line, and lost frames cannot be counted.
"""

import logging
import time
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from typing import ClassVar

from pymodbus.client import ModbusSerialClient
from pymodbus.exceptions import ModbusException

from drivers.ports import Port, read_until
from drivers.robotiq.codec import (
    DEFAULT_BAUD,
    FIRMWARE,
    FORCES,
    FRAME_NS,
    PRODUCTION_YEAR,
    SERIAL_NUMBER,
    SLAVE_ID,
    START_STREAM,
    STOP_BURST,
    STREAM_HZ,
    STREAM_STARTED,
    Decoder,
    Wrench,
    decode_firmware,
    decode_forces,
    decode_serial_number,
    refusal,
)
from drivers.roles import Identity, LinkCounters
from rig.channels import ForceSample
from rig.config.wiring import Force
from rig.errors import DeviceError, UsageError

PRODUCT = "robotiq-ft300"
FIRMWARE_LETTER = "F"
PERIOD_NS = 1_000_000_000 // STREAM_HZ
# The maker's driver takes 80 ms without bytes for a stopped stream and gives the sensor another 100 ms.
SILENCE_S = 0.18
# A burst takes 26 ms on the line; the rest leaves room for what was under way before it, and for the silence.
BURST_S = 0.4
STOP_S = 3.0
# Request and longest answer are 31 bytes, 16 ms; the maker's driver waits 400 ms.
ANSWER_S = 0.4
RETRIES = 2
# Twenty frames of the stream; the rest is for the host.
FIRST_FRAME_S = 1.0 + 20 / STREAM_HZ

# pymodbus logs each failed try; here a failure is one sentence in a DeviceError.
logging.getLogger("pymodbus").addHandler(logging.NullHandler())


class RobotiqFt300:
    """Owns the line from construction to ``close``; ``open_port`` opens it at a given baud.

    The rate is fixed: ``config.rate_Hz`` is taken as the most that is wanted, and ``period_ns`` tells what there is.
    Raises UsageError where less than 100 Hz or another baud is asked for, DeviceError where the port cannot be opened.
    """

    DEFAULT_BAUD: ClassVar = DEFAULT_BAUD

    def __init__(
        self, open_port: Callable[[int], Port], config: Force, now: Callable[[], int] = time.monotonic_ns
    ) -> None:
        _check(config)
        self.counters = LinkCounters()
        self._open_port = open_port
        self._now = now
        self._port = open_port(DEFAULT_BAUD)
        self._delay_ns = FRAME_NS + round(config.latency_ms * 1e6)
        self._decoder = Decoder(self.counters)
        self._identity = Identity(PRODUCT, "", "")
        self._last_capture_ns = 0
        self._seq = 0
        self._early: list[ForceSample] = []

    @property
    def identity(self) -> Identity:
        """Known after ``start``."""
        return self._identity

    @property
    def period_ns(self) -> int:
        """Nominal time between samples."""
        return PERIOD_NS

    def fileno(self) -> int:
        """Descriptor that turns readable when a sample may have come; ``start`` changes it."""
        return self._port.fileno()

    def start(self) -> None:
        """Stops a running stream, identifies the sensor by its registers and starts the stream."""
        self._stop_stream()
        self._port.close()
        self._identity = self._read_identity()
        self._port = self._open_port(DEFAULT_BAUD)
        self._start_stream()

    def poll(self, now_ns: int) -> Sequence[ForceSample]:
        """Samples since the last call."""
        samples, self._early = self._early, []
        data = self._port.read()
        if data:
            samples += self._samples(self._decoder.feed(data), now_ns)
        return samples

    def close(self) -> None:
        """Stops the stream and gives the port back."""
        with suppress(DeviceError):
            self._port.write(STOP_BURST)
        self._port.close()

    def _stop_stream(self) -> None:
        deadline_ns = self._now() + round(STOP_S * 1e9)
        while not self._falls_silent():
            if self._now() > deadline_ns:
                raise self._error(
                    f"still sends bytes after {STOP_S:g} s of stop bursts; check force.port and force.product, "
                    "then power the sensor off and on"
                )
            self._port.write(STOP_BURST)

    def _falls_silent(self) -> bool:
        """Whether the line is quiet for ``SILENCE_S`` within ``BURST_S``."""
        deadline_ns = self._now() + round(BURST_S * 1e9)
        while self._now() < deadline_ns:
            if not read_until(self._port, bool, SILENCE_S):
                return True
        return False

    def _read_identity(self) -> Identity:
        address = self._port.address.replace("tcp://", "socket://")
        with closing(ModbusSerialClient(address, baudrate=DEFAULT_BAUD, timeout=ANSWER_S, retries=RETRIES)) as client:
            if not client.connect():
                raise self._error("cannot be opened again for Modbus; check who else uses the port")
            firmware = decode_firmware(self._registers(client, FIRMWARE, 3))
            if not firmware.startswith(FIRMWARE_LETTER):
                raise self._error(
                    f"firmware {firmware!r} is not that of a force sensor ({FIRMWARE_LETTER}...); "
                    "check force.port and force.product"
                )
            return Identity(
                PRODUCT,
                decode_serial_number(self._registers(client, SERIAL_NUMBER, 4)),
                firmware,
                {
                    "rate": f"{STREAM_HZ} Hz",
                    "production year": str(self._registers(client, PRODUCTION_YEAR, 1)[0]),
                    "forces at start": _described(decode_forces(self._registers(client, FORCES, 6))),
                },
            )

    def _registers(self, client: ModbusSerialClient, address: int, count: int) -> Sequence[int]:
        asked = f"slave {SLAVE_ID}, registers {address} to {address + count - 1}"
        try:
            answer = client.read_holding_registers(address, count=count, device_id=SLAVE_ID)
        except ModbusException as error:
            raise self._error(
                f"no Modbus answer from {asked} in {RETRIES + 1} tries of {ANSWER_S:g} s; "
                "check power, cable, force.port and force.product"
            ) from error
        if answer.isError() or len(answer.registers) != count:
            raise self._error(f"{asked}: refused ({answer}); check force.port and force.product")
        return answer.registers

    def _start_stream(self) -> None:
        """The answer to the command may be lost in the stream it starts: frames are answer enough."""
        self._port.write(START_STREAM)
        text = read_until(self._port, _started_or_refused, FIRST_FRAME_S)
        code = refusal(text)
        if code is not None:
            raise self._error(f"refused to start its stream with Modbus exception {code}; check its firmware")
        self._early = self._samples(self._decoder.feed(text.replace(STREAM_STARTED, b"", 1)), self._now())
        if not self._early:
            raise self._error(
                f"no stream frame within {FIRST_FRAME_S:.1f} s of the start command, {len(text)} bytes came; "
                "check the cable"
            )

    def _samples(self, wrenches: Sequence[Wrench], now_ns: int) -> list[ForceSample]:
        """Frames that arrived together were sent one period apart."""
        return [self._sample(wrench, now_ns, len(wrenches) - 1 - index) for index, wrench in enumerate(wrenches)]

    def _sample(self, wrench: Wrench, now_ns: int, followers: int) -> ForceSample:
        capture_ns = max(now_ns - self._delay_ns - followers * PERIOD_NS, self._last_capture_ns)
        self._last_capture_ns = capture_ns
        self._seq += 1
        return ForceSample(self._seq - 1, capture_ns, now_ns, 0, *wrench, float("nan"), 0, int(wrench.in_range))

    def _error(self, what: str) -> DeviceError:
        return DeviceError(f"{PRODUCT} at {self._port.address}: {what}")


def _check(config: Force) -> None:
    if config.baud not in (0, DEFAULT_BAUD):
        raise UsageError(f"force.baud {config.baud}: a {PRODUCT} talks at {DEFAULT_BAUD} baud only; write 0")
    if config.rate_Hz < 0.99 * STREAM_HZ:
        raise UsageError(
            f"force.rate_Hz {config.rate_Hz:g}: a {PRODUCT} streams at {STREAM_HZ} Hz and no slower; "
            f"write {STREAM_HZ} or more"
        )


def _started_or_refused(text: bytes) -> bool:
    return refusal(text) is not None or bool(Decoder(LinkCounters()).feed(text))


def _described(wrench: Wrench) -> str:
    return " ".join(f"{name} {value:g}" for name, value in wrench._asdict().items())
