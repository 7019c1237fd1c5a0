"""A Bota SensONE on its wire: text commands without terminator, a reset that prints who it is, a frame stream.

Behaviour follows the maker's clients (see `drivers.bota.codec`). Where they leave it open, this mock waits for a
command after a reset instead of running by itself, takes settings in configuration mode only, and answers code 1
otherwise.
"""

import re
from collections import deque
from collections.abc import Iterator
from typing import Literal, NamedTuple

from drivers.bota.codec import (
    BAUD_CODES,
    COMMAND_BYTES_MAX,
    CONVERTER_HZ,
    SINC_LENGTHS,
    ForceFrame,
    StatusBits,
    encode_frame,
)
from mock_devices.interfaces import NEVER_NS, SAMPLES_KEPT, SensorPlant
from mock_devices.opening import PortPower
from mock_devices.wire import OnWire, Wire

Mode = Literal["off", "booting", "init", "config", "run"]

NAME = "BFT-SENS-SER-M8"
FIRMWARE = "1.0.6"
# The sensor itself takes about a second; long enough here to lose commands sent too early.
BOOT_NS = 200_000_000
LONGEST_SINC = 2048  # the maker's driver names it as the limit
OK, REFUSED = 0, 1
SINGLE = "CRI#slw"
ARGUMENT = "0123456789,.- ?"
COMPLETE = re.compile(
    r"c(,\d){4}|f,\d{2,4}(,\d){3}|b((, *-?\d+\.\d{3}){6}|(, *-?\d+\.\d{6}){6})|m\d(, *-?\d+\.\d{6}){6}|p\?",
)


class Command(NamedTuple):
    """One command: its letter and its comma-separated arguments; ``None`` where they are not of its form."""

    letter: str
    arguments: tuple[str, ...] | None


class CommandParser:
    """Finds commands by their form alone, one character at a time; holds at most 64 of them."""

    def __init__(self) -> None:
        self._text = ""

    def feed(self, data: bytes) -> Iterator[Command]:
        """Commands completed or spoilt by ``data``."""
        for char in data.decode("latin-1"):
            yield from self._next(char)

    def clear(self) -> None:
        """Forgets an unfinished command."""
        self._text = ""

    def _next(self, char: str) -> Iterator[Command]:
        if self._text and char in ARGUMENT:
            self._text += char
            if COMPLETE.fullmatch(self._text):
                yield Command(self._text[0], tuple(self._text.split(",")[1:]))
                self._text = ""
            elif len(self._text) >= COMMAND_BYTES_MAX:
                yield self._spoilt()
        else:
            if self._text:
                yield self._spoilt()
            if char in SINGLE:
                yield Command(char, ())
            elif char in "cfbmp":
                self._text = char

    def _spoilt(self) -> Command:
        letter, self._text = self._text[0], ""
        return Command(letter, None)


