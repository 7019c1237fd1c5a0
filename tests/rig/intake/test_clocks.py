"""Two clocks in one experiment: brought onto one with an interval that holds the truth, or kept apart."""

from pathlib import Path

import numpy as np
import pytest

from mock_devices.testing.made.two_clocks import SENSORS, TISSUES, Seen, pressed, tracked
from rig.config.table import parse
from rig.errors import UsageError
from rig.intake.lag import ClocksApart, Lag, TimedSignal, lag_of_force, lag_of_motion
from rig.intake.mapping import DataMapping
from rig.intake.session import import_folder
from rig.recording.alignment import read_alignments
from rig.recording.sessions import Session
from tests.rig.recording.measured import NOW, write

FORCE_TABLE = {
    "files": "{name}_cell.csv", "clock": "own", "time": {"column": "t", "unit": "s"},
    "columns": {"force": {"column": "F", "unit": "N"}},
}  # fmt: skip
AXIS_TABLE = {
    "files": "{name}_axis.csv", "time": {"column": "t", "unit": "s"},
    "columns": {"position": {"column": "x", "unit": "mm"}},
}  # fmt: skip
BOTA = SENSORS["bota"]


def holds(lag: Lag, seen: Seen) -> bool:
    """Whether the interval holds the truth in its middle, at both ends, and in the drift."""
    missed_s = seen.missed_s(lag)
    inside = missed_s[0] <= lag.within_s and missed_s.max() <= lag.anywhere_s
    return bool(inside) and abs(lag.drift - seen.drift) <= lag.drift_within


def test_a_force_is_found_behind_its_motion_whatever_the_tissue() -> None:
    runs = [pressed(tissue, BOTA, seed, preload=bool(seed % 2)) for seed, tissue in enumerate(TISSUES)]
    lags = [lag_of_force(seen.follower, seen.motion) for seen in runs]
    assert all(map(holds, lags, runs))
    assert np.median([lag.within_s for lag in lags]) < 0.01


def test_another_measure_of_the_motion_is_found_in_any_sense_and_scale() -> None:
    runs = [tracked(seed) for seed in range(3)]
    assert all(holds(lag_of_motion(seen.follower, seen.motion), seen) for seen in runs)


def test_a_clock_moved_by_a_twentieth_of_a_second_is_found_so_much_further() -> None:
    seen = pressed("viscous", BOTA, 3)
    before = lag_of_force(seen.follower, seen.motion)
    later = lag_of_force(seen.follower._replace(time_s=seen.follower.time_s + 0.05), seen.motion)
    assert before.offset_s - later.offset_s == pytest.approx(0.05, abs=2e-4)


def test_a_drift_shows_over_ten_minutes() -> None:
    time_s = np.arange(0, 600, 0.02)
    place = np.cumsum(np.random.default_rng(4).standard_normal(60))
    motion = TimedSignal(time_s, np.interp(time_s, np.arange(60) * 10.0, place))
    lag = lag_of_motion(TimedSignal(time_s * (1 + 70e-6) - 2.0, -3.0 * motion.value), motion)
    assert lag.drift == pytest.approx(-70e-6, abs=lag.drift_within)
    assert lag.drift_within < 5e-6


def test_a_motion_that_repeats_does_not_say_which_cycle_it_is() -> None:
    time_s = np.arange(0, 20, 0.005)
    swing = TimedSignal(time_s, np.sin(2 * np.pi * time_s))
    with pytest.raises(ClocksApart, match=r"the motion repeats: 0\.5 s further on"):
        lag_of_motion(swing, swing)


def test_noise_goes_with_no_motion() -> None:
    seen = pressed("elastic", BOTA, 1)
    noise = np.random.default_rng(0).standard_normal(len(seen.follower.value))
    with pytest.raises(ClocksApart, match="its rate does not go with the motion"):
        lag_of_force(seen.follower._replace(value=noise), seen.motion)


def csv(signal: TimedSignal, header: str) -> str:
    return "\n".join([header, *(f"{at_s:.7f},{value:.6f}" for at_s, value in zip(*signal, strict=True))]) + "\n"


@pytest.fixture(name="seen")
def _seen() -> Seen:
    return pressed("viscous", SENSORS["ft300"], 3)


def imported(folder: Path, seen: Seen, **form: object) -> Session:
    files = {"one_cell.csv": csv(seen.follower, "t,F"), "one_axis.csv": csv(seen.motion, "t,x")}
    tree = {"recording": "{name}", "tables": [AXIS_TABLE, FORCE_TABLE | form]}
    return import_folder(write(folder / "in", files), parse(DataMapping, tree, "made"), folder / "out", NOW)


def test_a_recording_says_how_its_clocks_were_brought_together(seen: Seen, tmp_path: Path) -> None:
    session = imported(tmp_path, seen, clock_within_ms=50.0)
    recording = session.recording("one")
    alignment = read_alignments(recording.metadata)["force"]
    assert (alignment.by, set(read_alignments(recording.metadata))) == ("events", {"force"})
    true_s = seen.offset_s + seen.drift * alignment.at_s
    assert alignment.offset_s == pytest.approx(true_s, abs=alignment.within_s)
    at_s = recording.tables["force"]["capture_ns"] * 1e-9
    own_s = seen.follower.time_s
    assert at_s - own_s == pytest.approx(
        alignment.offset_s + 1e-6 * alignment.drift_ppm * (own_s - alignment.at_s), abs=1e-6
    )
    assert session.remarks[0].startswith("one: force was moved by ")
    assert "a lag of force below that cannot be told from tissue" in session.remarks[0]


def test_clocks_that_stay_open_are_recordings_of_their_own(seen: Seen, tmp_path: Path) -> None:
    session = imported(tmp_path, seen, clock_within_ms=0.1)
    assert [sorted(trial.samples) for trial in session.trials] == [["axis"], ["force"]]
    assert [trial.name for trial in session.trials] == ["one", "one-force"]
    (apart, *_) = session.remarks
    assert "force of one_cell.csv has a clock of its own and is kept apart: the events leave its offset open" in apart
    assert "and 0.1 ms are wanted; if that is enough, state clock_within_ms = " in apart
    assert "alignment" not in session.recording("one").metadata


def test_one_clock_has_to_be_that_of_the_others(seen: Seen, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="every table of its recording has a clock of its own; one must be without"):
        tree = {"recording": "{name}", "tables": [FORCE_TABLE]}
        folder = write(tmp_path / "in", {"one_cell.csv": csv(seen.follower, "t,F")})
        import_folder(folder, parse(DataMapping, tree, "made"), tmp_path / "out", NOW)
