"""A saved result reads back as it was, says null where a number is unknown, and is refused where it is none."""

import json
import math
from pathlib import Path

import pytest

from mock_devices.testing.made.synthetic import Bench
from rig.diagnosis.estimates import SmallestSize
from rig.errors import UsageError
from rig.results.base import Number, Result
from rig.results.diagnosis import DiagnosisResult
from rig.results.fit import FitResult
from rig.results.study import fit_result
from rig.results.tracking import Followed, LoopCount, TrackResult, compare_runs
from rig.tissue.study import study_curves
from rig.trials.curves import loading_curve

OLD_DIAGNOSIS = {
    "verdict": "unexplained", "statement": "A residual is left.", "simulation": "index", "session": "first",
    "recordings": 6, "unexplained": {"depends_on": ["velocity"], "p_value": None}, "not_testable": {},
    "findings": [{
        "effects": ["friction"], "statement": "it sticks", "confidence": 0.2, "provisional": True, "repair": "clean it",
        "parameters": {"friction_N": {"value": 0.1, "low": 0.09, "high": 0.11}}, "evidence_nats": 12.0, "p_value": 0.01,
        "gain": {"rmse_before_N": 0.04, "rmse_after_N": 0.02, "reduction": 0.5, "low": 0.4, "high": 0.6},
    }],
    "detectable": {"backlash": {"minimum": 0.02, "unit": "mm"}},
    "next_experiment": {"do": "record again", "separates": [], "nats_per_minute": None},
    "data_quality": [{"recording": "", "stream": "force", "kind": "gap", "text": "1 gap", "recordings": 1}],
    "parameters": {}, "simulation_error": [],
}  # fmt: skip


class Measured(Result):
    value_N: Number


@pytest.mark.parametrize("unknown", [math.nan, math.inf, None])
def test_what_nobody_knows_is_null(unknown: float | None) -> None:
    assert json.loads(Measured(value_N=unknown).model_dump_json()) == {"value_N": None}


def test_a_fit_reads_back_with_its_laws_in_their_order(tmp_path: Path) -> None:
    curves = [loading_curve(cycle) for cycle in Bench(rate_Hz=500.0).cycles(trials=1, speeds_mm_s=(5.0, 20.0))]
    saved = fit_result(study_curves("made", curves), "model.json", "index", {"a_N_mm": 0.1}, {"trial_500": "ab"})
    saved.write(tmp_path / "fit.json")
    read = FitResult.read(tmp_path / "fit.json")
    assert read == saved
    assert list(read.laws) == ["constant", "index"]
    assert read.laws["index"].rows[-1].force_N == pytest.approx(read.force_N[-1])


def test_a_diagnosis_of_an_earlier_version_is_still_read(tmp_path: Path) -> None:
    (tmp_path / "diagnosis.json").write_text(json.dumps(OLD_DIAGNOSIS))
    read = DiagnosisResult.read(tmp_path / "diagnosis.json")
    assert read.findings[0].parameters["friction_N"].high == 0.11
    assert read.detectable["backlash"] == SmallestSize(0.02, "mm", found=0, trials=0)
    written = json.loads(read.model_dump_json())
    completed = ("findings", "next_experiment", "detectable")
    assert {key: written[key] for key in OLD_DIAGNOSIS if key not in completed} == {
        key: value for key, value in OLD_DIAGNOSIS.items() if key not in completed
    }


@pytest.mark.parametrize(
    ("content", "says"),
    [("{", "the file: Invalid JSON"), ("[]", "the file: Input should be an object"), ('{"session": 1}', "session: ")],
)
def test_another_file_is_refused_with_the_place(tmp_path: Path, content: str, says: str) -> None:
    (tmp_path / "fit.json").write_text(content)
    with pytest.raises(UsageError, match=f"fit.json: holds no FitResult: {says}"):
        FitResult.read(tmp_path / "fit.json")


@pytest.mark.parametrize("content", ['{"version": 2}', '{"version": 2, "session": 1, "laws": []}'])
def test_a_file_of_a_newer_version_is_refused_in_one_sentence(tmp_path: Path, content: str) -> None:
    (tmp_path / "fit.json").write_text(content)
    with pytest.raises(UsageError, match=r"fit.json: format version 2 is newer than 1, .*; update tissue-rig$"):
        FitResult.read(tmp_path / "fit.json")


def test_every_file_states_the_version_that_is_checked(tmp_path: Path) -> None:
    run_with("model.json", 0.4).write(tmp_path / "track.json")
    stated = json.loads((tmp_path / "track.json").read_text())
    assert stated["version"] == 1
    del stated["version"]
    (tmp_path / "track.json").write_text(json.dumps(stated))
    assert TrackResult.read(tmp_path / "track.json") == run_with("model.json", 0.4)


def run_with(model: str, rms_error_N: float) -> TrackResult:
    followed = Followed(rms_error_N=rms_error_N, largest_error_N=1.0, amplitude_ratio=None, lag_s=None)
    return TrackResult(
        recording="track_001.mcap", model=model, max_error_percent=None, rms_error_N=None, levels=(),
        followed=followed, samples=1, dropped=0, loop=LoopCount(cycles=1, missed=0),
    )  # fmt: skip


def test_a_tracked_comparison_keeps_both_runs_and_the_gain(tmp_path: Path) -> None:
    compare_runs(run_with("old.json", 0.4), run_with("new.json", 0.1)).write(tmp_path / "track.json")
    read = TrackResult.read(tmp_path / "track.json")
    assert read.against is not None and (read.model, read.against.model) == ("new.json", "old.json")
    assert read.gain is not None and read.gain.reduction == pytest.approx(0.75)


def test_a_run_saved_when_cycles_were_called_ticks_is_read() -> None:
    assert LoopCount.model_validate({"ticks": 5, "missed": 1}) == LoopCount(cycles=5, missed=1)