class BotaMock(OnWire):
    """Its counter runs ``drift_ppm`` faster than the bench's clock.

    On a serial line it gets its power, as over USB, from the first client that opens it, who so sees the boot text;
    on any other wire at ``start_ns``.

    Failures of the device, plain attributes to be set at any time: ``silent`` sends nothing; ``frozen`` repeats the
    last forces under running time; ``invalid`` sets the status bit of that name; ``wrong_identity`` prints another
    maker's name after a reset; ``corrupt_every`` n spoils the checksum of every n-th frame; ``refuse`` holds the
    letters of commands that are answered with code 1.
    """

    name = "force"

    def __init__(
        self, wire: Wire, plant: SensorPlant, start_ns: int, drift_ppm: float = 0.0, serial_number: str = "000271"
    ) -> None:
        super().__init__(wire)
        self.silent = self.frozen = self.invalid = self.wrong_identity = False
        self.corrupt_every = 0
        self.refuse = ""
        self.sampled: deque[tuple[int, int]] = deque(maxlen=SAMPLES_KEPT)
        self._plant = plant
        self.serial_number = serial_number
        self._speed = 1 + drift_ppm * 1e-6
        self._parser = CommandParser()
        self._port = PortPower(wire.endpoint)
        self._mode: Mode = "off" if self._port.watched else "booting"
        self._power_ns = self._seen_ns = start_ns
        self._due_ns = NEVER_NS if self._port.watched else start_ns + BOOT_NS
        self._run_ns = start_ns
        self._frames = 0
        self._sinc = SINC_LENGTHS[-1]
        self._setup = ("0", "1", "0", "4")
        self._wrench = (0.0,) * 6

    def filenos(self) -> list[int]:
        """Descriptors to wait on."""
        return [*super().filenos(), *self._port.filenos()]

    def close(self) -> None:
        """Cuts the wire."""
        super().close()
        self._port.close()

    def restart(self) -> None:
        """Loses its power: boots again at once where a client is there, else when the next one comes."""
        self._mode, self._due_ns = "off", NEVER_NS
        if self._port.taken():
            self._boot(self._seen_ns)

    @property
    def due_ns(self) -> int:
        """When the boot text or the next frame is due."""
        return self._due_ns

    def tick(self, now_ns: int) -> None:
        """Finishes booting, or sends one frame."""
        self._seen_ns = now_ns
        if now_ns < self._due_ns:
            return
        if self._mode == "booting":
            self._mode, self._due_ns = "init", NEVER_NS
            self._send(self._boot_text())
        else:
            self._send_frame()
            self._due_ns = self._frame_ns(self._frames)

    def receive(self, now_ns: int) -> None:
        """Executes what the client sent; a booting sensor hears nothing."""
        self._seen_ns = now_ns
        if self._port.opened() and self._mode == "off":
            self._boot(now_ns)
        data = self._wire.read()
        if self._mode in ("off", "booting"):
            return
        for command in self._parser.feed(data):
            self._execute(command, now_ns)

    def _execute(self, command: Command, now_ns: int) -> None:
        if command.letter == "#":
            self._boot(now_ns)
            return
        code = self._code(command)
        if command.letter == "p" and code == OK:
            self._send(self._product_text())
        self._send(f"r,0,{command.letter},{code}\r\n".encode())
        if code == OK:
            self._apply(command, now_ns)

    def _code(self, command: Command) -> int:
        in_order = command.letter in "CRI" or self._mode == "config"
        refused = command.letter in self.refuse or command.arguments is None
        return OK if in_order and not refused and self._acceptable(command) else REFUSED

    def _acceptable(self, command: Command) -> bool:
        arguments = command.arguments or ()
        if command.letter == "c":
            return arguments[2] == "0" and int(arguments[3]) in BAUD_CODES.values()
        if command.letter == "f":
            return SINC_LENGTHS[0] <= int(arguments[0]) <= LONGEST_SINC
        return True

    def _apply(self, command: Command, now_ns: int) -> None:
        match command.letter, command.arguments:
            case "C", _:
                self._mode, self._due_ns = "config", NEVER_NS
            case "R", _:
                self._run(now_ns)
            case "I", _:
                self._boot(now_ns)
            case "c", (compensation, calibration, data_format, baud_code):
                self._setup = (compensation, calibration, data_format, baud_code)
            case "f", (sinc, *_):
                self._sinc = int(sinc)
            case "w", _:
                self._send(f"{self._setup_text()}f,{self._sinc},0,0,1\r\n".encode())
            case _:
                pass

    def _boot(self, now_ns: int) -> None:
        self._parser.clear()
        self._mode, self._due_ns = "booting", now_ns + BOOT_NS
        self._power_ns = now_ns

    def _boot_text(self) -> bytes:
        name = "KMS40" if self.wrong_identity else NAME
        return (
            f"{self._setup_text()}App Init\r\nname: {name}\r\nS/N: {self.serial_number}\r\nFW version: {FIRMWARE}\r\n"
        ).encode()

    def _product_text(self) -> bytes:
        """Serial number and name where the maker's driver looks for them; it passes over what else stands there."""
        return f"p,0,{self.serial_number[-3:]},0,0,{NAME}\r\n".encode()

    def _setup_text(self) -> str:
        return f"c,{','.join(self._setup)}\r\n"

    def _run(self, now_ns: int) -> None:
        if self._mode != "run":
            self._mode, self._run_ns, self._frames = "run", now_ns, 0
            self._due_ns = self._frame_ns(0)

    def _frame_ns(self, number: int) -> int:
        period_ns = self._sinc * 1e9 / CONVERTER_HZ / self._speed
        return self._run_ns + round((number + 1) * period_ns)

    def _send_frame(self) -> None:
        if not self.frozen:
            self._wrench = self._plant.wrench()
        time_us = round((self._due_ns - self._power_ns) * self._speed / 1000) & 0xFFFF_FFFF
        self.sampled.append((time_us, self._due_ns))
        raw = encode_frame(ForceFrame(self._status(), *self._wrench, time_us, self._plant.temperature_C))
        self._frames += 1
        if self.corrupt_every and self._frames % self.corrupt_every == 0:
            raw = raw[:-1] + bytes([raw[-1] ^ 0xFF])
        self._send(raw)

    def _status(self) -> int:
        status = StatusBits(0)
        if self._plant.overrange():
            status |= StatusBits.OVERRANGE
        if self.invalid:
            status |= StatusBits.INVALID
        if self._setup[1] == "0":
            status |= StatusBits.RAW
        return int(status)

    def _send(self, data: bytes) -> None:
        if not self.silent:
            self._wire.write(data)
