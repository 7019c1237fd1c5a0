"""A recording as others see it: the stock MCAP tools, a full disk, an existing file."""

import io
import resource
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap.reader import make_reader
from mcap.records import Footer, McapRecord, Message, SummaryOffset
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory

from rig.channels import AXIS, EVENT, FORCE, STREAMS
from rig.errors import UsageError
from rig.recording.mcap_file import RecordingFailed, RecordingWriter
from rig.recording.mcap_layout import COMPRESSION, _of_rows
from rig.recording.reader import read_recording
from tests.rig.recording.conftest import METADATA, WriteRecording, event, force


def test_the_stock_reader_accepts_every_checksum(write_recording: WriteRecording) -> None:
    with write_recording(rows=250).open("rb") as file:
        records: list[McapRecord] = list(StreamReader(file, validate_crcs=True).records)
    assert sum(isinstance(record, Message) for record in records) == 250 + 250 + 3


def test_the_stock_ros2_decoder_reads_our_rows(write_recording: WriteRecording) -> None:
    with write_recording(rows=250).open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        rows = [(message, row) for _, _, message, row in reader.iter_decoded_messages(topics=["force"])]
    message, row = rows[200]
    assert (message.sequence, message.publish_time, message.log_time) == (200, 1_200_000_000, 1_200_700_000)
    assert tuple(float(row.__getattribute__(name.lower())) for name in FORCE.kinds) == force(200)


def test_the_stock_ros2_decoder_reads_our_texts(write_recording: WriteRecording) -> None:
    with write_recording(rows=250).open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        texts = [(row.level, row.code, row.text) for *_, row in reader.iter_decoded_messages(topics=["event"])]
    assert texts == [tuple(event(seq)[3:]) for seq in range(3)]


def test_schemas_name_units_and_metadata_stand_before_the_samples(write_recording: WriteRecording) -> None:
    with write_recording(rows=10).open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        names = [record.name for record in reader.iter_metadata()]
    assert summary is not None
    assert [channel.topic for channel in summary.channels.values()] == [stream.name for stream in STREAMS]
    text = summary.schemas[1].data.decode()
    assert "float64 fz_n  # fz_N [N] force along the sensor's z\n" in text
    assert names == [*METADATA, "summary"]


def test_times_before_zero_are_kept_in_the_row(tmp_path: Path) -> None:
    sample = force(0)._replace(capture_ns=-5, arrival_ns=-3)
    writer = RecordingWriter(tmp_path / "a.mcap", {})
    writer.add(FORCE.id, FORCE.pack(sample))
    writer.finish({})
    assert read_recording(tmp_path / "a.mcap").tables["force"][0].item() == sample


def test_an_existing_recording_is_never_overwritten(write_recording: WriteRecording) -> None:
    path = write_recording(rows=10)
    before = path.read_bytes()
    with pytest.raises(UsageError, match="exists already"):
        RecordingWriter(path, {})
    assert path.read_bytes() == before


def test_a_missing_folder_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(RecordingFailed, match="cannot be created: No such file or directory"):
        RecordingWriter(tmp_path / "none" / "a.mcap", {})


