"""From a session folder to tables, JSON and model: captured and imported sessions, and sessions with bad trials."""

import csv
import io
import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from mock_devices.testing.made.synthetic import (
    Bench,
    index_force,
    metadata,
    tables,
    write_made_session,
    write_recording,
)
from rig.config.table import load
from rig.errors import DataError, UsageError
from rig.intake.mapping import MAPPING_FILE, DataMapping
from rig.intake.session import import_folder
from rig.recording.sessions import Session, open_session, write_session
from rig.results.csv import as_csv
from rig.results.fit import FitResult
from rig.results.study import fit_result
from rig.tissue.laws_viscous import QuasiLinear
from rig.tissue.model import load_model
from rig.tissue.registry import COMPARED
from rig.tissue.study import (
    Study,
    curves_in,
    fingerprint,
    model_of,
    refuse_at_bounds,
    rows,
    study_curves,
    study_session,
    study_sessions,
)
from rig.tissue.summary import Skipped
from rig.trials.cycles import IndentationCycle
from rig.trials.findings import Finding
from rig.trials.reading import trials_of
from rig.trials.trial import inspected
from tests.rig.recording.measured import turned_tables


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session of two trials at three speeds, one trial in the air, and a run of force tracking."""
    folder = tmp_path_factory.mktemp("made") / "session"
    air = Bench(force=index_force(a_N_mm=1e-6, damping_N_s_mm=0.0)).cycle(10.0, 999)
    cycles = Bench(rate_Hz=500.0).cycles(trials=2, speeds_mm_s=(5.0, 10.0, 30.0))
    write_made_session(folder, [*cycles, air], subject={"id": "7", "site": "forearm"})
    run = Bench().cycle(10.0, 1)
    write_recording(folder / "track_001.mcap", tables(run), metadata(run) | {"trial": {"kind": "tracking"}})
    return folder


@pytest.fixture(scope="module")
def study(folder: Path) -> Study:
    """The study of that session."""
    return study_session(open_session(folder))


def result_of(study: Study) -> FitResult:
    """The study as `rig fit` saves it."""
    return fit_result(study, "model.json", "index", {}, {})


def test_every_trial_with_a_curve_counts_and_the_others_say_why_not(study: Study) -> None:
    assert [curve.name for curve in study.curves] == [
        "trial_500", "trial_501", "trial_1000", "trial_1001", "trial_3000", "trial_3001"
    ]  # fmt: skip
    assert [one.trial for one in study.skipped] == ["trial_999"]
    assert "no contact" in study.skipped[0].reason


@pytest.mark.parametrize("kind", ["specimen", "site", "operator"])
def test_several_specimens_in_one_fit_are_said_once(folder: Path, kind: str) -> None:
    found = inspected(trials_of(open_session(folder)))
    said = Finding("", "session", kind, "several are taken as one")
    curves, _ = curves_in(replace(found, findings=(*found.findings, said)))
    assert [one for curve in curves for one in curve.findings if one.kind == kind] == [said]


def test_samples_that_were_left_out_are_said_with_the_fit(tmp_path: Path) -> None:
    first, second = Bench().cycles(trials=2, speeds_mm_s=(10.0,))
    folder = write_made_session(tmp_path / "session", [first, second])
    streams = tables(first)
    streams["force"]["fz_N"][[40, 50]] = np.nan
    streams["axis"]["arrival_ns"][100:300] += 5_000_000
    (folder / f"{first.name}.mcap").unlink()
    write_recording(folder / f"{first.name}.mcap", streams, metadata(first))
    result = fit_result(study_session(open_session(folder)), "", "index", {}, {})
    count, late = len(streams["force"]), 100 * 200 / len(streams["axis"])
    assert [finding.sentence for finding in result.data_quality] == [
        f"data: {first.name} axis: {late:.0f} % of the samples came more than 0.5 ms later than usual; "
        "these were left out",
        f"data: {first.name} force: 2 of {count} samples hold no number, first sample 41; left out",
    ]


def test_a_trial_of_bad_quality_is_left_out_and_said(tmp_path: Path) -> None:
    folder = write_made_session(tmp_path / "session", Bench().cycles(trials=2, speeds_mm_s=(10.0,)))
    session = open_session(folder)
    first, second = session.trials
    spoilt = replace(first, quality="bad", reasons=("force: a gap of 500 ms (good up to 20 ms)",))
    write_session(folder, replace(session.info, trials=(spoilt, replace(second, quality="usable"))))
    study = study_session(open_session(folder))
    assert [curve.name for curve in study.curves] == [second.name]
    why = "quality bad, left out: force: a gap of 500 ms (good up to 20 ms)"
    assert study.skipped == (Skipped(first.name, why),)


def test_the_index_law_is_closest_on_tissue_that_follows_it(study: Study) -> None:
    assert study.closest == "index"
    assert study.judged["index"].fitted.max_error_percent < 5
    assert study.judged["constant"].fitted.max_error_percent > 30
    assert [speed.speed_mm_s for speed in study.speeds] == [5.0, 10.0, 30.0]
    assert [speed.trials for speed in study.speeds] == [2, 2, 2]


def test_a_law_that_errs_by_more_than_half_of_a_displacement_is_said_to_be_none_to_track_with(
    study: Study, tmp_path: Path
) -> None:
    assert result_of(study).remarks == ()
    soft, stiff = Bench(force=index_force(a_N_mm=0.1)), Bench(force=index_force(a_N_mm=0.6))
    both = [soft.cycle(10.0, 1), soft.cycle(20.0, 2), stiff.cycle(10.0, 3), stiff.cycle(20.0, 4)]
    poor = result_of(study_session(open_session(write_made_session(tmp_path / "both", both))))
    left_out = poor.laws["index"].held_out.trials
    assert left_out and left_out.max_error_percent and left_out.max_error_percent > 50.0
    assert [remark.partition(",")[0] for remark in poor.remarks] == [
        f"the index law errs by up to {left_out.max_error_percent:.0f} % of a displacement"
    ]
    assert "none to track with" in poor.remarks[0]


def test_all_laws_are_judged_on_the_same_measured_displacements(study: Study) -> None:
    constant, index = study.judged["constant"].fitted, study.judged["index"].fitted
    assert constant.measured_mm == pytest.approx(index.measured_mm)


def test_the_json_has_what_the_demonstration_quotes(study: Study) -> None:
    values = json.loads(result_of(study).model_dump_json())
    assert values["constant"]["max_error_percent"] > values["index"]["max_error_percent"] > 0
    assert set(values["index"]["parameters"]) == {"a_N_mm", "b_per_mm", "damping_N_s_mm"}
    assert values["index"]["parameters"]["a_N_mm"]["unit"] == "N/mm"
    assert values["constant"]["parameters"]["damping_N_s_mm"]["at_bound"] is True
    assert values["index"]["held_out"]["trials"]["max_error_mm"] > 0
    assert values["index"]["held_out"]["speeds"]["rmse_N"] > 0
    assert len(values["index"]["rows"]) == len(values["force_N"]) == 10
    assert values["skipped"][0]["trial"] == "trial_999"


def test_the_json_says_null_where_nothing_could_be_left_out(tmp_path: Path) -> None:
    study = study_session(open_session(write_made_session(tmp_path / "one", [Bench().cycle(10.0, 1)])))
    assert result_of(study).laws["index"].held_out.model_dump() == {"trials": None, "speeds": None, "subjects": None}
    table = list(csv.DictReader(io.StringIO(as_csv(result_of(study)))))
    assert table[0]["index_error_trial_left_out_mm"] == ""


def test_the_csv_has_one_row_a_force_and_the_worst_trial_s_errors(study: Study) -> None:
    table = list(csv.DictReader(io.StringIO(as_csv(result_of(study)))))
    found = rows(study.judged["index"].fitted)
    assert [float(row["force_N"]) for row in table] == pytest.approx(study.force_N, rel=1e-5)
    assert [float(row["index_error_mm"]) for row in table] == pytest.approx([row.error_mm for row in found], rel=1e-4)
    worst = max(float(row["constant_error_percent"]) for row in table)
    assert worst == pytest.approx(study.judged["constant"].fitted.max_error_percent, rel=1e-4)
    assert {"constant_error_speed_left_out_percent", "measured_spread_mm"} <= set(table[0])


def test_the_model_carries_range_data_and_quality(study: Study, tmp_path: Path) -> None:
    model_of(study, "index", {"id": "7", "site": "forearm"}).save(tmp_path / "model.json")
    model = load_model(tmp_path / "model.json")
    assert model.law == study.judged["index"].law
    assert 7.5 < model.valid.depth_mm < 8.1
    assert model.valid.speeds_mm_s == (5.0, 10.0, 30.0)
    assert model.data.trials == tuple(curve.name for curve in study.curves)
    assert model.data.sha256 == fingerprint(study.curves)
    assert (model.data.subject, model.data.site) == ("7", "forearm")
    assert model.quality.held_out_max_error_mm is not None
    model.check_force(model.valid.force_N)


def test_the_table_a_controller_reads_is_in_the_json_and_in_the_model(study: Study, tmp_path: Path) -> None:
    model_of(study, "index", {}).save(tmp_path / "model.json")
    model = load_model(tmp_path / "model.json")
    assert [row.force_N for row in model.control] == pytest.approx(study.force_N)
    values = json.loads(result_of(study).model_dump_json())
    assert values["index"]["control"] == [row.model_dump() for row in model.control]
    law, low_B, high_B = model.law, *model.intervals["damping_N_s_mm"]
    for row in model.control:
        assert float(law.force(row.depth_mm)) == pytest.approx(row.force_N)
        assert row.secant_N_mm == pytest.approx(row.force_N / row.depth_mm)
        assert row.tangent_N_mm == pytest.approx(model.tangent_N_mm(row.depth_mm))
        assert row.tangent_low_N_mm < row.tangent_N_mm < row.tangent_high_N_mm
        assert (row.damping_low_N_s_mm, row.damping_high_N_s_mm) == pytest.approx((low_B, high_B))


def test_the_json_says_whether_speeds_differ(study: Study) -> None:
    rate = json.loads(result_of(study).model_dump_json())["rate"]
    assert rate["interval"][0] < 0.01 < rate["interval"][1]
    assert rate["excludes_study"] is True
    assert rate["effect_interval_N"][0] < rate["effect_N"] < rate["effect_interval_N"][1]


def subject_session(folder: Path, subject: str, a_N_mm: float) -> Session:
    """Three trials at two speeds on a subject of its own."""
    bench = Bench(force=index_force(a_N_mm=a_N_mm), rate_Hz=500.0)
    cycles = [bench.cycle(speed, number) for number, speed in enumerate((5.0, 20.0, 20.0))]
    return open_session(write_made_session(folder / subject, cycles, subject={"id": subject}))


def test_each_subject_is_left_out_where_there_are_several(tmp_path: Path) -> None:
    sessions = [subject_session(tmp_path, name, a) for name, a in (("soft", 0.08), ("usual", 0.12), ("stiff", 0.16))]
    study = study_sessions(sessions)
    judged = study.judged["index"]
    assert judged.subjects_left_out is not None
    assert judged.trials_left_out is not None
    assert judged.subjects_left_out.measured_mm.shape == (9, 10)
    assert judged.subjects_left_out.rmse_N > 1.2 * judged.trials_left_out.rmse_N
    held_out = result_of(study).laws["index"].held_out.subjects
    assert held_out is not None and held_out.rmse_N == judged.subjects_left_out.rmse_N
    assert study.curves[0].name == f"{tmp_path / 'soft'}/trial_000"
    table = list(csv.DictReader(io.StringIO(as_csv(result_of(study)))))
    assert float(table[0]["index_error_subject_left_out_mm"]) > 0
    assert study.rate is not None
    assert study.rate.damping_N_s_mm == pytest.approx(0.01, abs=0.003)


def test_two_sessions_of_one_subject_leave_no_subject_out(tmp_path: Path) -> None:
    sessions = [subject_session(tmp_path / day, "7", 0.12) for day in ("monday", "tuesday")]
    study = study_sessions(sessions)
    assert len(study.curves) == 6
    assert study.judged["index"].subjects_left_out is None


def test_a_session_given_twice_is_refused(tmp_path: Path) -> None:
    session = subject_session(tmp_path, "7", 0.12)
    with pytest.raises(UsageError, match=r"7 is given twice; give each session once"):
        study_sessions([session, session])


def test_other_laws_are_judged_beside_the_study_s_two(study: Study) -> None:
    more = study_curves("made", study.curves, laws=[*COMPARED, QuasiLinear], known={"tau_s": 0.5})
    assert list(more.judged) == ["constant", "index", "qlv"]
    tau = result_of(more).laws["qlv"].parameters["tau_s"]
    assert (tau.value, tau.known, tau.standard_error) == (0.5, True, 0.0)
    assert more.judged["index"].law == study.judged["index"].law


def test_the_fingerprint_is_of_the_data(study: Study) -> None:
    assert fingerprint(study.curves) == fingerprint(list(study.curves))
    assert fingerprint(study.curves) != fingerprint(study.curves[:-1])


def test_a_session_without_a_usable_trial_is_refused_with_the_first_reason(tmp_path: Path) -> None:
    air = Bench(force=index_force(a_N_mm=1e-6, damping_N_s_mm=0.0)).cycle(10.0, 3)
    session = open_session(write_made_session(tmp_path / "air", [air]))
    with pytest.raises(DataError, match=r"no trial gives a curve \(1 skipped\); first: trial_003: no contact"):
        study_session(session)


@pytest.mark.parametrize(
    ("pushed", "refused"),
    [
        ({"a_N_mm": 1e-6}, "a_N_mm to its bound, 1e-06 N/mm"),
        ({"b_per_mm": 5.0}, "b_per_mm to its bound, 5 1/mm"),
        ({"damping_N_s_mm": 10.0}, "damping_N_s_mm to its bound, 10 N s/mm"),
        ({"b_per_mm": 0.0, "damping_N_s_mm": 0.0}, ""),
    ],
)
def test_a_fit_that_a_bound_stopped_tells_nothing_unless_an_effect_is_absent(
    study: Study, pushed: dict[str, float], refused: str
) -> None:
    fit = study.judged["index"].fit
    stopped = replace(study.judged["index"], fit=replace(fit, law=replace(fit.law, **pushed)))
    other = replace(study, judged={**study.judged, "index": stopped})
    refuse_at_bounds(other, "constant")
    if refused:
        with pytest.raises(DataError, match=f"these curves tell no stiffness: .* pushed {refused}; look at"):
            refuse_at_bounds(other, "index")
    else:
        refuse_at_bounds(other, "index")


def test_a_recording_that_was_never_finished_still_counts(tmp_path: Path) -> None:
    cycle = Bench().cycle(10.0, 1)
    folder = write_made_session(tmp_path / "cut", [Bench().cycle(10.0, 2)])
    write_recording(folder / f"{cycle.name}.mcap", tables(cycle), metadata(cycle), finish=False)
    study = study_session(open_session(folder))
    assert {curve.name for curve in study.curves} == {"trial_001", "trial_002"}


def write_csv(path: Path, header: str, columns: list[np.ndarray[tuple[int], np.dtype[np.float64]]]) -> None:
    """A CSV file as a stranger's logger writes it."""
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.6f")


