"""The streams of the bench: field names, units, and the one binary layout used by ring, file and reader.

A sample is a ``NamedTuple`` whose order is the wire order. Integers are int64 and reals float64, all 8-byte aligned,
so a packed row is at once a ring payload, the body of a CDR message (OMG DDS-XTypes 7.4.3.5, little-endian) described
by a ``ros2msg`` schema, and a row of a numpy structured array. Strings (events only) stand last, as CDR strings.

Sign convention everywhere: force positive in compression, position and depth positive into the tissue.
Time points are integer nanoseconds of the host's monotonic clock.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, get_type_hints

if TYPE_CHECKING:
    import numpy as np

CDR_HEADER = b"\x00\x01\x00\x00"
STAMP = {
    "seq": (
        "1",
        "sample number of this stream since its device first started, going on where it was opened again;"
        " no number is used twice or left out",
    ),
    "capture_ns": ("ns", "host monotonic time at which the device took the sample"),
    "arrival_ns": ("ns", "host monotonic time at which the bytes were read"),
}


class ForceSample(NamedTuple):
    """One reading of the force sensor, in the sensor's own frame, uncorrected."""

    seq: int
    capture_ns: int
    arrival_ns: int
    device_us: int
    fx_N: float
    fy_N: float
    fz_N: float
    mx_N_m: float
    my_N_m: float
    mz_N_m: float
    temperature_C: float
    status: int
    valid: int


class AxisSample(NamedTuple):
    """One reading of the servo axis."""

    seq: int
    capture_ns: int
    arrival_ns: int
    position_mm: float
    velocity_mm_s: float
    current_A: float
    status: int
    valid: int


class MarkerSample(NamedTuple):
    """One tool in one frame of the tracker; ``valid`` 0 means MISSING and the pose is NaN."""

    seq: int
    capture_ns: int
    arrival_ns: int
    frame: int
    tool: int
    x_mm: float
    y_mm: float
    z_mm: float
    q0: float
    qx: float
    qy: float
    qz: float
    error_mm: float
    valid: int


class LoopSample(NamedTuple):
    """One cycle of the loop: when it ran, how old its inputs were, what it decided."""

    seq: int
    capture_ns: int
    arrival_ns: int
    cycle: int
    missed: int
    scheduled_ns: int
    wake_latency_ns: int
    execution_ns: int
    force_age_ns: int
    axis_age_ns: int
    marker_age_ns: int
    health: int
    mode: int
    step: int
    force_N: float
    reference_N: float
    position_mm: float
    command_mm: float
    surface_mm: float
    depth_mm: float
    tangent_N_mm: float


class EventSample(NamedTuple):
    """Something that happened once: a mode change, a limit, a fault, a note."""

    seq: int
    capture_ns: int
    arrival_ns: int
    level: int
    code: str
    text: str


Sample = ForceSample | AxisSample | MarkerSample | LoopSample | EventSample


@dataclass(frozen=True)
class Stream:
    """One stream: its number on the ring, its name in files, its row type and the unit and meaning of each field."""

    id: int
    name: str
    row: type[tuple[Any, ...]]
    units: Mapping[str, tuple[str, str]]

    @cached_property
    def kinds(self) -> dict[str, type]:
        """Field name to ``int``, ``float`` or ``str``, in wire order."""
        return get_type_hints(self.row)

    @cached_property
    def fixed(self) -> struct.Struct:
        """Layout of the numeric fields: 8 bytes each, little-endian."""
        return struct.Struct(
            "<" + "".join("q" if kind is int else "d" for kind in self.kinds.values() if kind is not str)
        )

    @cached_property
    def dtype(self) -> "np.dtype[np.void]":
        """The same layout as a numpy record; streams with text have no array form."""
        import numpy as np  # noqa: PLC0415 - help tells products and their streams without it

        return np.dtype(
            [(name, "<i8" if kind is int else "<f8") for name, kind in self.kinds.items() if kind is not str]
        )

    @cached_property
    def has_text(self) -> bool:
        """Whether rows end in CDR strings."""
        return str in self.kinds.values()

    def pack(self, row: tuple[Any, ...]) -> bytes:
        """Bytes of one row, without the CDR header."""
        if not self.has_text:
            return self.fixed.pack(*row)
        numbers = [value for value in row if not isinstance(value, str)]
        body = self.fixed.pack(*numbers)
        for text in (value for value in row if isinstance(value, str)):
            data = text.encode() + b"\0"
            body += b"\0" * (-len(body) % 4) + struct.pack("<I", len(data)) + data
        return body

    def unpack(self, body: bytes) -> tuple[Any, ...]:
        """The row packed in ``body``; raises ``struct.error`` or ``IndexError`` where it is cut short."""
        values: list[Any] = list(self.fixed.unpack_from(body))
        at = self.fixed.size
        for _ in range(sum(kind is str for kind in self.kinds.values())):
            at += -at % 4
            (size,) = struct.unpack_from("<I", body, at)
            values.append(body[at + 4 : at + 3 + size].decode(errors="replace"))
            at += 4 + size
        return self.row(*values)

    def schema(self) -> str:
        """The ``ros2msg`` text of this stream: names in lower case, as ROS 2 wants them; name, unit, meaning behind."""
        kinds = {int: "int64", float: "float64", str: "string"}
        return "".join(
            f"{kinds[kind]} {name.lower()}  # {name} [{self.units[name][0]}] {self.units[name][1]}\n"
            for name, kind in self.kinds.items()
        )


