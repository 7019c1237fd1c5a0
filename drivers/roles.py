"""The three roles on the bench. A product that fills one is chosen by one line of `rig.toml` and by nothing else.

``start`` may wait (each wait has a deadline) and checks the device's identity; after it, nothing blocks. ``poll`` takes
the time as an argument, returns what arrived since the last call, oldest first, and raises DeviceError when the device
is lost. ``close`` leaves the device safe, may be called twice and never raises.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from rig.channels import AxisSample, ForceSample, MarkerSample


@dataclass(frozen=True)
class Identity:
    """What a device says of itself."""

    product: str
    serial: str
    firmware: str
    settings: dict[str, str] = field(default_factory=dict)


@dataclass
class LinkCounters:
    """What the wire brought: nothing is dropped without being counted here."""

    frames: int = 0
    checksum_errors: int = 0
    discarded_bytes: int = 0
    device_lost: int = 0
    repeated: int = 0
    trouble: str = ""  # what is wrong with the link though it carries, in words


class Device(Protocol):
    """What every device has."""

    counters: LinkCounters
    next_seq: int
    """Number of the next sample; whoever takes over a stream from another driver sets it before ``start``."""

    @property
    def identity(self) -> Identity:
        """Known after ``start``."""

    @property
    def period_ns(self) -> int:
        """Nominal time between samples."""

    def start(self) -> None:
        """Identifies and configures the device and starts its samples."""

    def fileno(self) -> int:
        """Descriptor that turns readable when a sample may have come."""

    def close(self) -> None:
        """Leaves the device safe and the port free."""


@runtime_checkable
class Identifying(Protocol):
    """A device whose ``start`` sets something offers this beside it, for whoever only looks what is there."""

    def identify(self) -> Identity:
        """Opens the port, asks who is there, changes nothing and closes it; raises DeviceError."""


@runtime_checkable
class OnBus(Protocol):
    """A device on a bus that others may load, or disturb."""

    @property
    def bus(self) -> str:
        """Load and errors of the bus, in words; known after ``start``."""


class ForceSensor(Device, Protocol):
    """A sensor in front of the tip."""

    def poll(self, now_ns: int) -> Sequence[ForceSample]:
        """Samples since the last call."""


class ServoAxis(Device, Protocol):
    """The axis that carries the sensor. Positions are mm from home, positive into the tissue.

    ``start`` leaves it configured with its own limits and heartbeat armed, without torque.
    """

    @property
    def fault(self) -> str:
        """What the drive reports as wrong, in words; empty if nothing."""

    @property
    def enabled(self) -> bool:
        """Whether the drive follows cyclic positions now."""

    @property
    def referenced(self) -> bool:
        """Whether positions count from home, as the drive last said."""

    def home(self) -> None:
        """Finds the reference; waits, with a deadline from distance and speed."""

    def move_to(self, position_mm: float, speed_mm_s: float) -> None:
        """Moves by the drive's own profile; waits, with a deadline from distance and speed."""

    def enable(self) -> None:
        """Brings the drive to cyclic synchronous position at its present position; waits."""

    def poll(self, now_ns: int) -> Sequence[AxisSample]:
        """Samples since the last call; also keeps the heartbeat going."""

    def command(self, position_mm: float, now_ns: int) -> None:
        """Sends one cyclic set-point and asks for one sample."""

    def request(self, now_ns: int) -> None:
        """Asks for one sample without commanding anything."""

    def quick_stop(self) -> None:
        """Stops by the drive's own ramp and stays stopped."""

    def power_off(self) -> None:
        """Takes the torque away and does not wait: what does not hold by itself can then be pushed."""

    def history(self) -> tuple[str, ...]:
        """The errors the drive remembers, in words, newest first; waits."""

    def reset_fault(self) -> None:
        """Acknowledges a fault; waits; raises DeviceError where the cause is still there."""


class MarkerTracker(Device, Protocol):
    """A camera that follows markers."""

    @property
    def tools(self) -> tuple[str, ...]:
        """Names of the tools by index."""

    def poll(self, now_ns: int) -> Sequence[MarkerSample]:
        """One sample a tool and frame since the last call."""
