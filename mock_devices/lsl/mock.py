"""A respiration belt as an outlet of Lab Streaming Layer: the chest moves with the limb's surface on the bench.

The library's own threads do the sending. ``shift_s`` is planted into its time stamps: a belt whose clock is known to be
wrong by so much.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

from drivers.lsl.library import load
from mock_devices.interfaces import NEVER_NS

RATE_HZ = 50.0
SOURCE_ID = "tissue-rig-mock-belt"


class BreathingMock:
    """Sends ``surface_mm`` of the bench as respiration, 50 times a second from ``start_ns`` on."""

    name = "breathing"

    def __init__(self, stream: str, surface_mm: Callable[[], float], start_ns: int, rate_Hz: float = RATE_HZ) -> None:
        pylsl = load("machine")
        info = pylsl.StreamInfo(stream, "Respiration", 1, rate_Hz, pylsl.cf_double64, SOURCE_ID)
        info.set_channel_labels(["respiration"])
        info.set_channel_units(["mm"])
        self._clock, self._open = pylsl.local_clock, partial(pylsl.StreamOutlet, info)
        self._outlet: Any = None
        self._stream, self._surface_mm = stream, surface_mm
        self.shift_s, self.silent = 0.0, False
        self._period_ns = round(1e9 / rate_Hz)
        self._due_ns = start_ns
        self.plug()

    @property
    def due_ns(self) -> int:
        """When the next sample is taken."""
        return NEVER_NS if self._outlet is None else self._due_ns

    def tick(self, now_ns: int) -> None:
        """Takes a sample; what fell due while nobody ran is not made up."""
        if now_ns < self._due_ns or self._outlet is None:
            return
        self._due_ns += self._period_ns * (1 + (now_ns - self._due_ns) // self._period_ns)
        if not self.silent:
            self._outlet.push_sample([self._surface_mm()], self._clock() + self.shift_s)

    def endpoints(self) -> dict[str, str]:
        """Its name is its address."""
        return {"lsl": self._stream}

    def filenos(self) -> list[int]:
        """The library listens by itself."""
        return []

    def receive(self, now_ns: int) -> None:
        """Nothing comes."""

    def plug(self) -> None:
        """The stream is there; under its name again where it was taken away."""
        self._outlet = self._outlet or self._open()

    def close(self) -> None:
        """Takes the stream away."""
        self._outlet = None
