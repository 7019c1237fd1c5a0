"""How a CAN bus is: what passed, how full it is, and which errors its controller reports."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

from drivers.can.slcan import CanFrame, Flags

# Bits of a frame with 11-bit identifier beside its data (ISO 11898-1): start, arbitration, control, CRC, acknowledge,
# end, space between frames; an extended identifier has 20 more.
FRAME_BITS, EXTENDED_BITS = 47, 20
# Of 34 + 8n bits one in five may be stuffed; a tenth is what random data bring.
STUFFING = 1.1
LOAD_NS = 1_000_000_000
# Above this the frames of lowest priority, SDO and heartbeats, wait for tens of milliseconds.
LOADED_LARGEST = 0.8
# A connector that is moved costs a frame; more in a second is a cable, a terminator or another bit rate.
ERRORS_LARGEST_PER_S = 10


class BusState(IntEnum):
    """The controller's state (ISO 11898-1): how far its error counters went."""

    ACTIVE = 0
    WARNING = 1
    PASSIVE = 2
    OFF = 3


class Counted(Protocol):
    """What every link counts."""

    frames: int
    refused: int
    discarded_bytes: int


@dataclass
class BusHealth:
    """Counts of one link; ``refused`` are frames that the adapter did not take, as its send buffer was full."""

    bitrate: int
    frames: int = 0
    refused: int = 0
    discarded_bytes: int = 0
    error_frames: int = 0
    dropped: int = 0
    state: BusState = BusState.ACTIVE
    load: float = 0.0
    errors_per_s: float = 0.0
    _bits: float = 0.0
    _errors_before: int = 0
    _since_ns: int = 0

    def passed(self, frames: Iterable[CanFrame], now_ns: int) -> None:
        """Frames that went over the bus, in either direction; renews the load once a second."""
        self._bits += sum(map(bits_of, frames))
        if now_ns - self._since_ns >= LOAD_NS:
            seconds = (now_ns - self._since_ns) / 1e9
            self.load = self._bits / self.bitrate / seconds if self._since_ns else 0.0
            self.errors_per_s = (self.error_frames - self._errors_before) / seconds
            self._bits, self._errors_before, self._since_ns = 0, self.error_frames, now_ns

    def flagged(self, flags: Flags) -> None:
        """What an SLCAN adapter says has been since it was last asked: that there were errors, not how many."""
        self.error_frames += bool(flags & Flags.BUS_ERROR)
        self.dropped += bool(flags & (Flags.RECEIVE_FULL | Flags.OVERRUN))
        if flags & Flags.PASSIVE:
            self.state = BusState.PASSIVE
        elif flags & Flags.WARNING:
            self.state = BusState.WARNING
        elif not flags & Flags.BUS_ERROR:  # a controller tells changes of its state alone, and errors as they come
            self.state = BusState.ACTIVE

    @property
    def trouble(self) -> str:
        """What is wrong with the bus, in words; empty if nothing."""
        if self.state >= BusState.PASSIVE:
            return f"the CAN bus is error {self.state.name.lower()}: check bit rate, terminators and cable"
        if self.errors_per_s > ERRORS_LARGEST_PER_S:
            return f"the CAN bus has {self.errors_per_s:.0f} errors/s: check terminators and cable"
        if self.load > LOADED_LARGEST:
            return f"the CAN bus is loaded to {self.load:.0%}: take nodes or messages off it"
        return ""

    @property
    def summary(self) -> str:
        """For a person."""
        return (
            f"CAN {self.bitrate / 1000:g} kbit/s, load {self.load:.0%}, {self.error_frames} error frames, "
            f"{self.refused} refused, {self.dropped} dropped, error {self.state.name.lower()}"
        )


def bits_of(frame: CanFrame) -> float:
    """Bits on the bus, stuffing as it is on average."""
    data = 0 if frame.remote else 8 * len(frame.data)
    return STUFFING * (FRAME_BITS + data + (EXTENDED_BITS if frame.extended else 0))
