"""Force sensors that stream by themselves: frames are taken as they come, and dated once all of a look are known."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Generic, Protocol, TypeVar

from drivers.ports import Port
from drivers.roles import Identity, LinkCounters
from rig.channels import ForceSample
from rig.errors import DeviceError


class Dating(Protocol):
    """From the sensor's time to the host's."""

    def captures(self, devices_ns: Sequence[int], arrival_ns: int) -> list[int]:
        """Of frames that came together, oldest first."""


Clock = TypeVar("Clock", bound=Dating)
Frame = TypeVar("Frame")


class StreamedForce(ABC, Generic[Clock, Frame]):
    """Owns ``port`` until ``close``; ``_taken`` are frames with the sensor's time [ns], and when they arrived."""

    def __init__(self, product: str, port: Port, clock: Clock, now: Callable[[], int]) -> None:
        self.counters, self.next_seq = LinkCounters(), 0
        self._port, self._clock, self._now = port, clock, now
        self._identity = Identity(product, "", "")
        self._taken: list[tuple[list[tuple[int, Frame]], int]] = []

    @property
    def identity(self) -> Identity:
        """Known after ``start``."""
        return self._identity

    def fileno(self) -> int:
        """Descriptor that turns readable when a sample may have come; ``start`` may change it."""
        return self._port.fileno()

    def poll(self, now_ns: int) -> Sequence[ForceSample]:
        """Samples since the last call."""
        data = self._port.read()
        if data:
            # A host that is interrupted between its look at the clock and the read finds what came later.
            self._take(data, max(now_ns, self._now()))
        taken, self._taken = self._taken, []
        return [sample for frames, arrival_ns in taken for sample in self._samples(frames, arrival_ns)]

    def _samples(self, frames: Sequence[tuple[int, Frame]], arrival_ns: int) -> list[ForceSample]:
        captures_ns = self._clock.captures([device_ns for device_ns, _ in frames], arrival_ns)
        self.next_seq += len(frames)
        numbers = range(self.next_seq - len(frames), self.next_seq)
        return [
            ForceSample._make((number, capture_ns, arrival_ns, device_ns // 1000, *self._read(frame)))
            for number, capture_ns, (device_ns, frame) in zip(numbers, captures_ns, frames, strict=True)
        ]

    @abstractmethod
    def _take(self, data: bytes, arrival_ns: int) -> None:
        """Keeps the frames in ``data``, and dates none of them before all are known: the first may be the latest."""

    @abstractmethod
    def _read(self, frame: Frame) -> tuple[float, ...]:
        """From ``fx_N`` of a sample on."""

    def _about(self, what: str) -> str:
        return f"{self._identity.product} at {self._port.address}: {what}"

    def _error(self, what: str) -> DeviceError:
        return DeviceError(self._about(what))
