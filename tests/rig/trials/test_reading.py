"""The trials of a session: which of them there are, and on what clock."""

from pathlib import Path

import numpy as np
import pytest

from mock_devices.testing.made.synthetic import Bench, metadata, tables, write_made_session, write_recording
from rig.recording.sessions import open_session
from rig.trials.reading import trials_of
from rig.trials.trial import TrialSet
from tests.rig.recording.measured import pressed, run

LATER_NS = 3_600_000_000_017


def test_trials_lie_on_the_clock_of_the_first_to_the_nanosecond_and_runs_of_force_are_none(tmp_path: Path) -> None:
    cycle = Bench().cycle(10.0, 1)
    folder = write_made_session(tmp_path / "session", [cycle])
    for name, about in (("trial_002", {}), ("track_001", {"trial": {"kind": "tracking", "speed_mm_s": "none"}})):
        streams = tables(cycle)
        for table in streams.values():
            table["capture_ns"] += LATER_NS
            table["arrival_ns"] += LATER_NS
        write_recording(folder / f"{name}.mcap", streams, metadata(cycle) | about)
    found = trials_of(open_session(folder))
    first, second = found.trials
    assert found.one_clock
    assert (first.name, second.name) == (cycle.name, "trial_002")
    since_ns = tables(cycle)["force"]["capture_ns"] - tables(cycle)["force"]["capture_ns"][0]
    for trial, start_ns in ((first, 0), (second, LATER_NS)):
        np.testing.assert_array_equal(trial.force_s, (since_ns + start_ns) * 1e-9)
        np.testing.assert_array_equal(trial.axis_s, trial.force_s)


CYCLES = [Bench(rate_Hz=100.0).cycle(speed, seed) for seed, speed in enumerate((5.0, 10.0, 20.0))]
STATED = """
stated = { surface_mm = 20.0, depth_mm = 8.0, temperature_C = 21.5 }
recordings = { trial_0 = { speed_mm_s = 5, temperature_C = 30 }, trial_1 = { speed_mm_s = 10 } }
session = { operator = "A. B." }
"""


def foreign(folder: Path, stated: str) -> TrialSet:
    return trials_of(run(pressed(folder / "in", CYCLES, stated)))


def test_what_is_stated_of_a_recording_reaches_its_trial(tmp_path: Path) -> None:
    found = foreign(tmp_path, STATED)
    assert [trial.speed_mm_s for trial in found.trials] == pytest.approx([5.0, 10.0, np.nan], nan_ok=True)
    assert {(trial.depth_mm, trial.surface_mm, trial.labels["operator"]) for trial in found.trials} == {
        (8.0, 20.0, "A. B.")
    }
    temperatures = [trial.temperature_C for trial in found.trials]
    assert [None if one is None else set(one) for one in temperatures] == [{30.0}, {21.5}, {21.5}]
    assert found.surface_mm == 20.0
    assert {finding.stream for finding in found.findings} == {"session"}


def test_a_temperature_that_is_stated_of_all_is_that_of_each(tmp_path: Path) -> None:
    found = foreign(tmp_path, "session = { temperature_C = 22.0 }")
    assert all(trial.temperature_C is not None and set(trial.temperature_C) == {22.0} for trial in found.trials)


def test_recordings_that_each_count_their_own_time_are_laid_one_after_the_other(tmp_path: Path) -> None:
    session = foreign(tmp_path, "")
    found = session.trials
    assert not session.one_clock
    ends = [trial.force_s[-1] for trial in found]
    assert [trial.force_s[0] for trial in found] == pytest.approx([0.0, ends[0] + 1.0, ends[1] + 1.0])
    assert found[1].force_s - found[1].force_s[0] == pytest.approx(CYCLES[1].time_s, abs=1e-6)


def test_statements_that_are_not_the_motions_are_said_and_not_used(tmp_path: Path) -> None:
    wrong = "stated = { surface_mm = 20.0 }\nrecordings.trial_1 = { speed_mm_s = 100, surface_mm = 200 }"
    found = foreign(tmp_path, wrong)
    assert [(one.recording, one.kind) for one in found.findings if one.recording] == [
        ("trial_1", "speed"), ("trial_1", "surface")
    ]  # fmt: skip
    assert found.surface_mm is None
    (mixed,) = [one for one in found.findings if one.kind == "surface" and not one.recording]
    assert "stated of some recordings only" in mixed.text


def test_a_recording_whose_position_is_in_another_unit_is_left_out(tmp_path: Path) -> None:
    found = foreign(tmp_path, "recordings.trial_1 = { speed_mm_s = 10000, depth_mm = 8000 }")
    assert [trial.name for trial in found.trials] == ["trial_0", "trial_2"]
    (bad,) = [one for one in found.findings if one.recording]
    assert bad.kind == "quality_bad"
    assert bad.text.startswith("quality bad, left out: stated speed 1e+04 mm/s, but the tip loads at 10 mm/s")
    assert "speed and depth are both off by a factor of about 1e+03" in bad.text


def test_several_specimens_are_said(tmp_path: Path) -> None:
    found = foreign(tmp_path, 'specimen = "{recording}"')
    (said,) = [one for one in found.findings if one.kind == "specimen"]
    assert said.text.startswith("3 specimens (trial_0, trial_1, trial_2) are taken as one")
