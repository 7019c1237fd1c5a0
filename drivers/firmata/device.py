"""A pain glove in the role of input: analogue inputs of a board with StandardFirmata, as forces under fingers.

The board has no clock that it tells and numbers nothing: capture is arrival less the time on the line, and a sample
that is lost shows as a pause alone, which is counted.
"""

import contextlib
import math
from collections.abc import Sequence
from typing import Final

from drivers.firmata.codec import (
    FIRMWARE,
    MAPPING,
    MAPPING_QUERY,
    FirmataMessage,
    FirmataParser,
    PinReading,
    Sysex,
    analog_channels,
    firmware_of,
    report,
    sampling_interval,
    sysex,
)
from drivers.ports import Port, open_port, read_until
from drivers.roles import Identity, LinkCounters
from rig.config.glove import SATURATED, FingerCalibration
from rig.config.products.firmata_glove import FirmataGlove
from rig.errors import DeviceError
from rig.input_streams import InputSample

BAUD = 57_600
# The bootloader of an Uno waits 1.6 s for a new program before it starts the one there is, which then names itself.
RESET_S = 2.0
ASK_S, ASKS = 0.5, 6
# Three bytes of ten bits each at 57600 bit/s.
ON_LINE_NS = 521_000
# The USB adapters of such boards hold bytes back for up to 16 ms (FTDI's latency timer as delivered).
HELD_BACK_NS = 16_000_000
# A pause of one interval and a half is one sample that did not come.
PAUSE = 1.5
# A finger that reads this much unloaded, as fabric presses on it, and then a quarter of it, has lost its wire.
PRELOADED, DEAD_SHARE = 20.0, 0.25
SATURATED_BIT, DEAD_BIT = 0, 16
"""Places in the status word: one bit a finger from each on."""


class FirmataBoard:
    """Owns ``port`` until ``close``."""

    def __init__(self, port: Port, config: FirmataGlove, reset_s: float = RESET_S) -> None:
        self.counters, self.next_seq = LinkCounters(), 0
        self.identity = Identity("", "", "")
        self.period_ns: Final = config.interval_ms * 1_000_000
        self._port, self._config, self._reset_s = port, config, reset_s
        self._pins = tuple(config.fingers.values())
        known = config.of_fingers.fingers if config.of_fingers else {}
        self._known = tuple(known.get(finger) for finger in config.fingers)
        self._counts: dict[int, int] = {}
        self._arrival_ns = 0

    def start(self) -> None:
        """Waits out the board's reset, checks firmware and pins, and asks for the fingers' samples."""
        self._parser = FirmataParser(self.counters)
        name, version = firmware_of(self._answer(FIRMWARE, FIRMWARE, self._reset_s))
        board = self._port.address
        if not name:
            raise DeviceError(f"{board}: the board does not say what firmware it has; put StandardFirmata on it")
        missing = set(self._pins) - analog_channels(self._answer(MAPPING_QUERY, MAPPING))
        if missing:
            raise DeviceError(
                f"{board}: {name} has no analogue input {min(missing)}, which fingers names; correct the pins"
            )
        self.identity = Identity(self._config.product, "", f"{name} {version}")
        self._port.write(
            sampling_interval(self._config.interval_ms) + b"".join(report(pin, True) for pin in self._pins)
        )
        self._counts, self._arrival_ns = {}, 0

    def _answer(self, query: int, answer: int, wait_s: float = 0.0) -> bytes:
        """Data of the answer to a query, which is asked once ``wait_s`` brought none, and again."""
        found = self._listen(answer, wait_s) if wait_s else None
        asked = 0
        while found is None and asked < ASKS:
            self._port.write(sysex(query))
            found, asked = self._listen(answer, ASK_S), asked + 1
        if found is not None:
            return found
        raise DeviceError(
            f"{self._port.address}: no board with Firmata answered within {wait_s + ASKS * ASK_S:g} s;"
            " check the port, and put StandardFirmata on the board"
        )

    def _listen(self, answer: int, wait_s: float) -> bytes | None:
        found: list[FirmataMessage] = []

        def enough(data: bytes) -> bool:
            found[:] = FirmataParser(LinkCounters()).feed(data)
            return any(isinstance(message, Sysex) and message.command == answer for message in found)

        read_until(self._port, enough, wait_s)
        return next((one.data for one in found if isinstance(one, Sysex) and one.command == answer), None)

    def fileno(self) -> int:
        """Descriptor that turns readable when a sample may have come."""
        return self._port.fileno()

    def poll(self, now_ns: int) -> Sequence[InputSample]:
        """Samples since the last call."""
        samples = []
        for message in self._parser.feed(self._port.read()):
            if isinstance(message, PinReading) and message.channel in self._pins:
                samples += self._take(message, now_ns)
        return samples

    def _take(self, found: PinReading, now_ns: int) -> list[InputSample]:
        """A board sends its inputs in turn: a sample is whole once each has come."""
        if found.channel in self._counts:
            self.counters.device_lost += 1
            self._counts = {}
        self._counts[found.channel] = found.counts
        if len(self._counts) < len(self._pins):
            return []
        counts = [self._counts[pin] for pin in self._pins]
        self._counts = {}
        self._count_pause(now_ns)
        return [self._sample(counts, now_ns)]

    def _count_pause(self, now_ns: int) -> None:
        pause_ns = now_ns - self._arrival_ns if self._arrival_ns else 0
        if pause_ns > PAUSE * self.period_ns + HELD_BACK_NS:
            self.counters.device_lost += round(pause_ns / self.period_ns) - 1
        self._arrival_ns = now_ns

    def _sample(self, counts: Sequence[int], now_ns: int) -> InputSample:
        forces_N, status = [], 0
        for finger, (value, known) in enumerate(zip(counts, self._known, strict=True)):
            bit = trouble_of(value, known)
            status |= 0 if bit is None else 1 << (bit + finger)
            force_N = known.force_N(value) if known and bit is None else None
            forces_N.append(math.nan if force_N is None else force_N)
        seq, self.next_seq = self.next_seq, self.next_seq + 1
        line_ns = len(counts) * ON_LINE_NS
        values = (*forces_N, *map(float, counts))
        sound = all(map(math.isfinite, forces_N))
        return InputSample(seq, now_ns - line_ns, now_ns, 0, 0, HELD_BACK_NS, values, status, int(sound))

    def concern(self) -> str:
        """Fingers without a calibration have no force."""
        unknown = [name for name, known in zip(self._config.fingers, self._known, strict=True) if known is None]
        if not unknown:
            return ""
        return f"no calibration of {', '.join(unknown)}, so no force is known there; run `rig calibrate glove`"

    def close(self) -> None:
        """Asks for no more samples, and gives the port back."""
        with contextlib.suppress(DeviceError):
            self._port.write(b"".join(report(pin, False) for pin in self._pins))
        self._port.close()


def trouble_of(counts: int, known: FingerCalibration | None) -> int | None:
    """Which bit of the status word a finger's reading sets, the first finger's; None where nothing is wrong."""
    if counts >= SATURATED:
        return SATURATED_BIT
    if known is None:
        return None
    if known.counts[0] >= PRELOADED and counts < DEAD_SHARE * known.counts[0]:
        return DEAD_BIT
    return SATURATED_BIT if known.force_N(counts) is None else None


def open_glove(config: FirmataGlove) -> FirmataBoard:
    """The glove at the configured port, not yet started; opening it resets the board."""
    return FirmataBoard(open_port(config.port, BAUD), config)
