"""The sessions of a cohort: those whose results are kept are taken from there, the rest is worked on in parallel."""

from collections import Counter
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from api.operations.cohort import kept
from api.operations.cohort.parts import Parts
from api.operations.cohort.runners import Runner, on_cores
from api.operations.cohort.task import Files, Task, TaskOutcome
from api.operations.cohort.wanted import Wanted
from controller.operation import Operation
from rig.errors import CheckFailed, DataError, RigError, UsageError
from rig.recording.files import make_folder, refuse_unwritable, whole_file
from rig.recording.remote import address_of
from rig.results import diagnosis, fit
from rig.results.cohort import FILE, CohortResult, CohortSession, PopulationParameter
from rig.results.diagnosis import DiagnosisResult
from rig.results.fit import MODEL, FitResult
from rig.tissue.intervals import LEVEL
from rig.tissue.mixed_effects import population
from rig.tissue.model import load_model

TOLD_BY = {"fit": fit.FILE, "diagnose": diagnosis.FILE}
MOST_NAMED = 3  # of the sessions that failed, in a sentence: the table has them all


@dataclass(frozen=True)
class _Found:
    """A session's outcome, and whether it was there already."""

    outcome: TaskOutcome
    state: Literal["done", "kept", "failed"]


def cohort_operation(wanted: Wanted, places: Sequence[Path]) -> Operation:
    """The operation that ``cohort`` is to report to: a session is a part."""
    return Operation(wanted.work, total=len(places), unit="sessions")


def cohort(
    operation: Operation,
    places: Sequence[Path],
    out: Path,
    wanted: Wanted,
    runner: Runner = on_cores,
    mapping: Path | None = None,
) -> CohortResult:
    """Works on every place, or each of its parts, and writes results to ``out``/NAME, what all have in common to
    ``out``/cohort.json.

    A session that fails is named in the result and costs the others nothing. What was finished once is kept: the same
    call goes on where another was ended. Raises UsageError where places cannot be told apart.
    """
    refuse_unwritable(out / FILE)
    with ExitStack() as stack:
        parts = Parts(wanted, mapping, stack, lambda stage, _: operation.step(stage, 0))
        tasks = parts.tasks(named(places))
        found = {each.outcome.task.name: each for each in _written(operation, tasks, len(places), out, runner)}
    result = _result(wanted, [found[task.name] for task in tasks], parts.remarks, out)
    make_folder(out)
    result.write(out / FILE)
    return result


def refuse_failed(found: CohortResult) -> None:
    """Raises CheckFailed naming the sessions that have no result."""
    if not found.failed:
        return
    names = ", ".join(each.session for each in found.failed[:MOST_NAMED])
    more = len(found.failed) - MOST_NAMED
    raise CheckFailed(
        f"{len(found.failed)} of {len(found.sessions)} {found.by or 'session'}s have no result: {names}"
        f"{f' and {more} more' if more > 0 else ''}; first: {found.failed[0].reason}"
    )


def named(places: Sequence[Path]) -> dict[str, Path]:
    """A name for each place: its own, with that of the folder above where two are called alike."""
    own = Counter(_parts(place)[-1] for place in places)
    found: dict[str, Path] = {}
    for place in places:
        parts = _parts(place)
        name = parts[-1] if own[parts[-1]] == 1 else "-".join(parts[-2:])
        if name in found:
            raise UsageError(f"{found[name]} and {place}: would both be called {name}; give each session once")
        found[name] = place
    return found


def _parts(place: Path) -> tuple[str, ...]:
    whole = place if address_of(place) else place.resolve()
    return whole.parts


def _written(operation: Operation, tasks: Sequence[Task], places: int, out: Path, runner: Runner) -> Iterator[_Found]:
    """Each session as soon as its results stand in its folder."""
    with closing(_outcomes(operation, tasks, runner)) as outcomes:
        for done, each in enumerate(outcomes, start=1):
            if each.outcome.files:
                _write(each.outcome.files, out / each.outcome.task.name)
            what = each.outcome.task.wanted.by or "session"
            operation.step(f"{done} of {len(tasks)} {what}s", done * places / len(tasks))
            yield each
    kept.forget_oldest()


