"""Swapped, copied and edited files of a session, each planted."""

from collections.abc import Callable
from pathlib import Path

import pytest

from rig.recording.sessions import SessionInfo, TrialInfo, open_session, write_session
from tests.rig.recording import tampered
from tests.rig.recording.conftest import WriteRecording

NAMES = ("one", "two")


@pytest.fixture
def folder(tmp_path: Path, write_recording: WriteRecording) -> Path:
    """A sealed session of two trials with different content."""
    trials = []
    for rows, name in zip((100, 200), NAMES, strict=True):
        write_recording(name, rows=rows, about={"session": "bench", "trial": name})
        trials.append(TrialInfo(name, f"{name}.mcap", 5.0, 8.0, "done").sealed(tmp_path))
    write_session(tmp_path, SessionInfo("bench", "capture", "2026-01-02", "tissue-rig", trials=tuple(trials)))
    return tmp_path


def test_an_untouched_session_has_nothing_to_say(folder: Path) -> None:
    assert open_session(folder).mismatches == ()


@pytest.mark.parametrize(
    ("plant", "sentences"),
    [
        (
            tampered.swap,
            ["one.mcap: was recorded as two of session bench", "two.mcap: was recorded as one of session bench"],
        ),
        (tampered.copy, ["two.mcap: was recorded as one", "two.mcap: has the content of one"]),
        (tampered.edit_recording, ["one.mcap: was changed after it was closed"]),
        (tampered.edit_list, ["session.json: was changed after the program wrote it"]),
        (tampered.strip_seal, ["session.json: carries no hash of its own"]),
    ],
)
def test_a_touched_session_is_told(folder: Path, plant: Callable[[Path], None], sentences: list[str]) -> None:
    plant(folder)
    found = open_session(folder).mismatches
    for sentence in sentences:
        assert any(said.startswith(sentence) for said in found), found


def test_a_recording_of_another_session_is_told(folder: Path, write_recording: WriteRecording) -> None:
    (folder / "one.mcap").unlink()
    write_recording("one", rows=100, about={"session": "second", "trial": "one"})
    assert "one.mcap: was recorded as one of session second" in " ".join(open_session(folder).mismatches)


def test_one_garbage_file_hides_no_other(folder: Path) -> None:
    (folder / "one.mcap").write_bytes(b"no recording at all")
    assert open_session(folder).mismatches == ()
    assert [trial.name for trial in open_session(folder).trials] == list(NAMES)
