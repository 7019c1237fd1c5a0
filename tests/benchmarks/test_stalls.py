"""What counts as a capture that was stopped by mistake, and that the benchmark ends with 1 for it."""

import json
import random
from pathlib import Path

import pytest

from benchmarks import stalls
from benchmarks.stalls import Capture, main, stopped_for
from mock_devices.testing.made.synthetic import Bench, metadata
from rig.channels import EVENT, EventSample
from rig.recording.mcap_file import RecordingWriter


@pytest.mark.parametrize(
    ("exit_code", "stopped", "mistaken"),
    [(0, "", False), (3, "axis_frozen", True), (3, "axis_scale", True), (3, "force_limit", False), (2, "", True)],
)
def test_only_a_force_limit_may_stop_a_capture(exit_code: int, stopped: str, mistaken: bool) -> None:
    assert Capture(exit_code, 9, stopped, "").mistaken is mistaken


@pytest.mark.parametrize(("stopped", "code"), [("", 0), ("axis_frozen", 1)])
def test_one_capture_stopped_by_mistake_ends_it_with_1(
    stopped: str, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    made = iter([Capture(0, 9, "", "done"), Capture(3 if stopped else 0, 5, stopped, "rig: stopped")])

    def captured(_draw: random.Random) -> Capture:
        return next(made)

    monkeypatch.setattr(stalls, "captured", captured)
    assert main(["--captures", "2", "--json", str(tmp_path / "stalls.json")]) == code
    said = capsys.readouterr().out.splitlines()
    assert json.loads(said[-1])["ok"] is (code == 0)
    assert json.loads((tmp_path / "stalls.json").read_text()) == json.loads(said[-1])
    assert "| 0 | 9 | nothing | done |" in said


def test_what_stopped_a_capture_is_read_from_its_last_recording(tmp_path: Path) -> None:
    assert stopped_for(tmp_path) == ""
    for number, code in enumerate(("axis_scale", "axis_frozen")):
        writer = RecordingWriter(tmp_path / f"trial_{number:03}.mcap", metadata(Bench().cycle(10.0, 1)))
        for seq, text in enumerate(("program_start", code, "program_end")):
            writer.add(EVENT.id, EVENT.pack(EventSample(seq, seq + 1, seq + 1, 3, text, "said")))
        writer.finish({"outcome": code})
    assert stopped_for(tmp_path) == "axis_frozen"
