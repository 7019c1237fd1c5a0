"""Streams of inputs: laid out by their channels, kept by a recording, and read from it by whoever knows no products."""

import csv
import json
import math
import struct
from pathlib import Path

import h5py
import numpy as np
import pytest
from mcap.reader import make_reader

from rig.channels import FORCE, STREAMS, ForceSample
from rig.input_streams import (
    FIRST_ID,
    METADATA,
    MOST_CHANNELS,
    InputChannel,
    InputSample,
    all_streams,
    channels_of,
    input_streams,
    layouts,
)
from rig.recording.export import export
from rig.recording.mcap_file import RecordingWriter
from rig.recording.reader import read_recording
from rig.recording.recorder import Recorder
from rig.recording.ring import RingReader, RingWriter
from rig.recording.sessions import Session, SessionInfo, TrialInfo
from rig.recording.slots import BODY_LIMIT
from rig.recording.verify import repair, verify
from rig.results.seen import see

GLOVE = (InputChannel("thumb_N", "N", "force"), InputChannel("thumb_counts", "1", "counts"))
PEDAL = (InputChannel("pressed", "1", "down"),)
INPUTS = {"glove": GLOVE, "pedal": PEDAL}
ABOUT = {METADATA: layouts(INPUTS), "calibration": {"force_axis": "fz"}}


def glove(seq: int) -> InputSample:
    return InputSample(seq, 20_000_000 * seq, 20_000_000 * seq + 5, 0, 0, 16_000_000, (0.5 * seq, 40.0), 0, 1)


def pedal(seq: int) -> InputSample:
    return InputSample(seq, 31 * seq, 32 * seq, 30 * seq, seq, -1, (1.0,), 0, 1)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "trial_001.mcap"
    streams = input_streams(INPUTS)
    writer = RecordingWriter(path, ABOUT)
    for seq in range(10):
        writer.add(streams[0].id, streams[0].pack(glove(seq).row))
        force = ForceSample(seq, seq, seq, 0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 20.0, 0, 1)
        writer.add(FORCE.id, FORCE.pack(force))
    writer.add(streams[1].id, streams[1].pack(pedal(1).row))
    writer.finish({"outcome": "done", "samples": json.dumps({"glove": 10, "pedal": 1, "force": 10})})
    return path


def test_a_row_is_its_stamps_its_channels_and_its_state() -> None:
    stream = input_streams(INPUTS)[0]
    assert (stream.id, stream.name, FIRST_ID) == (16, "glove", 16)
    assert list(stream.kinds) == [
        "seq", "capture_ns", "arrival_ns", "device_ns", "correction_ns", "uncertainty_ns",
        "thumb_N", "thumb_counts", "status", "valid",
    ]  # fmt: skip
    assert stream.pack(glove(3).row) == struct.pack(
        "<6q2d2q", 3, 60_000_000, 60_000_005, 0, 0, 16_000_000, 1.5, 40.0, 0, 1
    )
    assert channels_of(stream) == ("thumb_N", "thumb_counts")


def test_the_largest_input_fits_a_slot_of_the_ring() -> None:
    channels = [InputChannel(f"c{number}", "1", "") for number in range(MOST_CHANNELS)]
    (stream,) = input_streams({"wide": channels})
    assert stream.fixed.size <= BODY_LIMIT < stream.fixed.size + 8


def test_the_reader_needs_the_recording_alone(file: Path) -> None:
    recording = read_recording(file)
    assert recording.complete and recording.damage == ()
    rows = recording.tables["glove"]
    assert rows["thumb_N"].tolist() == [0.5 * seq for seq in range(10)]
    assert rows["uncertainty_ns"].tolist() == [16_000_000] * 10
    assert recording.tables["pedal"][["device_ns", "correction_ns", "capture_ns"]].tolist() == [(30, 1, 31)]
    assert [stream.name for stream in recording.streams[len(STREAMS) :]] == ["glove", "pedal"]
    verdict = verify(file)
    assert verdict.ok and verdict.streams["glove"].samples == 10


def test_any_mcap_reader_sees_each_as_a_topic(file: Path) -> None:
    with file.open("rb") as data:
        summary = make_reader(data, validate_crcs=True).get_summary()
    assert summary
    topics = {channel.topic: summary.schemas[channel.schema_id] for channel in summary.channels.values()}
    assert {"glove", "pedal", "force"} <= set(topics)
    assert b"float64 thumb_n  # thumb_N [N] force" in topics["glove"].data


