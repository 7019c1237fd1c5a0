"""What can be subscribed: names, units, and the row of the ring each comes from."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from rig.channels import AXIS, BY_NAME, FORCE, LOOP, MARKER
from rig.config.wiring import Wiring

MARKER_FIELDS = ("x_mm", "y_mm", "z_mm")
# Of a row's whole numbers those that a float32 holds exactly and that say something by themselves.
SHOWN_NUMBERS = ("mode", "step", "missed", "health", "valid")
MADE_HERE = {
    "force_N": ("N", "compressive force from the reference zero, every reading of the sensor; NaN before a zero"),
    "compression_N": ("N", "compressive force as the sensor has it, no zero taken off"),
    "error_N": ("N", "set-point minus force; NaN outside force tracking"),
}

NAMED = {
    "force": ("force", "force_N"),
    "compression": ("force", "compression_N"),
    "position": ("axis", "position_mm"),
    "depth": ("loop", "depth_mm"),
    "setpoint": ("loop", "reference_N"),
    "error": ("loop", "error_N"),
}


@dataclass(frozen=True)
class LiveSignal:
    """One stream by name: ``fields`` of the rows of ``source``, in ``unit``; ``topic`` is the stream in recordings.

    Sequence numbers are those of the recording; they rise by ``step``.
    """

    name: str
    unit: str
    about: str
    source: str
    topic: str
    fields: tuple[str, ...]
    rate_hz: float
    step: int = 1


def marker_source(tool: str) -> str:
    """Name of the source that has the rows of one tool."""
    return f"marker.{tool}"


def sources(wiring: Wiring) -> dict[str, tuple[str, ...]]:
    """The fields kept of each source."""
    found = {
        "force": (*kept(FORCE.name), "force_N", "compression_N"),
        "axis": kept(AXIS.name),
        "loop": (*kept(LOOP.name), "error_N"),
    }
    tools = wiring.tracker.tools if wiring.tracker else ()
    return found | {marker_source(tool): (*MARKER_FIELDS, "error_mm", "valid") for tool in tools}


def kept(topic: str) -> tuple[str, ...]:
    """Fields of a recorded stream that are worth watching."""
    return tuple(name for name, kind in BY_NAME[topic].kinds.items() if kind is float or name in SHOWN_NUMBERS)


def rates_Hz(wiring: Wiring) -> dict[str, float]:
    """Rows a second of each recorded stream, of one tool of the tracker."""
    marker_Hz = wiring.tracker.rate_Hz if wiring.tracker else 0.0
    return {"force": wiring.force.sampled_Hz, "axis": wiring.loop.rate_Hz, "loop": wiring.loop.rate_Hz,
            "marker": marker_Hz}  # fmt: skip


def signals(wiring: Wiring) -> dict[str, LiveSignal]:
    """All there are on a bench with this ``wiring``, by name."""
    found = [*_named(wiring), *_markers(wiring), *_recorded(wiring)]
    return {signal.name: signal for signal in found}


def _named(wiring: Wiring) -> Iterator[LiveSignal]:
    for name, (topic, field) in NAMED.items():
        unit, about = MADE_HERE.get(field) or BY_NAME[topic].units[field]
        yield LiveSignal(name, unit, about, topic, topic, (field,), rates_Hz(wiring)[topic])


def _markers(wiring: Wiring) -> Iterator[LiveSignal]:
    tools: Sequence[str] = wiring.tracker.tools if wiring.tracker else ()
    for name, tool in (*(("marker", tool) for tool in tools[:1]), *((marker_source(tool), tool) for tool in tools)):
        about = f"origin of the marker {tool} in the tracker's frame; NaN where it is not seen"
        rate_Hz = rates_Hz(wiring)["marker"]
        yield LiveSignal(name, "mm", about, marker_source(tool), MARKER.name, MARKER_FIELDS, rate_Hz, len(tools))


def _recorded(wiring: Wiring) -> Iterator[LiveSignal]:
    for stream in (FORCE, AXIS, LOOP):
        for field in kept(stream.name):
            unit, about = stream.units[field]
            yield LiveSignal(
                f"{stream.name}.{field}", unit, about, stream.name, stream.name, (field,), rates_Hz(wiring)[stream.name]
            )
