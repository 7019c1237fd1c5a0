"""The trials of a session: which of them there are, and on what clock."""

from pathlib import Path

import numpy as np

from rig.recording.sessions import open_session
from rig.trials.reading import trials_of
from tests.rig.tissue.synthetic import Bench, metadata, tables, write_made_session, write_recording

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
    first, second = trials_of(open_session(folder)).trials
    assert (first.name, second.name) == (cycle.name, "trial_002")
    since_ns = tables(cycle)["force"]["capture_ns"] - tables(cycle)["force"]["capture_ns"][0]
    for trial, start_ns in ((first, 0), (second, LATER_NS)):
        np.testing.assert_array_equal(trial.force_s, (since_ns + start_ns) * 1e-9)
        np.testing.assert_array_equal(trial.axis_s, trial.force_s)
