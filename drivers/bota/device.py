"""A Bota SensONE in the role of force sensor.

``start`` resets the sensor, because only then does it say who it is, takes it to configuration mode, sets binary
frames and the filter that gives the rate, and lets it run. The reset also makes a session that was left running safe to
take over.
"""

import contextlib
import math
import select
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import ClassVar, TypeVar

from drivers.bota import codec
from drivers.ports import Port, open_port, read_until
from drivers.roles import Identity
from drivers.streamed_force import StreamedForce
from rig.config.products.bota_sensone import BotaWiring
from rig.errors import DeviceError, UsageError
from rig.timing import ClockMap, Unwrapper

PRODUCT = "bota-sensone"
NAME_PREFIX = "BFT"
# bota-driver 1.1.16 sets no filter shorter than 64 samples.
REFUSED = "check its firmware, or set force.rate_Hz to 800 or less, as newer sensors may want it"
UNUSABLE = int(codec.StatusBits.OVERRANGE | codec.StatusBits.INVALID | codec.StatusBits.RAW)
# The maker's driver allows 2 s for the settings and 2 s for the rest of the text after a reset.
BOOT_S = 4.0
# A command and its answer are 30 characters, 31 ms at 9600 baud; the rest is for the host.
ACK_S = 1.0
# Neither commands nor answers carry a checksum, and a sensor that has just printed its text may still drop a character.
TRIES = 3
Said = TypeVar("Said")
# The filter settles within a few frames; the rest is for the host.
FIRST_FRAMES = 20
FIRST_FRAMES_S = 1.0
# Frames of this long are dated together: among them are some that came at once, which the first may not have done.
LISTEN_S = 0.25


class BotaSensOne(StreamedForce[ClockMap, codec.ForceFrame]):
    """``now`` is the monotonic clock in ns.

    Raises UsageError, with the port closed, where the configured rate or baud cannot be had.
    """

    DEFAULT_BAUD: ClassVar = codec.DEFAULT_BAUD

    def __init__(self, port: Port, config: BotaWiring, now: Callable[[], int] = time.monotonic_ns) -> None:
        super().__init__(PRODUCT, port, ClockMap(round(config.latency_ms * 1e6)), now)
        try:
            self._baud, self._sinc = _line_settings(config)
        except UsageError:
            port.close()
            raise
        self._period_ns = round(self._sinc * 1e9 / codec.CONVERTER_HZ)
        self._forget_clock()

    @property
    def period_ns(self) -> int:
        """Nominal time between samples at the filter length chosen."""
        return self._period_ns

    def start(self) -> None:
        """Resets, identifies, configures and runs the sensor; raises DeviceError with one sentence."""
        boot = _repeated(self._reset)
        self._forget_clock()
        setup = codec.encode_communication(temperature_compensation=False, calibrated=True, baud=self._baud)
        for command in (codec.CONFIG_MODE, setup, codec.encode_filter(self._sinc)):
            _repeated(partial(self._command, command))
        self._await_frames(_repeated(partial(self._command, codec.RUN_MODE)))
        settings = {"rate": f"{codec.rate_Hz(self._sinc):.1f} Hz", "sinc": str(self._sinc), "baud": str(self._baud)}
        self._identity = Identity(boot.name, boot.serial, boot.firmware, settings)

    def close(self) -> None:
        """Takes the sensor out of run mode and gives the port back."""
        with contextlib.suppress(DeviceError):
            self._port.write(codec.CONFIG_MODE)
        self._port.close()

    def _forget_clock(self) -> None:
        """The sensor's clock starts anew with every reset."""
        self._decoder = codec.make_decoder(self.counters)
        self._unwrap = Unwrapper(32)
        self._clock.restart()
        self._last_us: int | None = None
        self._taken = []

    def _reset(self) -> codec.BootText:
        self._port.read()
        self._port.write(codec.HARD_RESET)
        text = read_until(self._port, lambda data: codec.find_boot_text(data) is not None, BOOT_S)
        boot = codec.find_boot_text(text)
        if boot is None:
            why = f"no boot text within {BOOT_S:g} s of a reset, {_came(text)}; {self._advice(text)}"
            raise _Misheard(self._about(why)) if text else self._error(why)
        if not boot.name.startswith(NAME_PREFIX):
            raise _Misheard(
                self._about(
                    f"is a {boot.name!r}, not a Bota sensor ({NAME_PREFIX}...); check force.port and force.product"
                )
            )
        return boot

    def _advice(self, text: bytes) -> str:
        if text:
            return f"check force.port and that the sensor is set to {self._baud} baud"
        return "check power, cable and force.port"

    def _command(self, command: bytes) -> bytes:
        """Sends ``command`` and waits for its acknowledgement; returns what came behind it."""
        self._port.write(command)
        text = read_until(self._port, lambda data: codec.find_ack(data, command) is not None, ACK_S)
        ack = codec.find_ack(text, command)
        if ack is None:
            raise _Misheard(
                self._about(f"no answer to {command!r} within {ACK_S:g} s, {_came(text)}; run `rig doctor`")
            )
        if ack.code:
            raise _Misheard(self._about(f"refused {command!r} with code {ack.code}, expected 0; {REFUSED}"))
        return text[ack.end :]

    def _await_frames(self, data: bytes) -> None:
        """Waits for the first sample that the sensor vouches for; samples until then are kept for ``poll``."""
        timeout_s = FIRST_FRAMES_S + FIRST_FRAMES * self._period_ns / 1e9
        begun_ns = self._now()
        deadline_ns = begun_ns + round(timeout_s * 1e9)
        while True:
            self._take(data, self._now())
            frames = [frame for timed, _ in self._taken for _, frame in timed]
            left_s = (deadline_ns - self._now()) / 1e9
            if any(map(_is_valid, frames)) and self._now() - begun_ns >= LISTEN_S * 1e9:
                self.counters.discarded_bytes = 0  # the rest of the last answer, not a loss
                return
            if left_s <= 0:
                raise self._error(self._no_valid_frame(frames, timeout_s))
            select.select([self._port.fileno()], [], [], min(left_s, LISTEN_S))
            data = self._port.read()

    def _no_valid_frame(self, frames: Sequence[codec.ForceFrame], timeout_s: float) -> str:
        if not frames:
            return (
                f"no frame within {timeout_s:.1f} s of run mode, {self.counters.discarded_bytes} bytes without "
                "a good checksum; check cable and baud"
            )
        status = codec.StatusBits(frames[-1].status)
        return f"no valid reading within {timeout_s:.1f} s of run mode, status {status!r}; unload it and check power"

    def _take(self, data: bytes, arrival_ns: int) -> None:
        counted = [(self._unwrap(frame.time_us), frame) for frame in self._decoder.feed(data)]
        timed = [(device_us * 1000, frame) for device_us, frame in counted if self._is_new(device_us)]
        for device_ns, _ in timed:
            self._clock.observe(device_ns, arrival_ns)
        self._taken.append((timed, arrival_ns))

    def _read(self, frame: codec.ForceFrame) -> tuple[float, ...]:
        return (*frame[1:7], frame.temperature_C, frame.status, int(_is_valid(frame)))

    def _is_new(self, device_us: int) -> bool:
        """Counts what is missing before this reading; False where the line brings one reading twice."""
        step_us = device_us - self._last_us if self._last_us is not None else round(self._period_ns / 1000)
        if step_us < 0:
            raise self._error(
                f"its clock went back by {-step_us / 1e3:.1f} ms: it restarted by itself; check power, start again"
            )
        self._last_us = device_us
        self.counters.repeated += not step_us
        self.counters.device_lost += max(round(step_us * 1000 / self._period_ns) - 1, 0)
        return bool(step_us)


