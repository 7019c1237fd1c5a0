"""A Robotiq FT 300 in the role of force sensor.

The line has one owner at a time: our port stops a stream that may still run, then pymodbus reads who the sensor is,
then our port again starts the stream and keeps the line. The stream carries no counter and no status: what dates its
frames and counts the lost ones is their place in it, see ``frame_clock``.
"""

import logging
import math
import select
import time
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from functools import partial
from typing import ClassVar

from pymodbus.client import ModbusSerialClient
from pymodbus.exceptions import ModbusException

from drivers.ports import Port, open_port, read_until
from drivers.robotiq import codec
from drivers.robotiq.frame_clock import LISTEN_NS, PERIOD_NS, FrameClock
from drivers.roles import Identity, LinkCounters
from drivers.streamed_force import StreamedForce
from rig.config.products.robotiq_ft300 import Ft300Wiring
from rig.errors import DeviceError

PRODUCT = "robotiq-ft300"
FIRMWARE_LETTER = "F"
# The maker's driver takes 80 ms without bytes for a stopped stream and gives the sensor another 100 ms.
SILENCE_S = 0.18
# A burst takes 26 ms on the line; the rest leaves room for what was under way before it, and for the silence.
BURST_S = 0.4
STOP_S = 3.0
# Request and longest answer are 31 bytes, 16 ms; the maker's driver waits 400 ms.
ANSWER_S = 0.4
RETRIES = 2
# A command that arrives damaged is not obeyed, and starting a stream twice starts it once.
START_TRIES = 2
# Twenty frames of the stream; the rest is for the host.
FIRST_FRAME_S = 1.0 + 20 / codec.STREAM_HZ

# pymodbus logs each failed try; here a failure is one sentence in a DeviceError.
logging.getLogger("pymodbus").addHandler(logging.NullHandler())


class RobotiqFt300(StreamedForce[FrameClock, codec.Wrench]):
    """Owns the line from construction on; ``open_port`` opens it at a given baud.

    The rate is fixed: ``config.rate_Hz`` is the most that is wanted, and ``period_ns`` tells what there is. Raises
    DeviceError where the port cannot be opened.
    """

    DEFAULT_BAUD: ClassVar = codec.DEFAULT_BAUD

    def __init__(
        self, open_port: Callable[[int], Port], config: Ft300Wiring, now: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self._open_port = open_port
        clock = FrameClock(round(config.latency_ms * 1e6))
        super().__init__(PRODUCT, open_port(codec.DEFAULT_BAUD), clock, now)
        self._decoder = codec.make_decoder(self.counters)

    @property
    def period_ns(self) -> int:
        """Nominal time between samples."""
        return PERIOD_NS

    def start(self) -> None:
        """Stops a running stream, identifies the sensor by its registers and starts the stream."""
        self._stop_stream()
        self._port.close()
        self._identity = self._read_identity()
        self._port = self._open_port(codec.DEFAULT_BAUD)
        self._start_stream()
        self._listen()

    def close(self) -> None:
        """Stops the stream and gives the port back."""
        with suppress(DeviceError):
            self._port.write(codec.STOP_BURST)
        self._port.close()

    def _stop_stream(self) -> None:
        deadline_ns = self._now() + round(STOP_S * 1e9)
        while not self._falls_silent():
            if self._now() > deadline_ns:
                raise self._error(
                    f"still sends bytes after {STOP_S:g} s of stop bursts; check force.port and force.product, "
                    "then power the sensor off and on"
                )
            self._port.write(codec.STOP_BURST)

    def _falls_silent(self) -> bool:
        """Whether the line is quiet for ``SILENCE_S`` within ``BURST_S``."""
        deadline_ns = self._now() + round(BURST_S * 1e9)
        while self._now() < deadline_ns:
            if not read_until(self._port, bool, SILENCE_S):
                return True
        return False

    def _read_identity(self) -> Identity:
        address = self._port.address.replace("tcp://", "socket://")
        with closing(
            ModbusSerialClient(address, baudrate=codec.DEFAULT_BAUD, timeout=ANSWER_S, retries=RETRIES)
        ) as client:
            if not client.connect():
                raise self._error("cannot be opened again for Modbus; check who else uses the port")
            firmware = codec.decode_firmware(self._registers(client, codec.FIRMWARE, 3))
            if not firmware.startswith(FIRMWARE_LETTER):
                raise self._error(
                    f"firmware {firmware!r} is not that of a force sensor ({FIRMWARE_LETTER}...); "
                    "check force.port and force.product"
                )
            return Identity(
                PRODUCT,
                codec.decode_serial_number(self._registers(client, codec.SERIAL_NUMBER, 4)),
                firmware,
                {
                    "rate": f"{codec.STREAM_HZ} Hz",
                    "production year": str(self._registers(client, codec.PRODUCTION_YEAR, 1)[0]),
                    "forces at start": _described(codec.decode_forces(self._registers(client, codec.FORCES, 6))),
                },
            )

    def _registers(self, client: ModbusSerialClient, address: int, count: int) -> Sequence[int]:
        asked = f"slave {codec.SLAVE_ID}, registers {address} to {address + count - 1}"
        try:
            answer = client.read_holding_registers(address, count=count, device_id=codec.SLAVE_ID)
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
        text = b""
        for _ in range(START_TRIES):
            self._port.write(codec.START_STREAM)
            text = read_until(self._port, _started_or_refused, FIRST_FRAME_S)
            if _started_or_refused(text):
                break
        code = codec.refusal(text)
        if code is not None:
            raise self._error(f"refused to start its stream with Modbus exception {code}; check its firmware")
        self._decoder = codec.make_decoder(self.counters)
        self._clock.restart()
        self._taken = []
        self._take(text.replace(codec.STREAM_STARTED, b"", 1), self._now())
        if not any(frames for frames, _ in self._taken):
            raise self._error(
                f"no stream frame within {FIRST_FRAME_S:.1f} s of the start command, {len(text)} bytes came; "
                "check the cable"
            )

    def _listen(self) -> None:
        """Lets the clock map find the stream's rate before the first frame is dated."""
        end_ns = self._now() + LISTEN_NS
        while (left_ns := end_ns - self._now()) > 0:
            select.select([self._port.fileno()], [], [], left_ns * 1e-9)
            self._take(self._port.read(), self._now())

    def _take(self, data: bytes, arrival_ns: int) -> None:
        wrenches = self._decoder.feed(data)
        devices_ns = self._clock.take(self._decoder.gaps, arrival_ns)
        self.counters.device_lost = self._clock.lost
        self._taken.append((list(zip(devices_ns, wrenches, strict=True)), arrival_ns))

    def _read(self, frame: codec.Wrench) -> tuple[float, ...]:
        return (*frame, math.nan, 0, int(frame.in_range))


def open_sensor(config: Ft300Wiring) -> RobotiqFt300:
    """The sensor at the configured port, not yet started; raises DeviceError where that cannot be opened."""
    return RobotiqFt300(partial(open_port, config.port), config)


def _started_or_refused(text: bytes) -> bool:
    return codec.refusal(text) is not None or bool(codec.make_decoder(LinkCounters()).feed(text))


def _described(wrench: codec.Wrench) -> str:
    return " ".join(f"{name} {value:g}" for name, value in wrench._asdict().items())
