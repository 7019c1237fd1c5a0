"""A recording with known content, for every test that reads one."""

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from rig.channels import AXIS, EVENT, FORCE, AxisSample, EventSample, ForceSample
from rig.recording.mcap_file import RecordingWriter
from rig.recording.ring import RingReader
from tests.rig.recording.measured import measured

METADATA = {"recording": {"id": "r1", "trial": "indent-1"}, "trial": {"speed_mm_s": "5.0", "depth_mm": "8.0"}}
WriteRecording = Callable[..., Path]


def force(seq: int) -> ForceSample:
    """Sample ``seq`` of a 1 kHz force stream; every field follows from ``seq``."""
    capture_ns = 1_000_000_000 + seq * 1_000_000
    return ForceSample(seq, capture_ns, capture_ns + 700_000, seq * 1000, 0.0, -0.5, seq / 7, 0.0, 0.0, 0.0, 21.5, 0, 1)


def axis(seq: int) -> AxisSample:
    """Sample ``seq`` of a 1 kHz axis stream."""
    capture_ns = 1_000_000_000 + seq * 1_000_000
    return AxisSample(seq, capture_ns, capture_ns + 200_000, seq / 100, 10.0, 0.1, 0x1237, 1)


def event(seq: int) -> EventSample:
    """Event ``seq``, one every 100 ms."""
    capture_ns = 1_000_000_000 + seq * 100_000_000
    return EventSample(seq, capture_ns, capture_ns, 10, "note", f"Berührung {seq}")


@pytest.fixture
def write_recording(tmp_path: Path) -> WriteRecording:
    """Writes ``rows`` ms of force and axis with events, 100 ms a batch; ``finish`` false leaves a prefix."""

    def write(
        name: str = "indent-1",
        rows: int = 1000,
        finish: bool = True,
        skip: tuple[int, ...] = (),
        kind: str = "",
        about: Mapping[str, str] | None = None,
    ) -> Path:
        path = tmp_path / f"{name}.mcap"
        metadata = METADATA | ({"trial": {"kind": kind}} if kind else {}) | ({"recording": about} if about else {})
        writer = RecordingWriter(path, metadata)
        for seq in range(rows):
            if seq % 100 == 0:
                writer.flush()
                writer.add(EVENT.id, EVENT.pack(event(seq // 100)))
            if seq not in skip:
                writer.add(FORCE.id, FORCE.pack(force(seq)))
            writer.add(AXIS.id, AXIS.pack(axis(seq)))
        if finish:
            writer.finish({"outcome": "done"})
        else:
            writer.flush()
            writer.close()
        return path

    return write


def drained(reader: RingReader, limit: int, commit: bool = True) -> list[tuple[int, int, bytes]]:
    """Ring number, stream and body of each sample that is drained."""
    slots = reader.drain(limit, commit)
    return [(int(slot["number"]), int(slot["stream"]), slot["body"][: slot["size"]].tobytes()) for slot in slots]


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """A good folder of CSV files to import."""
    return measured(tmp_path / "measured")