def open_sensor(config: BotaWiring) -> BotaSensOne:
    """The sensor at the configured port, not yet started; raises DeviceError where that cannot be opened."""
    return BotaSensOne(open_port(config.port, config.baud or codec.DEFAULT_BAUD), config)


class _Misheard(DeviceError):
    """What came back is not what should; no checksum tells whether either way was damaged."""


def _repeated(say: Callable[[], Said]) -> Said:
    """``say``, again where it was misheard: all that is said at start says the same when it is said twice."""
    for _ in range(TRIES - 1):
        with contextlib.suppress(_Misheard):
            return say()
    return say()


def _line_settings(config: BotaWiring) -> tuple[int, int]:
    """Baud and filter length; raises UsageError where one is unknown or the line too slow for the other."""
    baud = config.baud or codec.DEFAULT_BAUD
    if baud not in codec.BAUD_CODES:
        raise UsageError(
            f"force.baud {baud}: a {PRODUCT} takes {', '.join(map(str, codec.BAUD_CODES))}; write one of these"
        )
    sinc, most_Hz = codec.sinc_for(config.rate_Hz), codec.line_rate_Hz(baud)
    if (rate_Hz := codec.rate_Hz(sinc)) > most_Hz:
        raise UsageError(
            f"force.rate_Hz {rate_Hz:.0f}: {baud} baud carries at most {most_Hz:.0f} frames/s; "
            "lower rate_Hz or raise baud"
        )
    return baud, sinc


def _is_valid(frame: codec.ForceFrame) -> bool:
    return not frame.status & UNUSABLE and math.isfinite(sum(frame[1:7]))


def _came(text: bytes) -> str:
    return f"{len(text)} bytes came ({text[:16]!r}...)" if text else "nothing came"