FORCE = Stream(1, "force", ForceSample, STAMP | {
    "device_us": ("us", "the device's own counter, unwrapped; 0 where it has none"),
    "fx_N": ("N", "force along the sensor's x, tension positive as the maker gives it"),
    "fy_N": ("N", "force along the sensor's y"),
    "fz_N": ("N", "force along the sensor's z"),
    "mx_N_m": ("N m", "moment about the sensor's x"),
    "my_N_m": ("N m", "moment about the sensor's y"),
    "mz_N_m": ("N m", "moment about the sensor's z"),
    "temperature_C": ("degC", "temperature inside the sensor; NaN where it has none"),
    "status": ("1", "status word as received"),
    "valid": ("1", "1 if the device vouches for the sample"),
})  # fmt: skip
AXIS = Stream(2, "axis", AxisSample, STAMP | {
    "position_mm": ("mm", "actual position, positive into the tissue"),
    "velocity_mm_s": ("mm/s", "actual velocity as the drive gives it"),
    "current_A": ("A", "motor current as the drive gives it"),
    "status": ("1", "CiA 402 statusword"),
    "valid": ("1", "1 if the drive is without fault"),
})  # fmt: skip
MARKER = Stream(3, "marker", MarkerSample, STAMP | {
    "frame": ("1", "frame number of the tracker"),
    "tool": ("1", "index of the tool in the configuration"),
    "x_mm": ("mm", "tool origin in the tracker's frame"),
    "y_mm": ("mm", "tool origin in the tracker's frame"),
    "z_mm": ("mm", "tool origin in the tracker's frame"),
    "q0": ("1", "unit quaternion, scalar part"),
    "qx": ("1", "unit quaternion"),
    "qy": ("1", "unit quaternion"),
    "qz": ("1", "unit quaternion"),
    "error_mm": ("mm", "the tracker's own estimate of its fit error"),
    "valid": ("1", "0 if the tool was missing"),
})  # fmt: skip
LOOP = Stream(4, "loop", LoopSample, STAMP | {
    "cycle": ("1", "number of this cycle on the absolute time grid; a jump is a missed cycle"),
    "missed": ("1", "cycles missed since the loop started"),
    "scheduled_ns": ("ns", "when the cycle was due"),
    "wake_latency_ns": ("ns", "wake-up after the cycle was due"),
    "execution_ns": ("ns", "work for this row: inputs taken before it was due, and from its sample to this row"),
    "force_age_ns": ("ns", "age of the newest force sample when it was used"),
    "axis_age_ns": ("ns", "age of the newest axis sample when it was used"),
    "marker_age_ns": ("ns", "age of the newest tracker frame when it was used"),
    "health": ("1", "three bits a stream (alive, valid, on rate): force 0-2, axis 3-5, marker 6-8"),
    "mode": ("1", "controller mode, see controller.loop.modes.Mode"),
    "step": ("1", "index of the protocol step being executed; -1 without one"),
    "force_N": ("N", "compressive force from the reference zero"),
    "reference_N": ("N", "reference of the force loop; NaN outside contact mode"),
    "position_mm": ("mm", "axis position used"),
    "command_mm": ("mm", "position sent to the drive"),
    "surface_mm": ("mm", "axis position of the surface found; NaN before contact"),
    "depth_mm": ("mm", "position minus surface; NaN before contact"),
    "tangent_N_mm": ("N/mm", "tangent stiffness the gains were scheduled on; NaN outside contact mode"),
})  # fmt: skip
EVENT = Stream(5, "event", EventSample, STAMP | {
    "level": ("1", "10 note, 20 warning, 30 soft stop, 40 immediate stop"),
    "code": ("1", "short name of what happened, a key of controller.safety.table or of the protocol"),
    "text": ("1", "one sentence for a person"),
})  # fmt: skip

STREAMS: tuple[Stream, ...] = (FORCE, AXIS, MARKER, LOOP, EVENT)
BY_ID = {stream.id: stream for stream in STREAMS}
BY_NAME = {stream.name: stream for stream in STREAMS}
