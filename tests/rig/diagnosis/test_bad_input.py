"""Data that say little: the answer says what cannot be tested and why, names nothing by guess, and never fails."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.hidden.draw import draw_secret, recorded, session_of
from mock_devices.testing.made.synthetic import Bench, write_made_session
from rig.diagnosis import search
from rig.diagnosis.answers import Diagnosis
from rig.diagnosis.fit import first_fit, refreshed
from rig.diagnosis.indentation import IndentationProblem, library, missing
from rig.diagnosis.observations import beside_gaps, observe
from rig.diagnosis.run import diagnose_session
from rig.errors import DataError, UsageError
from rig.intake.mapping import MAPPING_FILE
from rig.recording.sessions import open_session, write_session
from rig.results.diagnosis import DiagnosisResult
from rig.tissue.index_law import Fields
from rig.trials.cycles import cut
from rig.trials.opening import Opening
from rig.trials.recorded import in_time
from rig.trials.trial import Trial, TrialSet
from tests.data import recording
from tests.rig.diagnosis.made_tissue import MadeTissue
from tests.rig.fixed_sessions import PERINEAL, read
from tests.rig.recording.measured import TABLES, write


@pytest.fixture(scope="module")
def clean() -> TrialSet:
    bench, cycles = recorded(811, draw_secret(np.random.default_rng(1), "none"), 6)
    return session_of(bench, cycles)


def changed(session: TrialSet, **fields: object) -> TrialSet:
    return replace(session, trials=tuple(replace(trial, **fields) for trial in session.trials))  # type: ignore[arg-type]


def nothing_named(result: Diagnosis, because: str) -> None:
    assert result.findings == ()
    assert result.verdict == "not judged"
    assert DiagnosisResult.model_validate(result).floor_N is None
    assert set(result.not_testable) == {effect.name for effect in library("index")}
    assert result.statement.startswith("Nothing could be judged"), result.statement
    assert because in result.statement, result.statement


@pytest.mark.parametrize("count", [1, 3])
def test_fewer_than_four_strokes_cannot_be_judged(clean: TrialSet, count: int) -> None:
    nothing_named(diagnose_session(replace(clean, trials=clean.trials[:count])), "takes at least 4")


def test_one_long_recording_is_judged_by_its_strokes(clean: TrialSet) -> None:
    result = diagnose_session(replace(clean, trials=(joined(clean.trials),)))
    assert result.verdict == "adequate"
    assert result.recordings == 6
    assert "friction" in result.detectable
    assert any("cut into 6 cycles" in finding.text for finding in result.quality)


def test_recordings_are_cut_where_those_that_can_be_judged_are_few(clean: TrialSet) -> None:
    long = [replace(joined(clean.trials[k : k + 2]), name=f"long {k}") for k in (0, 2, 4)]
    idle = replace(long[0], name="idle", force_N=np.random.default_rng(3).normal(0, 0.005, len(long[0].force_N)))
    assert diagnose_session(replace(clean, trials=(*long, idle))).recordings == 6


def test_strokes_that_never_leave_the_tissue_are_not_cut(clean: TrialSet) -> None:
    pressed = joined(clean.trials)
    inside = replace(pressed, force_N=np.maximum(pressed.force_N, np.quantile(pressed.force_N, 0.8)))
    inside.force_N[:200] = 0.0
    assert len(cut(pressed)) == 6
    assert len(cut(inside)) == 1


def test_what_is_pulled_is_cut_where_it_was_let_go(clean: TrialSet) -> None:
    pressed = joined(clean.trials)
    pulled = replace(pressed, force_N=-pressed.force_N, axis_mm=-pressed.axis_mm)
    assert [part.force_s.tolist() for part in cut(pulled)] == [part.force_s.tolist() for part in cut(pressed)]
    # A strip that was pulled once: where it is longest, it is not let go.
    (whole,) = cut(replace(clean.trials[0], force_N=-clean.trials[0].force_N, axis_mm=-clean.trials[0].axis_mm))
    assert whole.name == clean.trials[0].name


def joined(trials: tuple[Trial, ...]) -> Trial:
    fields = ("force_s", "force_N", "axis_s", "axis_mm", "marker_s", "marker_mm", "temperature_C")
    columns: dict[str, Any] = {name: np.concatenate([getattr(trial, name) for trial in trials]) for name in fields}
    return Trial("long", **columns)


def test_a_wrong_sign_of_force_is_said(clean: TrialSet) -> None:
    turned = tuple(replace(trial, force_N=-trial.force_N) for trial in clean.trials)
    nothing_named(diagnose_session(replace(clean, trials=turned)), "wrong sign")


def test_a_wrong_sign_of_position_is_said(clean: TrialSet) -> None:
    turned = tuple(replace(trial, axis_mm=-trial.axis_mm) for trial in clean.trials)
    nothing_named(diagnose_session(replace(clean, trials=turned)), "wrong sign")


def test_one_recording_of_wrong_sign_is_left_out_and_named(clean: TrialSet) -> None:
    turned = replace(clean.trials[2], force_N=-clean.trials[2].force_N)
    result = diagnose_session(replace(clean, trials=(*clean.trials[:2], turned, *clean.trials[3:])))
    assert (result.verdict, result.recordings) == ("adequate", 5)
    (said,) = [finding for finding in result.quality if finding.kind == "sign"]
    assert said.recording == turned.name
    assert said.text.endswith("turn its sign")


def test_a_recording_in_which_nothing_is_touched_is_left_out_and_named(clean: TrialSet) -> None:
    """Its contact would lie anywhere, and the whole simulation be wrong by what the others press with."""
    last = clean.trials[-1]
    idle = replace(last, force_N=np.random.default_rng(3).normal(0, 0.005, len(last.force_N)))
    result = diagnose_session(replace(clean, trials=(*clean.trials[:-1], idle)))
    assert (result.verdict, result.recordings) == ("adequate", 5)
    (said,) = [finding for finding in result.quality if finding.kind == "no contact"]
    assert (said.recording, said.text) == (last.name, "recording left out: its force does not rise as the tip goes in")


def test_a_recording_that_is_a_copy_of_another_is_left_out_and_named(clean: TrialSet) -> None:
    copies = tuple(replace(clean.trials[0], name=f"copy {number}") for number in range(4))
    result = diagnose_session(replace(clean, trials=copies))
    nothing_named(result, "1 recording of one cycle")
    assert any(finding.text.endswith("it holds the same forces as copy 0") for finding in result.quality)


@pytest.mark.parametrize(
    ("field", "factor", "because"),
    [
        ("force_N", 1000.0, "limits 0.0001 to 100 N/mm"),
        ("axis_mm", 0.001, "limits 0.0001 to 100 N/mm"),
        ("axis_mm", 1000.0, "limit 300 mm"),
    ],
)
def test_what_looks_like_another_unit_is_not_judged(clean: TrialSet, field: str, factor: float, because: str) -> None:
    scaled = tuple(replace(trial, **{field: factor * getattr(trial, field)}) for trial in clean.trials)
    nothing_named(diagnose_session(replace(clean, trials=scaled)), because)


def test_time_in_milliseconds_is_not_judged(clean: TrialSet) -> None:
    slow = tuple(
        replace(trial, force_s=1e3 * trial.force_s, axis_s=1e3 * trial.axis_s, marker_s=None, marker_mm=None)
        for trial in clean.trials
    )
    nothing_named(diagnose_session(replace(clean, trials=slow)), "times a second by its time stamps (limit 2)")


def test_a_force_cut_off_by_the_sensors_range_is_not_judged_there(clean: TrialSet) -> None:
    largest_N = 0.7 * max(float(trial.force_N.max()) for trial in clean.trials)
    cut_off = tuple(replace(trial, force_N=np.minimum(trial.force_N, largest_N)) for trial in clean.trials)
    result = diagnose_session(replace(clean, trials=cut_off))
    assert result.findings == ()
    assert any(finding.kind == "saturation" and "not judged there" in finding.text for finding in result.quality)


def test_a_recording_whose_streams_share_no_time_is_left_out_and_named(clean: TrialSet) -> None:
    away = replace(clean.trials[0], axis_s=clean.trials[0].axis_s + 1000.0)
    result = diagnose_session(replace(clean, trials=(away, *clean.trials[1:])))
    assert result.recordings == 5
    assert any("have no common time" in finding.text for finding in result.quality)


def test_samples_that_hold_no_number_are_counted(clean: TrialSet) -> None:
    first = clean.trials[0]
    force_N = first.force_N.copy()
    force_N[[40, 50]] = np.nan
    result = diagnose_session(replace(clean, trials=(replace(first, force_N=force_N), *clean.trials[1:])))
    (said,) = [finding for finding in result.quality if finding.kind == "number"]
    assert said.text == f"force: 2 of {len(force_N)} samples hold no number, first sample 41; left out"


def test_constant_force_is_no_experiment(clean: TrialSet) -> None:
    flat = tuple(replace(trial, force_N=np.ones_like(trial.force_N)) for trial in clean.trials)
    nothing_named(diagnose_session(replace(clean, trials=flat)), "never changes")


def test_no_recordings_at_all_is_an_answer_too(clean: TrialSet) -> None:
    nothing_named(diagnose_session(replace(clean, trials=())), "no recording")


def test_without_a_tracker_what_needs_one_is_not_testable_and_the_rest_is(clean: TrialSet) -> None:
    result = diagnose_session(changed(clean, marker_s=None, marker_mm=None))
    assert "tip tracker" in result.not_testable["frame_compliance"]
    assert "friction" in result.detectable
    assert result.findings == ()


def test_at_10_Hz_what_is_fast_is_not_testable(clean: TrialSet) -> None:
    slow = tuple(_slowed(trial, 10.0) for trial in clean.trials)
    result = diagnose_session(replace(clean, trials=slow))
    assert {"time_offset", "filter_lag", "tip_inertia"} <= result.not_testable.keys()
    assert result.findings == ()


def plate_of_gels(rough_N: float = 0.0) -> TrialSet:
    """Twenty readings a stroke, as every other one of a probe of gels, the first nine of them in the air; it cracks."""
    steps, rng = np.arange(20, dtype=np.float64), np.random.default_rng(2)
    time_s, axis_mm = 0.2 * steps, 0.6 * steps
    wells = [20 * np.maximum(axis_mm - 5.4 - 0.1 * k, 0) ** 1.5 + rng.normal(0, 0.005, 20) for k in range(5)]
    wells = [force_N + rough_N * (axis_mm > 6.0) * rng.standard_normal(20) for force_N in wells]
    trials = [Trial(f"well {k}", 10 * k + time_s, force_N, 10 * k + time_s, axis_mm) for k, force_N in enumerate(wells)]
    return TrialSet("plate", tuple(trials))


def test_a_model_keeps_its_rows_where_hardly_any_lie_off_the_contact() -> None:
    model = first_fit(IndentationProblem(observe(plate_of_gels())))
    assert np.count_nonzero(refreshed(model).whitener.judged[0]) == np.count_nonzero(model.whitener.judged[0]) == 70
    assert diagnose_session(plate_of_gels()).findings == ()


def test_a_model_keeps_its_rows_where_only_fifteen_in_the_air_would_be_left(monkeypatch: pytest.MonkeyPatch) -> None:
    """These any model fits as well as their noise, which says nothing of tissue."""
    problem = IndentationProblem(observe(plate_of_gels(rough_N=20.0)))
    model = first_fit(problem)
    pressed = problem.data.drive.position_mm > 5.0
    seen = np.zeros_like(pressed)

    def blind(_: IndentationProblem, values: Fields) -> NDArray[np.bool_]:
        return pressed if np.all(np.isfinite(values["surface_mm"])) else seen

    monkeypatch.setattr(IndentationProblem, "blind", blind)
    assert np.count_nonzero(refreshed(model).whitener.judged[0]) == 70


def test_what_nobody_saw_is_judged_by_no_model_that_keeps_its_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    made = MadeTissue().session()
    trials = tuple(replace(trial, force_N=np.minimum(trial.force_N, 1.0)) for trial in made.trials)
    data = observe(TrialSet("clipped", trials))
    assert data.unseen is not None and data.unseen.any()
    monkeypatch.setattr("rig.diagnosis.fit.FEWEST_ROWS", 10**9)
    kept = refreshed(first_fit(IndentationProblem(data))).whitener.blind
    assert kept.tolist() == data.unseen.tolist()


def test_recordings_that_each_count_their_own_time_say_nothing_of_drift(clean: TrialSet) -> None:
    def tested(session: TrialSet) -> set[str]:
        return {effect.name for effect in search.testable(IndentationProblem(observe(session)))}

    assert "zero_drift" in tested(clean)
    apart = replace(clean, one_clock=False)
    assert tested(clean) - tested(apart) == {"zero_drift", "clock_drift"}
    assert "counts its own time" in missing(observe(apart))["session time"]


def test_without_the_way_out_what_needs_it_is_not_testable(clean: TrialSet) -> None:
    way_in = tuple(_cut_before_retraction(trial) for trial in clean.trials)
    result = diagnose_session(replace(clean, trials=way_in))
    assert {"friction", "backlash", "adhesion"} <= result.not_testable.keys()


def test_a_clock_that_runs_backwards_is_said_and_its_samples_left_out(clean: TrialSet) -> None:
    first = clean.trials[0]
    time = first.force_s.copy()
    time[500:520] -= 0.3
    result = diagnose_session(replace(clean, trials=(replace(first, force_s=time), *clean.trials[1:])))
    assert any(finding.kind == "clock" for finding in result.quality)
    assert result.findings == ()


def test_positions_that_came_late_are_of_no_known_time() -> None:
    capture_ns = np.arange(10) * 1_000_000
    arrival_ns = capture_ns + 800_000
    arrival_ns[4:7] += [4_000_000, 3_000_000, 2_000_000]
    assert np.flatnonzero(~in_time(capture_ns, arrival_ns)).tolist() == [4, 5, 6]
    assert in_time(capture_ns, capture_ns).all()


def test_beside_a_gap_of_the_axis_the_motion_is_not_judged() -> None:
    axis_s = np.concatenate([np.arange(0.0, 0.1, 0.001), np.arange(0.13, 0.2, 0.001)])
    at_s = np.arange(0.0, 0.2, 0.004)
    unseen = at_s[beside_gaps(axis_s, at_s, 0.008)]
    assert unseen[[0, -1]] == pytest.approx([0.092, 0.136])
    assert not beside_gaps(axis_s[:100], at_s, 0.008).any()


def test_a_csv_folder_with_a_stream_missing_answers_with_the_rest(clean: TrialSet, tmp_path: Path) -> None:
    for k, trial in enumerate(clean.trials[:5]):
        write_csv(tmp_path / f"trial_{k}", trial)
    write(tmp_path, {MAPPING_FILE: 'recording = "{recording}"' + TABLES})
    (tmp_path / "trial_2" / "axis.csv").unlink()
    result = diagnose_session(read(tmp_path))
    assert any(finding.sentence == "data: trial_2 holds no axis" for finding in result.quality)
    assert result.recordings == 4


def test_a_folder_with_nothing_in_it_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no table with force and position was found in it"):
        read(tmp_path)


def _slowed(trial: Trial, rate_Hz: float) -> Trial:
    step = round(1 / rate_Hz / float(np.median(np.diff(trial.force_s))))
    return replace(
        trial, force_s=trial.force_s[::step], force_N=trial.force_N[::step], axis_s=trial.axis_s[::step],
        axis_mm=trial.axis_mm[::step], temperature_C=None,
    )  # fmt: skip


def _cut_before_retraction(trial: Trial) -> Trial:
    end = int(np.argmax(trial.axis_mm > trial.axis_mm.max() - 0.01)) + 50
    return replace(
        trial, force_s=trial.force_s[:end], force_N=trial.force_N[:end], axis_s=trial.axis_s[:end],
        axis_mm=trial.axis_mm[:end], temperature_C=None,
    )  # fmt: skip


def write_csv(folder: Path, trial: Trial) -> None:
    folder.mkdir()
    for name, header, columns in (
        ("force", "time_s,force_N", (trial.force_s, trial.force_N)),
        ("axis", "time_s,position_mm", (trial.axis_s, trial.axis_mm)),
    ):
        rows = np.stack(columns, axis=1)
        np.savetxt(folder / f"{name}.csv", rows, delimiter=",", header=header, comments="", fmt="%.6f")


def test_recordings_stacked_in_one_file_are_told_apart_and_chosen_by_name(clean: TrialSet, tmp_path: Path) -> None:
    lines = ["recording,t_s,force_N,extension_mm"]
    for k, trial in enumerate(clean.trials[:2]):
        place = np.interp(trial.force_s, trial.axis_s, trial.axis_mm)
        rows = zip(trial.force_s[::100], trial.force_N[::100], place[::100], strict=True)
        lines += [f"beef|{k},{t:.4f},{f:.4f},{x:.4f}" for t, f, x in rows]
        lines += [f"silicone|{k},0,0,0", f"silicone|{k},1,{k},0"]
    (tmp_path / "stacked.csv").write_text("\n".join(lines) + "\n")
    names = [f"{material}_{number}" for material in ("beef", "silicone") for number in (0, 1)]
    assert [trial.name for trial in read(tmp_path).trials] == names
    chosen = read(tmp_path, Opening(only="*_1"))
    assert [trial.name for trial in chosen.trials] == ["beef_1", "silicone_1"]
    assert any("2 of 4 recordings" in finding.text for finding in chosen.findings)
    with pytest.raises(UsageError, match=r"no recording matches --only 'pork\*'; they are called like beef_0"):
        read(tmp_path, Opening(only="pork*"))
    (tmp_path / "stacked.csv").write_text("\n".join([*lines, "beef|1,9,UNREAD,2"]) + "\n")
    with pytest.raises(DataError, match=rf"line {len(lines) + 1}, column force_N: 'UNREAD' is not a number"):
        read(tmp_path)


@pytest.mark.campaign
def test_what_the_index_law_gets_wrong_on_real_meat_is_relaxation() -> None:
    folder = recording("perineal_indentation")
    result = diagnose_session(read(folder, Opening(PERINEAL, "230411_C_Ind*_RDG*")))
    assert "relaxation" in {effect for finding in result.findings for effect in finding.effects}, result.statement
    named = next(finding for finding in result.findings if finding.effects[0] == "relaxation")
    assert named.gain.reduction > 0.2


def test_a_trial_of_bad_quality_is_left_out_and_one_that_is_not_good_is_named(tmp_path: Path) -> None:
    folder = write_made_session(tmp_path / "session", Bench().cycles(trials=3, speeds_mm_s=(10.0,)))
    info = open_session(folder).info
    bad, usable, good = info.trials
    marked = (
        replace(bad, quality="bad", reasons=("force: a gap of 500 ms",)),
        replace(usable, quality="usable", reasons=("the loop missed of its cycles 15 %",)),
        replace(good, quality="good"),
    )
    write_session(folder, replace(info, trials=marked))
    session = read(folder)
    assert [trial.name for trial in session.trials] == [usable.name, good.name]
    said = {finding.recording: finding.text for finding in session.findings}
    assert said[bad.name] == "quality bad, left out: force: a gap of 500 ms"
    assert said[usable.name] == "quality usable: the loop missed of its cycles 15 %"
    assert good.name not in said
