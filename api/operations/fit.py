"""Tissue laws fitted to sessions, and the mass-spring lattice where it is asked for."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from api.operations.opening import opened, results_in
from controller.operation import Operation
from rig.errors import UsageError
from rig.progress import Progress
from rig.recording.files import make_folder, refuse_unwritable, write_text
from rig.recording.sessions import Session
from rig.report.drawing import save_figure
from rig.report.figures import fit_figure, residual_figure
from rig.results.csv import as_csv
from rig.results.fit import FILE, FOLDER, MODEL, FitResult, LatticeResult
from rig.results.study import fit_result
from rig.tissue.laws import Law
from rig.tissue.model import load_model
from rig.tissue.registry import COMPARED, LAWS, law_named
from rig.tissue.study import Study, model_of, refuse_at_bounds, study_sessions
from rig.trials.opening import AS_IT_IS, Opening


class Lattice(Protocol):
    """What `--lattice` adds to a fit, in so many stages; its kernels are loaded only where it is wanted."""

    @property
    def stages(self) -> int:
        """How often its progress runs from 0 to 1."""

    def __call__(self, study: Study, target: Path, tell: Progress) -> LatticeResult:
        """The lattice on a fitted study, its files written to ``target``."""


@dataclass(frozen=True)
class Laws:
    """Laws to compare, parameters taken as known, and the law to save."""

    compared: Sequence[type[Law]] = COMPARED
    known: Mapping[str, float] = field(default_factory=dict)
    saved: str = "index"


DEFAULT_LAWS = Laws()


def laws_of(names: Sequence[str], saved: str, model: Path | None = None) -> Laws:
    """By name, `all` for every one there is; raises UsageError for laws and a file that are none.

    The law of ``model`` is compared too, and what it takes as known it takes from there.
    """
    more = LAWS if "all" in names else names
    found = {law.name: law for law in (*COMPARED, *map(law_named, more), law_named(saved))}
    if model:
        law = load_model(model).law
        found[law.name] = law.held()
    return Laws(list(found.values()), saved=law_named(saved).name)


def fit_operation(lattice: Lattice | None = None) -> Operation:
    """The operation that ``fit`` is to report to."""
    return Operation("fit", total=1 + (lattice.stages if lattice else 0))


def fit(
    operation: Operation,
    places: Sequence[Path],
    out: Path | None = None,
    laws: Laws = DEFAULT_LAWS,
    lattice: Lattice | None = None,
    opening: Opening = AS_IT_IS,
    drawn: bool = True,
) -> FitResult:
    """Fits what ``places`` hold and writes all to ``out``, else to the one session's fit/; ``lattice`` adds its own."""
    target = target_of(places, out)
    refuse_unwritable(target / FILE)
    with ExitStack() as stack:
        sessions = [stack.enter_context(opened(place, operation.step, opening)) for place in places]
        return _fitted(operation, sessions, target, laws, lattice, drawn)


def _fitted(
    operation: Operation, sessions: Sequence[Session], target: Path, laws: Laws, lattice: Lattice | None, drawn: bool
) -> FitResult:
    study = study_sessions(sessions, laws.compared, laws.known, operation.step)
    refuse_at_bounds(study, laws.saved)
    result = fit_result(study, str(target / MODEL), laws.saved, laws.known, _recordings(sessions))
    make_folder(target)
    for name, picture in (("fit", fit_figure), ("residuals", residual_figure)) if drawn else ():
        save_figure(picture(study), target, name)
    write_text(target / "table.csv", as_csv(result))
    model_of(study, laws.saved, sessions[0].info.subject if len(sessions) == 1 else {}).save(target / MODEL)
    if lattice:
        result = result.model_copy(update={"lattice": lattice(study, target, _in_stages(operation))})
    result.write(target / FILE)
    return result


def _in_stages(operation: Operation) -> Progress:
    """Each stage of its own from 0 to 1, after the fit's own."""
    stages: list[str] = []

    def tell(stage: str, share: float) -> None:
        if stage not in stages:
            stages.append(stage)
        operation.step(stage, len(stages) + share)

    return tell


def target_of(places: Sequence[Path], out: Path | None) -> Path:
    """Where results go; raises UsageError where several sessions, or files of others, leave that open."""
    if out is None and len(places) > 1:
        raise UsageError(f"{len(places)} sessions have no one place for results: give a folder with --out")
    return results_in(places[0], FOLDER, out)


def _recordings(sessions: Sequence[Session]) -> dict[str, str]:
    """The hash of each recording by its trial's name, as the study calls it."""
    alone = len(sessions) == 1
    return {
        trial.name if alone else f"{session.place}/{trial.name}": trial.sha256
        for session in sessions
        for trial in session.trials
    }
