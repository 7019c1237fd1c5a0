"""What `rig fit` prints and writes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from api.cli.output import console, say, show
from rig.errors import UsageError
from rig.recording.files import write_text
from rig.recording.sessions import Session, open_session
from rig.report.drawing import save_figure
from rig.report.figures import fit_figure, residual_figure
from rig.results.csv import as_csv
from rig.results.fit import FILE, MODEL, FitResult, LatticeResult
from rig.results.study import fit_result
from rig.results.tables import (
    control_table,
    displacement_table,
    law_errors_table,
    parameter_table,
    rate_sentence,
    speed_table,
)
from rig.tissue.laws import Law
from rig.tissue.model import load_model
from rig.tissue.registry import COMPARED, LAWS, law_named
from rig.tissue.study import Study, model_of, study_sessions

SAVED_LAW = "index"


@dataclass(frozen=True)
class Wanted:
    """Laws to compare, parameters taken as known, and the law to save."""

    laws: Sequence[type[Law]] = COMPARED
    known: Mapping[str, float] = field(default_factory=dict)
    saved: str = SAVED_LAW

    @classmethod
    def from_options(cls, laws: str, known: Sequence[str], saved: str, model: Path | None = None) -> Self:
        """From the command's options; raises UsageError for laws, parameters and a model file that are not.

        The law of ``model`` is compared too, and what it takes as known it takes from there.
        """
        names = list(LAWS) if laws == "all" else [name.strip() for name in laws.split(",") if name.strip()]
        found = {law.name: law for law in (*COMPARED, *map(law_named, names), law_named(saved))}
        if model:
            law = load_model(model).law
            found[law.name] = law.held()
        chosen = list(found.values())
        return cls(chosen, dict(_known(text, chosen) for text in known), law_named(saved).name)


def _known(text: str, laws: Sequence[type[Law]]) -> tuple[str, float]:
    name, _, number = text.partition("=")
    names = dict.fromkeys(parameter for law in laws for parameter in law.bounds)
    if name not in names:
        raise UsageError(f"--known {text}: the laws compared have {', '.join(names)}; add --laws for others")
    try:
        value = float(number)
    except ValueError:
        raise UsageError(f"--known {text}: write {name}=NUMBER") from None
    for law in laws:
        bounds = law.bounds.get(name)
        if bounds and not bounds.lower <= value <= bounds.upper:
            raise UsageError(f"--known {text}: {law.name} takes {bounds.lower:g} to {bounds.upper:g} {bounds.unit}")
    return name, value


def fit_and_write(
    folders: Sequence[Path],
    out: Path | None = None,
    wanted: Wanted | None = None,
    lattice: tuple[str, str, bool] | None = None,
) -> FitResult:
    """Fits the sessions, prints tables, writes to ``out`` or the one session's fit/; all of it as it is saved.

    ``lattice`` are its block and springs as the command takes them, and whether each spring stiffens by itself; None
    leaves it out.
    """
    wanted, target = wanted or Wanted(), _target(folders, out)
    simulate = _lattice(*lattice) if lattice else None
    sessions = [open_session(folder) for folder in folders]
    with console.status("fitting"):
        study = study_sessions(sessions, wanted.laws, wanted.known)
    result = fit_result(study, str(target / MODEL), wanted.saved, wanted.known, _recordings(sessions))
    show_fit(result)
    if any(judged.law.friction[0] for judged in study.judged.values()):
        say(["friction shows at reversals: curves of loading say nothing for or against it"])
    _draw(study, target)
    write_text(target / "table.csv", as_csv(result))
    model_of(study, wanted.saved, sessions[0].info.subject if len(sessions) == 1 else {}).save(target / MODEL)
    if simulate:
        result = result.model_copy(update={"lattice": simulate(study, target)})
    result.write(target / FILE)
    say([f"{FILE}, fit.png, fit.svg, residuals.png, table.csv and model.json are in {target}"])
    return result


def _recordings(sessions: Sequence[Session]) -> dict[str, str]:
    """The hash of each recording by its trial's name, as the study calls it."""
    alone = len(sessions) == 1
    return {
        trial.name if alone else f"{session.folder}/{trial.name}": trial.sha256
        for session in sessions
        for trial in session.trials
    }


def _target(folders: Sequence[Path], out: Path | None) -> Path:
    if out is None and len(folders) > 1:
        raise UsageError(f"{len(folders)} sessions have no one place for results: give a folder with --out")
    return out or folders[0] / "fit"


def _lattice(block: str, springs: str, stiffen: bool) -> Callable[[Study, Path], LatticeResult]:
    from api.cli.lattice import chosen, fit_lattice  # noqa: PLC0415 - compiled kernels take seconds to load

    size, mode = chosen(block, springs)
    return lambda study, target: fit_lattice(study, target, size, mode, stiffen=stiffen)


def _draw(study: Study, target: Path) -> None:
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{target}: cannot be made: {error.strerror}; give another --out") from error
    for name, picture in (("fit", fit_figure(study)), ("residuals", residual_figure(study))):
        save_figure(picture, target, name)


def show_fit(result: FitResult) -> None:
    """The fit for a person."""
    show(speed_table(result.speeds))
    say(f"skipped {one.trial}: {one.reason}" for one in result.skipped)
    for names in _pairs(list(result.laws)):
        show(displacement_table(result, names))
    show(law_errors_table(result.laws))
    show(parameter_table(result.laws))
    show(control_table(result.laws[result.model_law].control, result.model_law))
    if result.rate:
        say([rate_sentence(result.rate)])


def _pairs(names: Sequence[str]) -> list[Sequence[str]]:
    """Laws side by side, as many as 80 columns take."""
    return [names[at : at + 2] for at in range(0, len(names), 2)]