def test_a_cut_recording_is_repaired_with_its_inputs(file: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(file.read_bytes()[:-200])
    assert not read_recording(cut).complete
    mended = tmp_path / "mended.mcap"
    assert repair(cut, mended).streams["glove"].samples == 10
    assert len(read_recording(mended).tables["pedal"]) == 1


def test_a_sample_that_is_missing_is_found(tmp_path: Path) -> None:
    stream = input_streams(INPUTS)[0]
    writer = RecordingWriter(tmp_path / "gap.mcap", ABOUT)
    for seq in (0, 1, 4):
        writer.add(stream.id, stream.pack(glove(seq).row))
    writer.finish({"outcome": "done", "samples": json.dumps({"glove": 4})})
    found = verify(tmp_path / "gap.mcap").streams["glove"]
    assert (found.missing, found.lost) == (2, 1)


def test_the_recorder_takes_them_from_the_ring_and_counts_them(tmp_path: Path) -> None:
    from rig.channel import Received  # noqa: PLC0415
    from rig.recording.messages import Close, Closed, Open  # noqa: PLC0415

    ring = RingWriter.create(tmp_path / "a.ring", 64)
    recorder = Recorder(reader := RingReader.open(ring.path))
    stream = input_streams(INPUTS)[0]
    recorder.handle(Received(1, Open(path=str(tmp_path / "r.mcap"), metadata=ABOUT)))
    for seq in (0, 2):
        ring.put(stream.id, stream.pack(glove(seq).row))
    ring.put(stream.id, b"\0" * 8)  # of another layout
    ring.put(FIRST_ID + 9, stream.pack(glove(9).row))  # of an input that this recording has not
    closed = recorder.handle(Received(2, Close(summary={"outcome": "done"})))
    assert isinstance(closed, Closed)
    assert (closed.samples, closed.missing, closed.unreadable) == ({"glove": 2}, {"glove": 1}, 2)
    assert len(read_recording(tmp_path / "r.mcap").tables["glove"]) == 2
    reader.close()
    ring.close()


@pytest.mark.parametrize(
    "planted",
    [
        {"00 glove": "no JSON"},
        {"00 glove": "[1, 2]"},
        {"00 Glove": json.dumps(GLOVE)},
        {"glove": json.dumps(GLOVE)},
        {"99 glove": json.dumps(GLOVE)},
        {"00 glove": json.dumps([["seq", "1", ""]])},
        {"00 glove": json.dumps([["a", "1", ""]] * 2)},
        {"00 glove": json.dumps([["a b", "1", ""]])},
    ],
)
def test_what_is_no_layout_gives_no_stream(planted: dict[str, str]) -> None:
    assert all_streams({METADATA: planted}) == STREAMS
    assert len(all_streams({METADATA: layouts(INPUTS)})) == len(STREAMS) + 2


@pytest.fixture
def session(file: Path) -> Session:
    trial = TrialInfo("trial_001", file.name, 5.0, 8.0, "done", samples={"glove": 10, "pedal": 1, "force": 10})
    return Session(file.parent, SessionInfo("s", "capture", "", "", trials=(trial,)))


def legend(folder: Path) -> dict[tuple[str, str], str]:
    with (folder / "columns.csv").open() as text:
        return {(row["stream"], row["column"]): row["unit"] for row in csv.DictReader(text)}


def test_they_are_exported_with_their_units(session: Session, tmp_path: Path) -> None:
    out = export(session, "csv", tmp_path / "csv")
    with (out / "trial_001" / "glove.csv").open() as text:
        rows = list(csv.DictReader(text))
    assert [float(row["thumb_N"]) for row in rows] == [0.5 * seq for seq in range(10)]
    assert legend(out)[("glove", "thumb_N")] == "N" and ("force", "fz_N") in legend(out)
    with h5py.File(export(session, "hdf5", tmp_path / "s.h5")) as made:
        assert made["trial_001/glove/thumb_N"].attrs["unit"] == "N"
        assert np.array_equal(made["trial_001/glove/seq"][:], np.arange(10))
    export(session, "parquet", tmp_path / "parquet")
    assert (tmp_path / "parquet" / "trial_001.glove.parquet").exists()
    from scipy.io import loadmat  # noqa: PLC0415

    made = loadmat(str(export(session, "mat", tmp_path / "s.mat")), simplify_cells=True)
    assert made["units"]["glove"]["thumb_N"] == "N"


def test_what_came_in_lists_each_channel(file: Path) -> None:
    found = {one.stream: one for one in see(read_recording(file)).inputs}
    assert set(found) == {"glove.thumb_N", "glove.thumb_counts", "pedal.pressed"}
    thumb = found["glove.thumb_N"]
    assert (thumb.unit, thumb.samples, thumb.highest) == ("N", 10, 4.5)
    assert thumb.rate_Hz == pytest.approx(50.0)
    assert found["pedal.pressed"].samples == 1
    assert see(read_recording(file)).one_clock  # of the bench's own streams


def test_values_that_are_no_numbers_are_missing(tmp_path: Path) -> None:
    stream = input_streams(INPUTS)[0]
    writer = RecordingWriter(tmp_path / "nan.mcap", ABOUT)
    for seq in range(4):
        writer.add(stream.id, stream.pack(glove(seq)._replace(values=(math.nan, 40.0)).row))
    writer.finish({"outcome": "done"})
    found = {one.stream: one for one in see(read_recording(tmp_path / "nan.mcap")).inputs}
    assert (found["glove.thumb_N"].missing, found["glove.thumb_counts"].missing) == (4, 0)
