"""What a protocol mock is, and what it may ask of the bench behind it.

The bench process calls ``tick`` of the mock whose ``due_ns`` is earliest, after the physics has been integrated exactly
to that time, and ``receive`` when bytes came. What a mock does follows these times alone; the drive may be lent a clock
to note when it really took a SYNC.
"""

from typing import NamedTuple, Protocol

NEVER_NS = 1 << 62  # after 146 years; its difference to any time still has 64 bits
# Times of samples that a mock keeps for whoever asks: ten seconds at 1 kHz.
SAMPLES_KEPT = 10_000


class MarkerPose(NamedTuple):
    """A tool as the camera sees it; ``None`` in place of one means it is hidden."""

    x_mm: float
    y_mm: float
    z_mm: float
    q0: float
    qx: float
    qy: float
    qz: float
    error_mm: float


class SensorPlant(Protocol):
    """The force sensor's physics."""

    temperature_C: float

    def wrench(self) -> tuple[float, float, float, float, float, float]:
        """Fx Fy Fz [N], Mx My Mz [N m] as the converter gives them now, with zero, noise, quantisation and range."""

    def overrange(self) -> bool:
        """Whether the converter is at its end now."""


class AxisPlant(Protocol):
    """Motor, screw and carriage under the drive's position loop; positions are mm from the reference switch."""

    position_mm: float
    velocity_mm_s: float
    current_A: float
    at_reference: bool
    current_limit_A: float

    def power(self, on: bool) -> None:
        """Torque on (holds the present position) or off (the brake closes)."""

    def target(self, position_mm: float) -> None:
        """Set-point of the drive's position loop from now on."""

    def push(self, current_A: float) -> None:
        """This motor current instead of the position loop's, until the next ``target`` or ``power``."""


class TrackerPlant(Protocol):
    """The camera's view."""

    def markers(self, now_ns: int) -> list[MarkerPose | None]:
        """Tools in view as of the frame delivered now: latency and noise included; order as in the bench file."""


class ProtocolMock(Protocol):
    """One product on its wire."""

    name: str

    def endpoints(self) -> dict[str, str]:
        """Kind of port to address, for `rig mock --json`."""

    def filenos(self) -> list[int]:
        """Descriptors to wait on."""

    @property
    def due_ns(self) -> int:
        """When ``tick`` is next to be called; NEVER_NS if only bytes matter."""

    def tick(self, now_ns: int) -> None:
        """Does what is due at ``now_ns``: emit a sample, advance a profile, check a heartbeat."""

    def receive(self, now_ns: int) -> None:
        """Reads what the client sent and answers."""

    def close(self) -> None:
        """Cuts the wire."""