@pytest.mark.parametrize("turned", [False, True])
def test_an_imported_session_of_streams_with_own_rates_and_clocks_is_fitted(tmp_path: Path, turned: bool) -> None:
    source, sign = tmp_path / "measured", -1.0 if turned else 1.0
    source.mkdir()
    stated: list[str] = []
    bench, start_s = Bench(noise_N=0.02, quantum_N=0.0), 0.0
    for number, speed_mm_s in enumerate((5.0, 10.0, 20.0) * 2):
        cycle = bench.cycle(speed_mm_s, number)
        trial = source / f"trial_{number:02d}"
        trial.mkdir()
        stated.append(f"[recordings.{trial.name}]\nspeed_mm_s = {speed_mm_s}\ndepth_mm = 8.0\n")
        force, axis = slice(None, None, 5), slice(3, None, 10)
        write_csv(
            trial / "force.csv",
            "time_s,force_N",
            [start_s + cycle.time_s[force] + 0.013, sign * cycle.force_N[force]],
        )
        write_csv(
            trial / "axis.csv", "time_s,position_mm", [start_s + cycle.time_s[axis], sign * cycle.position_mm[axis]]
        )
        start_s += cycle.time_s[-1] + 5.0
    (source / MAPPING_FILE).write_text('recording = "{recording}"\n' + "".join(stated) + turned_tables(turned))
    mapping, now = load(DataMapping, source / MAPPING_FILE), datetime(2026, 1, 2, tzinfo=UTC)
    session = import_folder(source, mapping, tmp_path / "session", now)
    study = study_session(session)
    assert len(study.curves) == 6
    assert study.judged["index"].law.values == pytest.approx([0.12, 0.22, 0.01], rel=0.06)
    for errors in (study.judged["index"].fitted, study.judged["index"].trials_left_out):
        assert errors is not None
        assert errors.max_error_mm < 0.25


