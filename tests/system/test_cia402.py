"""A drive that is known by its data sheet alone does the job of a bench: one line of configuration changes."""

import json
import re
from pathlib import Path

import pytest

from mock_devices.testing.commands import ServedBench, rig
from rig.recording.reader import read_recording

pytestmark = [pytest.mark.extra, pytest.mark.xdist_group("commands")]
DRIVE = ("axis.product=cia402",)
SCALE = "1000 units a mm by its unit of position (object 60A8)"


@pytest.fixture
def settings(bench: ServedBench) -> list[str]:
    return bench.settings(*DRIVE, f"axis.port={bench.endpoints.devices['axis_cia402']['slcan']}")


def test_doctor_names_the_drive_and_a_capture_indents_with_it(settings: list[str], tmp_path: Path) -> None:
    seen = rig("doctor", *settings, "--json", "seen.json", folder=tmp_path)
    assert seen.code == 0, seen.sentence
    [axis] = [
        device for device in json.loads((tmp_path / "seen.json").read_text())["devices"] if device["role"] == "axis"
    ]
    assert (axis["product"], axis["serial"]) == ("Neutral drive 00000402", "00C1A402")
    assert axis["settings"]["scale"] == SCALE
    # SYNC and its two answers each millisecond are some 300 of its 1000 bits, as far as the doctor keeps that up.
    assert re.fullmatch(r"CAN 1000 kbit/s, load [1-9]\d?%, 0 error frames, .*, error active", axis["bus"])
    (tmp_path / "one.toml").write_text("speeds_mm_s = [10]\ntrials = 1\ndepth_mm = 6\n")
    captured = rig("capture", "one.toml", "--out", "session", *settings, folder=tmp_path)
    assert captured.code in (0, 4), captured.sentence
    recording = read_recording(tmp_path / "session" / "trial_001.mcap")
    recorded = json.loads(recording.metadata["devices"]["axis"])
    assert (recorded["product"], recorded["settings"]["scale"]) == ("Neutral drive 00000402", SCALE)
    assert float(recording.metadata["summary"]["peak_force_N"]) > 1.5
