"""`rig verify` and `rig repair`: what a recording proves, and what can be saved of one that is broken."""

from pathlib import Path

import pytest

from rig.channels import AXIS, EVENT, FORCE
from rig.errors import DataError, UsageError
from rig.recording.mcap_file import RecordingFailed, RecordingWriter
from rig.recording.reader import read_recording
from rig.recording.verify import Verdict, repair, verify
from tests.rig.recording.conftest import METADATA, WriteRecording, axis, event, force
from tests.rig.recording.test_mcap_file import disk_of
from tests.rig.recording.test_reader import batch_ends


def write(path: Path, seqs: list[int], summary: dict[str, str] | None = None) -> Verdict:
    writer = RecordingWriter(path, {})
    for seq in seqs:
        writer.add(FORCE.id, FORCE.pack(force(seq)))
    writer.finish(summary or {})
    return verify(path)


def test_a_whole_recording_is_complete(write_recording: WriteRecording) -> None:
    verdict = verify(write_recording(rows=1000))
    assert (verdict.ok, verdict.state, verdict.sentence) == (True, "complete", "indent-1.mcap: complete")
    stream = verdict.streams["force"]
    assert (stream.samples, stream.first_seq, stream.last_seq, stream.faults) == (1000, 0, 999, {})
    assert stream.rate_Hz == pytest.approx(1000.0)
    assert verdict.streams["event"].rate_Hz == pytest.approx(10.0)


def test_an_absent_stream_has_no_rate_and_no_fault(write_recording: WriteRecording) -> None:
    stream = verify(write_recording(rows=10)).streams["marker"]
    assert (stream.samples, stream.first_seq, stream.faults) == (0, -1, {})
    assert stream.rate_Hz is None


def test_a_gap_in_the_numbers_is_missing(write_recording: WriteRecording) -> None:
    verdict = verify(write_recording(rows=100, skip=(0, 10, 11, 50)))
    assert not verdict.ok
    assert verdict.streams["force"].missing == 3
    assert verdict.sentence == "indent-1.mcap: complete; force: 3 missing"


def test_a_number_used_twice_is_a_duplicate(tmp_path: Path) -> None:
    stream = write(tmp_path / "a.mcap", [0, 1, 1, 2]).streams["force"]
    assert (stream.samples, stream.duplicates, stream.missing) == (4, 1, 0)


def test_a_step_back_in_time_is_out_of_order(tmp_path: Path) -> None:
    stream = write(tmp_path / "a.mcap", [0, 2, 1, 3]).streams["force"]
    assert stream.faults == {"out of order": 1}


def test_drops_are_told_by_the_recorder(tmp_path: Path) -> None:
    verdict = write(tmp_path / "a.mcap", [0, 3], {"samples": '{"force": 2}', "dropped": '{"force": 2}'})
    assert verdict.streams["force"].faults == {"missing": 2, "dropped": 2}


@pytest.mark.parametrize("text", ["", "nonsense", "[]", "7"])
def test_a_summary_without_counts_claims_nothing(tmp_path: Path, text: str) -> None:
    assert write(tmp_path / "a.mcap", [0, 1], {"samples": text, "dropped": text}).ok