@contextmanager
def disk_of(size: int) -> Iterator[None]:
    """No file of this process can grow beyond ``size`` bytes (Python ignores SIGXFSZ, so writes fail with EFBIG)."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("size", [8_000, 20_000, 31_000])
def test_a_full_disk_keeps_every_whole_batch_and_says_so(tmp_path: Path, size: int) -> None:
    path = tmp_path / "a.mcap"
    flushed = 0
    with disk_of(size), pytest.raises(RecordingFailed, match=r"the disk took no more after \d+ bytes: File too large"):
        writer = RecordingWriter(path, METADATA)
        for start in range(0, 10_000, 50):
            for seq in range(start, start + 50):
                writer.add(FORCE.id, FORCE.pack(force(seq)))
            writer.flush()
            flushed = start + 50
    recording = read_recording(path)
    assert [row.item() for row in recording.tables["force"]] == [force(seq) for seq in range(flushed)]
    assert flushed > 0
    assert (recording.complete, recording.damage) == (False, ())
    assert recording.metadata == METADATA


def test_after_a_full_disk_every_call_repeats_the_cause(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "a.mcap", {})
    with disk_of(6_000):
        for seq in range(200):
            writer.add(FORCE.id, FORCE.pack(force(seq)))
        with pytest.raises(RecordingFailed, match="File too large"):
            writer.flush(sync=True)
    with pytest.raises(RecordingFailed, match="File too large"):
        writer.flush()
    with pytest.raises(RecordingFailed, match="File too large"):
        writer.finish({})
    writer.close()


@pytest.mark.parametrize("taken", [shutil.rmtree, lambda folder: folder.rename(folder.with_name("elsewhere"))])
def test_a_recording_whose_folder_is_taken_away_ends_with_one_sentence(
    tmp_path: Path, taken: Callable[[Path], object]
) -> None:
    for finish in (False, True):
        (tmp_path / "session").mkdir()
        writer = RecordingWriter(tmp_path / "session" / "a.mcap", {})
        writer.add(FORCE.id, FORCE.pack(force(0)))
        writer.flush()
        taken(tmp_path / "session")
        with pytest.raises(RecordingFailed, match="was removed or moved while it was recorded"):
            writer.finish({}) if finish else writer.flush()
        with pytest.raises(RecordingFailed, match="was removed or moved while it was recorded"):
            writer.flush()
        writer.close()
        shutil.rmtree(tmp_path / "elsewhere", ignore_errors=True)


def test_the_stock_reader_finds_every_row_by_the_index(write_recording: WriteRecording) -> None:
    path = write_recording(rows=1000)
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        counts = summary.statistics.channel_message_counts
        assert [counts[FORCE.id], counts[AXIS.id], counts[EVENT.id]] == [1000, 1000, 10]
        assert summary.statistics.chunk_count == len(summary.chunk_indexes) == 10
        later = [message for _, _, message in reader.iter_messages(["force"], starting_at=1_500_700_000)]
    assert [message.sequence for message in later[:2]] == [500, 501]
    assert len(later) == 500
    assert [message.log_time for message in later] == sorted(message.log_time for message in later)


def test_every_group_of_the_summary_is_where_its_offset_says(write_recording: WriteRecording) -> None:
    data = write_recording(rows=200).read_bytes()
    with io.BytesIO(data) as file:
        records = [item for item in StreamReader(file).records if isinstance(item, SummaryOffset | Footer)]
    *offsets, footer = records
    assert isinstance(footer, Footer)
    end = footer.summary_start
    for offset in offsets:
        assert isinstance(offset, SummaryOffset)
        assert (data[offset.group_start], offset.group_start) == (offset.group_opcode, end)
        end += offset.group_length
    assert end == footer.summary_offset_start


def test_chunks_take_less_room_than_by_the_library_s_own_level_of_that_speed() -> None:
    """A second of an axis that moves and of a force with noise in the last digits of its converter."""
    rows, noise = np.zeros(1000, AXIS.dtype), np.random.default_rng(1)
    rows["seq"] = np.arange(1000)
    rows["capture_ns"] = rows["seq"] * 1_000_000 + noise.integers(0, 20_000, 1000)
    rows["arrival_ns"] = rows["capture_ns"] + 900_000 + noise.integers(0, 20_000, 1000)
    rows["position_mm"] = np.round(5.0 * np.sin(rows["seq"] / 200), 3)
    rows["velocity_mm_s"] = np.round(25.0 * np.cos(rows["seq"] / 200), 1)
    rows["current_A"] = noise.integers(-20, 20, 1000) / 1000
    rows["status"], rows["valid"] = 0x1237, 1
    messages = bytes(_of_rows(1, rows, 0).data)
    ours = zstandard.ZstdCompressor(compression_params=COMPRESSION).compress(messages)
    assert zstandard.frame_content_size(ours) == len(messages)
    assert len(ours) < 0.95 * len(zstandard.ZstdCompressor(level=-2).compress(messages))
