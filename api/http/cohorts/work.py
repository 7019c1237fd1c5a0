"""Jobs on cohorts. A session without a result is named in what is returned; only where none has one the job fails."""

from api.http.cohorts.params import CohortParams, DiagnoseCohortParams, FitCohortParams
from api.http.jobs.work_science import relayed
from api.http.jobs.worker import Desk
from api.operations.cohort.cohort import cohort, cohort_operation, refuse_failed
from api.operations.cohort.wanted import Wanted
from api.operations.fit import laws_of
from controller.operation import Operation
from rig.results.cohort import CohortResult
from rig.tissue.registry import check_known


def fit_cohort(operation: Operation, asked: FitCohortParams, desk: Desk) -> CohortResult:
    """Into the job's own folder, with a folder for each session."""
    check_known(asked.known, laws_of(asked.laws, asked.model).compared)
    known = tuple(asked.known.items())
    wanted = Wanted("fit", tuple(asked.laws), known, asked.model, only=asked.only, by=asked.by)
    return _worked(operation, wanted, asked, desk)


def diagnose_cohort(operation: Operation, asked: DiagnoseCohortParams, desk: Desk) -> CohortResult:
    """The same of diagnoses."""
    wanted = Wanted(
        "diagnose", simulation=asked.simulation, detectability=asked.detectability, only=asked.only, by=asked.by
    )
    return _worked(operation, wanted, asked, desk)


def report_cohort(operation: Operation, asked: CohortParams, desk: Desk) -> CohortResult:
    """The same of pages."""
    return _worked(operation, Wanted("report", only=asked.only, by=asked.by), asked, desk)


def _worked(operation: Operation, wanted: Wanted, asked: CohortParams, desk: Desk) -> CohortResult:
    places = [desk.places.session(name) for name in asked.sessions]
    found = cohort(relayed(cohort_operation(wanted, places), operation), places, desk.places.files, wanted)
    if len(found.failed) == len(found.sessions):
        refuse_failed(found)
    operation.say(*(f"no result: {each.reason}" for each in found.failed))
    return found