def test_a_lost_chunk_shows_against_the_recorders_own_count(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = RecordingWriter(path, {})
    for seq in range(400):
        writer.add(FORCE.id, FORCE.pack(force(seq)))
        if seq % 100 == 99:
            writer.flush()
    writer.finish({"samples": '{"force": 400}'})
    data = bytearray(path.read_bytes())
    end = batch_ends(bytes(data))[3]
    data[end - 500 : end - 400] = bytes(100)
    path.write_bytes(data)
    verdict = verify(path)
    assert verdict.state == "damaged"
    assert verdict.streams["force"].lost == 100
    assert verdict.streams["force"].missing == 0
    assert "left out; all other samples are good; force: 100 lost; `rig repair`" in verdict.sentence


def test_an_unfinished_recording_is_incomplete(write_recording: WriteRecording) -> None:
    verdict = verify(write_recording(rows=500, finish=False))
    assert (verdict.state, verdict.ok) == ("incomplete", False)
    assert "every sample before that is good" in verdict.sentence
    assert verdict.streams["force"].samples == 500


def test_a_file_that_is_no_recording_has_no_verdict(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_text("hello")
    with pytest.raises(DataError, match="not a recording"):
        verify(tmp_path / "a.mcap")


def test_repair_of_a_cut_recording_keeps_everything_before_the_cut(
    write_recording: WriteRecording, tmp_path: Path
) -> None:
    path = write_recording(rows=1000)
    path.write_bytes(path.read_bytes()[: batch_ends(path.read_bytes())[6] + 5])
    verdict = repair(path, tmp_path / "good.mcap")
    recording = read_recording(tmp_path / "good.mcap")
    assert (verdict.ok, recording.complete) == (True, True)
    assert verdict.sentence == "good.mcap: complete, as repaired from indent-1.mcap"
    assert [row.item() for row in recording.tables["force"]] == [force(seq) for seq in range(700)]
    assert recording.events == tuple(event(seq) for seq in range(7))
    assert {name: recording.metadata[name] for name in METADATA} == METADATA
    summary = recording.metadata["summary"]
    assert (summary["outcome"], summary["repaired_from"]) == ("recording cut", "indent-1.mcap")


def test_repair_of_a_damaged_recording_keeps_everything_around_the_damage(
    write_recording: WriteRecording, tmp_path: Path
) -> None:
    path = write_recording(rows=1000)
    data = bytearray(path.read_bytes())
    at = batch_ends(bytes(data))[5] - 500
    data[at : at + 50] = bytes(50)
    path.write_bytes(data)
    before = read_recording(path)
    verdict = repair(path, tmp_path / "good.mcap")
    after = read_recording(tmp_path / "good.mcap")
    assert verdict.state == "complete"
    assert verdict.streams["force"].missing == 100
    for name, table in before.tables.items():
        assert (after.tables[name] == table).all()
    assert after.metadata["summary"]["outcome"] == "done"
    assert before.damage[0] in after.metadata["summary"]["damage"].replace('\\"', '"')


def test_repair_leaves_the_source_and_an_existing_file_alone(write_recording: WriteRecording, tmp_path: Path) -> None:
    path = write_recording(rows=100, finish=False)
    before = path.read_bytes()
    with pytest.raises(UsageError, match="not overwritten"):
        repair(path, path)
    repair(path, tmp_path / "good.mcap")
    assert path.read_bytes() == before


def test_a_repair_without_room_leaves_nothing_half_written(write_recording: WriteRecording, tmp_path: Path) -> None:
    path = write_recording(rows=1000, finish=False)
    with disk_of(20_000), pytest.raises(RecordingFailed):
        repair(path, tmp_path / "good.mcap")
    assert sorted(item.name for item in tmp_path.iterdir()) == ["indent-1.mcap"]


def test_repair_keeps_the_order_of_samples_between_streams(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = RecordingWriter(path, {})
    order = [(FORCE.id, FORCE.pack(force(0))), (AXIS.id, AXIS.pack(axis(0))), (EVENT.id, EVENT.pack(event(0)))]
    for stream_id, body in order:
        writer.add(stream_id, body)
    writer.flush()
    writer.close()
    repair(path, tmp_path / "b.mcap")
    repair(tmp_path / "b.mcap", tmp_path / "c.mcap")
    size = batch_ends(path.read_bytes())[0]
    chunk = path.read_bytes()[path.read_bytes().index(b"\x04\0\0\0zstd") : size]
    assert chunk in (tmp_path / "b.mcap").read_bytes()
    assert chunk in (tmp_path / "c.mcap").read_bytes()
