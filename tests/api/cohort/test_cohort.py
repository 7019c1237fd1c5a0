"""Fits of a cohort: as those of each session alone, kept, resumed, and no session costs another its result."""

import json
import os
import shutil
import signal
import sys
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from api.cli.app import build
from api.operations.cohort import kept, runners
from api.operations.cohort.cohort import cohort, cohort_operation, named
from api.operations.cohort.runners import Runner, on_cores, one_by_one
from api.operations.cohort.task import Task, TaskOutcome
from api.operations.cohort.wanted import Wanted
from controller.operation import Cancelled, Operation, Progress
from rig.errors import CheckFailed, DataError, RigError, UsageError
from rig.results.cohort import CohortResult
from tests.api.cohort.conftest import STIFFNESS

FIT = Wanted("fit")


def done(places: Sequence[Path], out: Path, wanted: Wanted = FIT, runner: Runner = one_by_one) -> CohortResult:
    return cohort(cohort_operation(wanted, places), places, out, wanted, runner)


def states(found: CohortResult) -> list[str]:
    return [each.state for each in found.sessions]


def never(_tasks: Sequence[Task]) -> Generator[TaskOutcome]:
    raise AssertionError("all of it is kept")


def run(*arguments: str | Path) -> Any:
    return CliRunner().invoke(build(str(arguments[0])), [str(part) for part in arguments], catch_exceptions=True)


def test_each_session_is_fitted_as_it_would_be_alone(sessions: list[Path], tmp_path: Path) -> None:
    found = done(sessions[:2], tmp_path / "out")
    assert states(found) == ["done", "done"]
    for place in sessions[:2]:
        assert run("fit", place, "--out", tmp_path / "alone").exit_code == 0
        alone, here = (
            json.loads((folder / "fit.json").read_text())
            for folder in (tmp_path / "alone", tmp_path / "out" / place.name)
        )
        assert here["index"] == alone["index"]
        assert here["model"] == "model.json"
        assert not list((tmp_path / "out" / place.name).glob("*.png"))


def test_what_subjects_share_is_what_they_were_made_of(sessions: list[Path], tmp_path: Path) -> None:
    found = done(sessions, tmp_path / "out", runner=on_cores)
    assert CohortResult.read(tmp_path / "out" / "cohort.json") == found
    a = found.parameters["a_N_mm"]
    assert (a.subjects, a.sessions, a.unit) == (4, 8, "N/mm")
    truth = np.array([STIFFNESS[subject] for subject in "ABCD"])
    assert a.mean == pytest.approx(truth.mean(), rel=0.05)
    within = float(np.sqrt((truth.var(axis=1, ddof=1)).mean()))
    between = float(np.sqrt(truth.mean(axis=1).var(ddof=1) - within**2 / 2))
    assert a.between == pytest.approx(between, rel=0.15)
    assert a.within == pytest.approx(within, abs=0.004)
    assert a.between_interval[0] < between < a.between_interval[1]
    assert found.sessions[2].subject == "B"


def test_cores_give_the_files_that_one_process_gives(
    sessions: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done(sessions[:3], tmp_path / "one")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "other"))
    assert states(done(sessions[:3], tmp_path / "two", runner=lambda tasks: on_cores(tasks, most=2))) == ["done"] * 3
    for place in sessions[:3]:
        for name in ("fit.json", "model.json", "table.csv"):
            one, two = (tmp_path / folder / place.name / name for folder in ("one", "two"))
            assert one.read_bytes() == two.read_bytes()


def test_what_was_fitted_before_is_kept_until_anything_of_it_changes(sessions: list[Path], tmp_path: Path) -> None:
    place = tmp_path / "edited"
    shutil.copytree(sessions[0], place)
    first = done([place], tmp_path / "one")
    again = cohort(Operation("fit"), [place], tmp_path / "two", FIT, never)
    assert (states(first), states(again)) == (["done"], ["kept"])
    assert again.sessions[0].parameters == first.sessions[0].parameters
    assert states(done([place], tmp_path / "three", Wanted("fit", model="constant"))) == ["done"], "another option"
    (place / "fit").mkdir()
    (place / "fit" / "fit.json").write_text("what was found is not what it was found from")
    assert states(done([place], tmp_path / "four")) == ["kept"]
    recording = next(place.glob("*.mcap"))
    recording.write_bytes(recording.read_bytes() + b" ")
    assert states(done([place], tmp_path / "five")) == ["done"], "a recording was changed"


