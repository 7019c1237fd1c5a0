"""Tissue laws fitted to sessions, and the mass-spring lattice where it is asked for."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from controller.operation import Operation
from rig.errors import UsageError
from rig.progress import Progress
from rig.recording.files import make_folder, refuse_unwritable, write_text
from rig.recording.sessions import Session, open_session
from rig.report.drawing import save_figure
from rig.report.figures import fit_figure, residual_figure
from rig.results.csv import as_csv
from rig.results.fit import FILE, FOLDER, MODEL, FitResult, LatticeResult
from rig.results.study import fit_result
from rig.tissue.laws import Law
from rig.tissue.registry import COMPARED
from rig.tissue.study import Study, model_of, study_sessions


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


def fit_operation(lattice: Lattice | None = None) -> Operation:
    """The operation that ``fit`` is to report to."""
    return Operation("fit", total=1 + (lattice.stages if lattice else 0))


def fit(
    operation: Operation,
    folders: Sequence[Path],
    out: Path | None = None,
    laws: Laws = DEFAULT_LAWS,
    lattice: Lattice | None = None,
) -> FitResult:
    """Fits the sessions and writes everything to ``out``, else to the one session's fit/; ``lattice`` adds its own."""
    target = target_of(folders, out)
    refuse_unwritable(target / FILE)
    sessions = [open_session(folder) for folder in folders]
    study = study_sessions(sessions, laws.compared, laws.known, operation.step)
    result = fit_result(study, str(target / MODEL), laws.saved, laws.known, _recordings(sessions))
    make_folder(target)
    for name, picture in (("fit", fit_figure(study)), ("residuals", residual_figure(study))):
        save_figure(picture, target, name)
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


def target_of(folders: Sequence[Path], out: Path | None) -> Path:
    """Where results go; raises UsageError where several sessions leave that open."""
    if out is None and len(folders) > 1:
        raise UsageError(f"{len(folders)} sessions have no one place for results: give a folder with --out")
    return out or folders[0] / FOLDER


def _recordings(sessions: Sequence[Session]) -> dict[str, str]:
    """The hash of each recording by its trial's name, as the study calls it."""
    alone = len(sessions) == 1
    return {
        trial.name if alone else f"{session.folder}/{trial.name}": trial.sha256
        for session in sessions
        for trial in session.trials
    }
