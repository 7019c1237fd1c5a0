"""A cohort as a job of the service: what the command finds, in the job's own folder."""

import shutil
from pathlib import Path

import pytest
from pydantic import ValidationError

from api.http.cohorts.params import CohortParams, FitCohortParams
from api.http.cohorts.work import fit_cohort
from api.http.jobs.places import Places
from api.http.jobs.worker import Desk
from controller.operation import Cancelled, Operation
from rig.config.wiring import Wiring
from rig.errors import CheckFailed, UsageError
from rig.results.cohort import CohortResult


@pytest.fixture
def desk(tmp_path: Path, sessions: list[Path]) -> Desk:
    for place in sessions[:3]:
        shutil.copytree(place, tmp_path / "sessions" / place.name)
    places = Places(*(tmp_path / name for name in ("sessions", "protocols", "uploads", "files")))
    return Desk(places, Wiring(), ask=pytest.fail)


def test_a_job_fits_each_and_says_what_subjects_share(desk: Desk) -> None:
    operation = Operation("fit-cohort")
    shares: list[float] = []
    operation.watch = lambda now: shares.append(now.done)
    found = fit_cohort(operation, FitCohortParams(sessions=["A1", "A2", "B1"], known={}), desk)
    assert CohortResult.read(desk.places.files / "cohort.json") == found
    assert found.parameters["a_N_mm"].subjects == 2
    assert (desk.places.files / "B1" / "model.json").is_file()
    assert shares[-1] == 1.0 and shares == sorted(shares)


def test_a_session_without_a_result_is_said_and_the_job_fails_only_where_none_has_one(desk: Desk) -> None:
    for file in (desk.places.sessions / "A1").glob("*.mcap"):
        file.write_bytes(b"no recording")
    operation = Operation("fit-cohort")
    found = fit_cohort(operation, FitCohortParams(sessions=["A1", "B1"], known={}), desk)
    assert [each.state for each in found.sessions] == ["failed", "done"]
    assert operation.progress.log[0].startswith("no result: ")
    with pytest.raises(CheckFailed, match="1 of 1 sessions have no result"):
        fit_cohort(Operation("fit-cohort"), FitCohortParams(sessions=["A1"], known={}), desk)


def test_a_cancelled_job_ends_between_two_sessions(desk: Desk) -> None:
    operation = Operation("fit-cohort")
    operation.cancel()
    with pytest.raises(Cancelled):
        fit_cohort(operation, FitCohortParams(sessions=["A1", "B1"], known={}), desk)


def test_what_a_job_cannot_do_is_refused(desk: Desk) -> None:
    with pytest.raises(ValidationError, match="each session once"):
        CohortParams(sessions=["A1", "A1"])
    with pytest.raises(ValidationError, match="at least 1"):
        CohortParams(sessions=[])
    with pytest.raises(UsageError, match="nope"):
        fit_cohort(Operation("fit-cohort"), FitCohortParams(sessions=["A1"], laws=["nope"], known={}), desk)
    with pytest.raises(UsageError, match="stiffness=1"):
        fit_cohort(Operation("fit-cohort"), FitCohortParams(sessions=["A1"], known={"stiffness": 1.0}), desk)