def _outcomes(operation: Operation, tasks: Sequence[Task], runner: Runner) -> Generator[_Found]:
    """Those that are kept first, then the rest as they finish."""
    keys: dict[str, str] = {}
    for task in tasks:
        operation.refuse_cancelled(f"looking at {task.name}")
        found = _looked_up(task, keys)
        if found is not None:
            yield found
    rest = [task for task in tasks if task.name in keys]
    if not rest:
        return
    with closing(runner(rest)) as outcomes:
        for outcome in outcomes:
            if not outcome.reason:
                kept.keep(keys[outcome.task.name], outcome.files)
            yield _Found(outcome, "failed" if outcome.reason else "done")


def _looked_up(task: Task, keys: dict[str, str]) -> _Found | None:
    """What is kept, or why there cannot be anything; else its key is noted and it is to be worked on."""
    if task.refused:
        return _Found(TaskOutcome(task, {}, 0.0, task.refused), "failed")
    try:
        key = kept.key_of(task)
    except RigError as error:
        return _Found(TaskOutcome(task, {}, 0.0, str(error)), "failed")
    except OSError as error:
        return _Found(TaskOutcome(task, {}, 0.0, f"{task.place}: cannot be read: {error.strerror}"), "failed")
    files = kept.recall(key)
    if files is None:
        keys[task.name] = key
        return None
    return _Found(TaskOutcome(task, files), "kept")


def _write(files: Files, folder: Path) -> None:
    make_folder(folder)
    for name, content in files.items():
        with whole_file(folder / name, overwrite=True) as scratch:
            scratch.write_bytes(content)


def _result(wanted: Wanted, found: Sequence[_Found], said: Sequence[str], out: Path) -> CohortResult:
    sessions = tuple(_session(wanted, each, out) for each in found)
    fits = [
        FitResult.read(out / each.folder / TOLD_BY[wanted.work]) for each in sessions if each.folder and each.parameters
    ]
    parameters, remarks = _shared(wanted.model, sessions, fits)
    return CohortResult(
        work=wanted.work,
        by=wanted.by,
        sessions=sessions,
        model_law=wanted.model if wanted.work == "fit" else "",
        parameters=parameters,
        interval_level=LEVEL,
        causes=Counter(cause for each in sessions for cause in each.causes),
        remarks=(*said, *remarks),
    )


def _session(wanted: Wanted, found: _Found, out: Path) -> CohortSession:
    """What one session's own files say."""
    outcome, name = found.outcome, found.outcome.task.name
    facts = {"session": outcome.task.called, "state": found.state, "seconds": outcome.seconds, "reason": outcome.reason}
    if found.state == "failed":
        return CohortSession.model_validate({"subject": "", **facts})
    read = {"fit": _fitted, "diagnose": _diagnosed}.get(wanted.work, _nothing_more)
    whose = {} if outcome.task.value is None else {"subject": outcome.task.value}
    return CohortSession.model_validate({"subject": "", "folder": name, **facts, **read(wanted, out / name), **whose})


def _fitted(wanted: Wanted, folder: Path) -> Mapping[str, object]:
    law = FitResult.read(folder / TOLD_BY[wanted.work]).laws[wanted.model]
    subject = load_model(folder / MODEL).data.subject or folder.name
    values = {name: each.value for name, each in law.parameters.items() if not each.known}
    return {"subject": subject, "parameters": values, "worst_percent": law.worst_percent}


def _diagnosed(wanted: Wanted, folder: Path) -> Mapping[str, object]:
    found = DiagnosisResult.read(folder / TOLD_BY[wanted.work])
    return {"verdict": found.verdict, "causes": tuple(each.effects[0] for each in found.findings)}


def _nothing_more(_wanted: Wanted, _folder: Path) -> Mapping[str, object]:
    return {}


def _shared(
    law: str, sessions: Sequence[CohortSession], fits: Sequence[FitResult]
) -> tuple[dict[str, PopulationParameter], tuple[str, ...]]:
    """Each parameter over subjects; a sentence instead where they are too few."""
    units = {name: each.unit for fit in fits for name, each in fit.laws[law].parameters.items() if not each.known}
    found: dict[str, PopulationParameter] = {}
    for name, unit in units.items():
        try:
            over = population(_by_subject(sessions, name))
        except DataError as error:
            return {}, (f"no summary over subjects: {error}",)
        found[name] = PopulationParameter.model_validate({"unit": unit, **asdict(over)})
    return found, ()


def _by_subject(sessions: Sequence[CohortSession], parameter: str) -> dict[str, list[float]]:
    values: dict[str, list[float]] = {}
    for each in sessions:
        if parameter in each.parameters:
            values.setdefault(each.subject, []).append(each.parameters[parameter])
    return values