def repeated(bench: Bench, seed: int, cycles: int) -> IndentationCycle:
    """One recording of several cycles, each lifting into the air."""
    parts = [bench.cycle(10.0, seed + number) for number in range(cycles)]
    starts_s = np.cumsum([0.0, *(part.time_s[-1] + 0.01 for part in parts[:-1])])
    return IndentationCycle(
        parts[0].name,
        10.0,
        np.concatenate([part.time_s + start_s for part, start_s in zip(parts, starts_s, strict=True)]),
        np.concatenate([part.force_N for part in parts]),
        np.concatenate([part.position_mm for part in parts]),
    )


def test_cycles_of_a_recording_are_curves_that_are_left_out_together(tmp_path: Path) -> None:
    soft, stiff = (Bench(force=index_force(a_N_mm, 0.22), rate_Hz=200.0) for a_N_mm in (0.12, 0.16))
    made = [repeated(soft, 0, 3), repeated(stiff, 10, 3)]
    study = study_session(open_session(write_made_session(tmp_path / "cycles", made)), COMPARED[:2])
    assert [curve.name for curve in study.curves] == [
        f"trial_{seed:03d}, cycle {number}" for seed in (0, 10) for number in (1, 2, 3)
    ]
    assert study.curves[0].findings[-1].text == "cut into its 3 cycles where force is lowest between them"
    left_out = study.judged["index"].trials_left_out
    # From the other recording alone: a third too stiff. From its own other cycles too it would be half of that.
    assert left_out is not None
    forces_off = study.judged["index"].fitted.rmse_N
    assert left_out.rmse_N > 1.7 * forces_off
