"""A session folder: its list of contents, what stands in for it after a crash, what is derived from it."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from rig.channels import FORCE
from rig.errors import DataError, UsageError
from rig.recording.sessions import SESSION_FILE, SessionInfo, TrialInfo, derive, open_session, write_session
from tests.rig.recording.conftest import WriteRecording, event, force

INFO = SessionInfo(
    id="2024-05-01-a",
    kind="capture",
    created="2024-05-01T10:00:00+02:00",
    software="tissue-rig 0.1.0",
    protocol={"speeds_mm_s": [5.0, 10.0]},
    wiring={"force": {"product": "bota-sensone"}},
    subject={"id": "7", "age": 31},
    trials=(
        TrialInfo("one", "one.mcap", 5.0, 8.0, "done", 4.5, {"force": 100}, {}),
        TrialInfo("two", "two.mcap", 10.0, 8.0, "force limit", 12.0, {"force": 100}, {"force": 1}),
    ),
)


@pytest.fixture
def folder(tmp_path: Path, write_recording: WriteRecording) -> Path:
    """A session of two trials."""
    write_recording("one", rows=100)
    write_recording("two", rows=100)
    write_session(tmp_path, INFO)
    return tmp_path


def test_a_session_comes_back_as_it_was_written(folder: Path) -> None:
    session = open_session(folder)
    assert (session.info, session.remarks) == (INFO, ())
    assert session.path("two") == folder / "two.mcap"
    assert len(session.recording("two").tables["force"]) == 100


def test_the_file_is_plain_json_without_nan(folder: Path) -> None:
    write_session(folder, replace(INFO, trials=(replace(INFO.trials[0], peak_force_N=math.nan),)))
    text = (folder / SESSION_FILE).read_text()
    assert "NaN" not in text
    assert json.loads(text)["trials"][0]["peak_force_N"] is None
    assert math.isnan(open_session(folder).trials[0].peak_force_N)


def test_an_unknown_trial_is_answered_by_the_names_there_are(folder: Path) -> None:
    with pytest.raises(UsageError, match="no trial three; there are one, two"):
        open_session(folder).recording("three")


def test_a_recording_that_a_crash_kept_out_of_the_list_is_found(folder: Path, write_recording: WriteRecording) -> None:
    write_recording("three", rows=50, finish=False)
    session = open_session(folder)
    assert [trial.name for trial in session.trials] == ["one", "two", "three"]
    three = session.trial("three")
    assert (three.speed_mm_s, three.depth_mm, three.outcome) == (5.0, 8.0, "recording not finished")
    assert three.samples == {"force": 50, "axis": 50}
    assert session.remarks == ("three.mcap: not listed in session.json, taken from the file itself",)


def test_a_listed_recording_that_is_gone_is_named(folder: Path) -> None:
    (folder / "one.mcap").unlink()
    session = open_session(folder)
    assert [trial.name for trial in session.trials] == ["two"]
    assert session.remarks == ("trial one: its recording one.mcap is missing",)


@pytest.mark.parametrize("content", [None, b"", b'{"id": "x"', b'{"id": 3}', b"\xff\xfe"])
def test_without_a_good_list_the_recordings_stand_in(folder: Path, content: bytes | None) -> None:
    (folder / SESSION_FILE).unlink()
    if content is not None:
        (folder / SESSION_FILE).write_bytes(content)
    session = open_session(folder)
    assert [trial.name for trial in session.trials] == ["one", "two"]
    assert session.info.id == folder.name
    assert session.remarks[0].startswith(SESSION_FILE)


def test_a_recording_that_does_not_open_is_named_and_the_rest_is_used(folder: Path) -> None:
    (folder / "three.mcap").write_text("not a recording")
    session = open_session(folder)
    assert len(session.trials) == 2
    assert session.remarks == (f"{folder / 'three.mcap'}: not a recording (no MCAP file)",)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda _: None, "no such session folder"),
        (lambda path: path.write_text(""), "a file; give the session folder"),
        (lambda path: path.mkdir(), "no session here: neither session.json nor a recording"),
    ],
)
def test_what_is_no_session_is_one_sentence(tmp_path: Path, make: object, sentence: str) -> None:
    assert callable(make)
    make(tmp_path / "s")
    with pytest.raises(DataError, match=sentence):
        open_session(tmp_path / "s")


def test_derived_tables_hold_the_rows_with_units(folder: Path) -> None:
    paths = derive(folder)
    assert sorted(path.name for path in paths) == [
        f"{name}.{stream}.parquet" for name in ("one", "two") for stream in ("axis", "event", "force")
    ]
    table = pq.read_table(folder / "parquet" / "one.force.parquet")
    assert [tuple(row.values()) for row in table.to_pylist()] == [force(seq) for seq in range(100)]
    assert table.schema.field("fz_N").metadata == {b"unit": b"N", b"meaning": b"force along the sensor's z"}
    assert json.loads(table.schema.metadata[b"trial"]) == {"speed_mm_s": "5.0", "depth_mm": "8.0"}
    events = pq.read_table(folder / "parquet" / "one.event.parquet").to_pylist()
    assert [tuple(row.values()) for row in events] == [event(0)]


def test_derived_tables_can_be_rebuilt_one_trial_at_a_time(folder: Path) -> None:
    derive(folder)
    whole = (folder / "parquet" / "one.force.parquet").read_bytes()
    (folder / "parquet" / "one.force.parquet").write_bytes(b"broken")
    assert {path.name for path in derive(folder, ["one"])} == {
        f"one.{name}.parquet" for name in ("force", "axis", "event")
    }
    assert (folder / "parquet" / "one.force.parquet").read_bytes() == whole
    assert not list((folder / "parquet").glob(".*"))
    assert pq.read_schema(folder / "parquet" / "two.force.parquet").names == list(FORCE.kinds)
