"""One way in: whatever lies there becomes the same trials, and what it is not is one sentence."""

import shutil
import tempfile
from pathlib import Path

import numpy as np
import pytest

from mock_devices.testing.made.synthetic import Bench
from rig.errors import DataError, UsageError
from rig.intake.mapping import MAPPING_FILE
from rig.recording.sessions import Session, open_session
from rig.trials.opening import AS_IT_IS, Opening, import_place, open_place
from rig.trials.reading import trials_of
from tests.rig.recording.measured import NOW, pressed, run, write

CYCLES = [Bench(rate_Hz=100.0).cycle(speed, seed) for seed, speed in enumerate((5.0, 10.0))]


@pytest.fixture
def source(tmp_path: Path) -> Path:
    return pressed(tmp_path / "measured", CYCLES, "stated = { speed_mm_s = 10.0 }")


def opened(place: Path, opening: Opening = AS_IT_IS) -> Session:
    return open_place(place, opening, Path(tempfile.mkdtemp(dir=place.parent)), NOW)


def test_a_folder_its_session_and_a_recording_of_it_give_the_same_trials(source: Path) -> None:
    session = run(source)
    ways = [trials_of(opened(place)) for place in (source, session.folder)]
    for found in ways:
        assert [trial.name for trial in found.trials] == ["trial_0", "trial_1"]
        assert [one.text for one in found.findings if one.recording] == [
            "stated speed 10 mm/s, but the tip loads at 5 mm/s: the motion's is used"
        ]
    for one, other in zip(ways[0].trials, ways[1].trials, strict=True):
        assert one.force_s.tolist() == other.force_s.tolist() and one.force_N.tolist() == other.force_N.tolist()
    alone = opened(session.path("trial_1"))
    assert [trial.name for trial in alone.trials] == ["trial_1"] and alone.remarks == ()
    np.testing.assert_array_equal(trials_of(alone).trials[0].force_N, ways[0].trials[1].force_N)


def test_an_import_lists_the_verdict_on_what_is_stated(source: Path) -> None:
    session = import_place(source, None, source.parent / "out", NOW)
    assert [trial.quality for trial in session.trials] == ["usable", ""]
    assert session.remarks[-1].startswith("trial_0 quality usable: stated speed 10 mm/s, but the tip loads at 5 mm/s")
    assert open_session(source.parent / "out").trials == session.trials


def test_a_mapping_that_is_named_counts_before_the_one_beside_the_files(source: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.toml"
    other.write_text((source / MAPPING_FILE).read_text().replace('"{recording}"', '"b_{recording}"', 1))
    assert [trial.name for trial in opened(source, Opening(other)).trials] == ["b_trial_0", "b_trial_1"]


def test_recordings_are_chosen_by_name(source: Path) -> None:
    found = opened(source, Opening(only="*_1"))
    assert [trial.name for trial in found.trials] == ["trial_1"]
    assert found.remarks[0] == "1 of 2 recordings are taken, those matching '*_1'"
    with pytest.raises(UsageError, match=r"measured: no recording matches --only 'x'; .* like trial_0, trial_1"):
        opened(source, Opening(only="x"))


def test_a_file_without_a_mapping_is_read_by_the_one_proposed(tmp_path: Path) -> None:
    rows = "".join(f"0.{k},{k},{2 * k}\n" for k in range(8))
    source = write(tmp_path / "in", {"a.csv": "time_s,force_N,x_mm\n" + rows, "b.csv": "time_s,Force,x_mm\n" + rows})
    found = opened(source / "a.csv")
    assert [trial.name for trial in found.trials] == ["a"] and found.place == source / "a.csv"
    assert any("positive force as compression" in remark for remark in found.remarks)
    with pytest.raises(UsageError, match=r"b\.csv: give a mapping .*force .'Force', 0 to 7. has no unit; .*unit = "):
        opened(source / "b.csv")


def test_a_session_and_a_recording_are_imported_as_they_are(source: Path, tmp_path: Path) -> None:
    session = run(source)
    whole = import_place(session.folder, None, tmp_path / "whole", NOW)
    assert whole.info == session.info and whole.mismatches == ()
    alone = import_place(session.path("trial_1"), None, tmp_path / "alone", NOW)
    assert [trial.name for trial in alone.trials] == ["trial_1"] and alone.mismatches == ()


def test_what_is_nothing_of_all_is_one_sentence(source: Path, tmp_path: Path) -> None:
    session = run(source)
    with pytest.raises(UsageError, match=r"is a session, which says itself what it holds; leave out --mapping"):
        opened(session.folder, Opening(source / MAPPING_FILE))
    with pytest.raises(DataError, match=r"nowhere: no such file or folder; give a session, a recording, or files with"):
        opened(tmp_path / "nowhere")
    shutil.copy(source / "trial_0" / "force.csv", tmp_path / "no.mcap")
    with pytest.raises(DataError, match=r"no\.mcap"):
        opened(tmp_path / "no.mcap")