def test_another_version_of_the_program_works_it_out_again(
    sessions: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done(sessions[:1], tmp_path / "one")
    monkeypatch.setattr(kept, "program_digest", lambda: "of another source")
    assert states(done(sessions[:1], tmp_path / "two")) == ["done"]


def test_a_kept_result_that_is_damaged_is_worked_out_again(
    sessions: list[Path], tmp_path: Path, own_results: Path
) -> None:
    done(sessions[:1], tmp_path / "one")
    (file,) = own_results.glob("*.zip")
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 0xFF
    file.write_bytes(bytes(content))
    assert states(done(sessions[:1], tmp_path / "two")) == ["done"]


def test_only_the_newest_results_are_kept(own_results: Path) -> None:
    for number in range(4):
        kept.keep(f"{number}", {"a": b"x" * 10})
        file = own_results / f"{number}.zip"
        os.utime(file, (1_000 + number, 1_000 + number))
    size = (own_results / "0.zip").stat().st_size
    kept.forget_oldest(2 * size)
    assert sorted(file.name for file in own_results.glob("*.zip")) == ["2.zip", "3.zip"]


def test_a_bad_session_is_named_and_costs_the_others_nothing(sessions: list[Path], tmp_path: Path) -> None:
    broken, absent = tmp_path / "broken", tmp_path / "absent"
    broken.mkdir()
    (broken / "session.json").write_text("{}")
    found = run("fit", sessions[0], broken, absent, sessions[1], "--cohort", "--out", tmp_path / "out")
    assert isinstance(found.exception, CheckFailed)
    assert f"2 of 4 sessions have no result: {broken}, {absent}; first: {broken}" in str(found.exception)
    assert found.exception.exit_code == 1
    assert f"{absent}: no such file or folder" in found.output
    result = CohortResult.read(tmp_path / "out" / "cohort.json")
    assert states(result) == ["done", "failed", "failed", "done"]
    assert (tmp_path / "out" / sessions[1].name / "model.json").is_file()
    assert not (tmp_path / "out" / "broken").exists()


def test_a_defect_of_the_program_is_the_reason_of_its_session_alone(
    sessions: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from api.operations import fit as work  # noqa: PLC0415

    right = work.fit

    def planted(operation: Operation, places: Sequence[Path], *more: Any, **named_more: Any) -> Any:
        if places[0] == sessions[0]:
            raise ZeroDivisionError("planted")
        return right(operation, places, *more, **named_more)

    monkeypatch.setattr(work, "fit", planted)
    found = done(sessions[:2], tmp_path / "out")
    assert states(found) == ["failed", "done"]
    assert "an error of its own: ZeroDivisionError: planted" in found.sessions[0].reason


def test_what_was_ended_goes_on_where_it_was(sessions: list[Path], tmp_path: Path) -> None:
    operation = cohort_operation(FIT, sessions[:4])
    seen: list[Progress] = []

    def watch(now: Progress) -> None:
        seen.append(now)
        if now.done >= 2:
            operation.cancel()

    operation.watch = watch
    with pytest.raises(Cancelled):
        cohort(operation, sessions[:4], tmp_path / "out", FIT, one_by_one)
    assert any(now.time_left_s is not None and now.time_left_s > 0 for now in seen if now.done)
    assert not (tmp_path / "out" / "cohort.json").exists()
    assert states(done(sessions[:4], tmp_path / "out")).count("kept") >= 2


def test_a_killed_process_is_a_sentence_and_what_is_finished_stays(
    sessions: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runners, "run", _dies)
    with pytest.raises(RigError, match=r"was killed.* what is finished is kept: the same command goes on"):
        done(sessions[:2], tmp_path / "out", runner=lambda tasks: on_cores(tasks, most=2))


def _dies(_task: Task) -> TaskOutcome:
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError


@pytest.mark.extra
def test_diagnoses_and_reports_of_several_are_made_each_by_itself(sessions: list[Path], tmp_path: Path) -> None:
    found = run("diagnose", *sessions[:2], "--out", tmp_path / "criticism")
    assert found.exit_code == 0, found.output
    result = CohortResult.read(tmp_path / "criticism" / "cohort.json")
    assert [each.verdict for each in result.sessions] != ["", ""]
    assert (tmp_path / "criticism" / sessions[0].name / "diagnosis.json").is_file()
    found = run("report", *sessions[:2], "--out", tmp_path / "pages")
    assert found.exit_code == 0, found.output
    assert (tmp_path / "pages" / sessions[1].name / "report.html").read_bytes().startswith(b"<!")


def test_names_tell_places_apart(tmp_path: Path) -> None:
    one, two, other = tmp_path / "x" / "first", tmp_path / "y" / "first", tmp_path / "z"
    assert list(named([one, two, other])) == ["x-first", "y-first", "z"]
    assert list(named([Path("s3://lab/first"), one])) == ["lab-first", "x-first"]
    with pytest.raises(UsageError, match="give each session once"):
        named([one, one])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["fit", "a", "b", "--cohort"], "give a folder with --out"),
        (["fit", "a", "b", "--cohort", "--lattice", "--out", "o"], "--lattice: is for one session at a time"),
        (["diagnose", "a", "b", "--out", "o", "--reference", "r.toml"], "--reference: is for one session at a time"),
        (["report", "a", "b"], "give a folder with --out"),
        (["fit", "a", "--scheduler", "tcp://127.0.0.1:1", "--out", "o"], "no Dask scheduler answers there"),
    ],
)
def test_wrong_use_is_one_sentence(
    options: list[str], words: str, sessions: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(runners, "TIMEOUT_S", 1.0)
    places = {"a": str(sessions[0]), "b": str(sessions[1])}
    found = run(*(places.get(option, option) for option in options))
    assert isinstance(found.exception, UsageError)
    assert words in str(found.exception)


def test_a_cluster_without_its_extra_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UsageError, match=r"pip install 'tissue-rig\[cluster\]'"):
        runners.on_cluster("tcp://127.0.0.1:8786")


def test_a_summary_of_one_subject_is_refused_in_words(sessions: list[Path], tmp_path: Path) -> None:
    found = done(sessions[:2], tmp_path / "out")
    assert found.parameters == {}
    assert found.remarks == ("no summary over subjects: 1 subject: what subjects share needs at least 2",)


def test_a_key_of_what_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such file or folder"):
        kept.key_of(Task.of("x", tmp_path / "x", FIT, None))
