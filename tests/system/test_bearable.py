"""A protocol of 12 N on a subject who bears four: compressions end before the threshold, and nothing is stopped."""

from pathlib import Path

import pytest

from mock_devices.testing.commands import ServedBench, rig
from rig.recording.sessions import open_session

pytestmark = [pytest.mark.bench, pytest.mark.xdist_group("commands")]
THRESHOLD_N = 4.0


def test_compressions_end_before_the_threshold_up_to_30_mm_s(bench: ServedBench, tmp_path: Path) -> None:
    (tmp_path / "two.toml").write_text(
        "speeds_mm_s = [5, 30]\ntrials = 1\ndepth_mm = 8\napproach_speed_mm_s = 15\nhold_s = 0.2\n"
        "retract_speed_mm_s = 20\nclearance_mm = 4\nforce_limit_N = 12\n"
    )
    settings = bench.settings(f"subject.pain_threshold_N={THRESHOLD_N}")
    said = rig("capture", "two.toml", "--out", "session", *settings, folder=tmp_path)
    assert said.code in (0, 4), said.err
    assert "each compression ends at 3.2 N" in said.out + said.err
    trials = open_session(tmp_path / "session").trials
    assert {trial.outcome for trial in trials} == {"force limit"}
    assert all(0.75 * THRESHOLD_N < trial.peak_force_N < THRESHOLD_N for trial in trials)
