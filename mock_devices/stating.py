"""What a mock may say of itself beyond its wire; whoever serves it looks for each."""

from collections import deque
from typing import Protocol, runtime_checkable


@runtime_checkable
class Numbered(Protocol):
    """A device that has a serial number: its calibration is kept by that."""

    serial_number: str


@runtime_checkable
class Sampled(Protocol):
    """A sensor that notes mark and true time of each sample, for whoever measures its driver."""

    sampled: deque[tuple[int, int]]


@runtime_checkable
class StatedLatency(Protocol):
    """A device whose data sheet states from event to sample [ms]."""

    latency_ms: float
