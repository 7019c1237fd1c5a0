"""What `rig fit` prints and writes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from api.cli.output import console, table
from rig.errors import UsageError
from rig.recording.files import whole_file, write_text
from rig.recording.sessions import Session, open_session
from rig.report.drawing import png, svg
from rig.report.figures import fit_figure, residual_figure
from rig.tissue.control_table import control_rows
from rig.tissue.judging import Errors, Judged
from rig.tissue.laws import Law
from rig.tissue.model import ControlRow, load_model
from rig.tissue.rates import STUDY_B_N_S_MM, RateTest
from rig.tissue.registry import COMPARED, LAWS, law_named
from rig.tissue.results import as_csv, as_json
from rig.tissue.study import Study, model_of, rows, study_sessions

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
) -> dict[str, object]:
    """Fits the sessions, prints tables, writes to ``out`` or the one session's fit/; the JSON of it all.

    ``lattice`` are its block and springs as the command takes them, and whether each spring stiffens by itself; None
    leaves it out.
    """
    wanted, target = wanted or Wanted(), _target(folders, out)
    simulate = _lattice(*lattice) if lattice else None
    sessions = [open_session(folder) for folder in folders]
    with console.status("fitting"):
        study = study_sessions(sessions, wanted.laws, wanted.known)
    _print(study, wanted.saved)
    if any(judged.law.friction[0] for judged in study.judged.values()):
        console.print("friction shows at reversals: curves of loading say nothing for or against it", highlight=False)
    _write(study, sessions, target, wanted.saved)
    console.print(f"fit.png, fit.svg, residuals.png, table.csv and model.json are in {target}", highlight=False)
    result = as_json(study) | {"model": str(target / "model.json")}
    return result | {"lattice": simulate(study, target)} if simulate else result


def _target(folders: Sequence[Path], out: Path | None) -> Path:
    if out is None and len(folders) > 1:
        raise UsageError(f"{len(folders)} sessions have no one place for results: give a folder with --out")
    return out or folders[0] / "fit"


def _lattice(block: str, springs: str, stiffen: bool) -> Callable[[Study, Path], dict[str, object]]:
    from api.cli.lattice import chosen, fit_lattice  # noqa: PLC0415 - compiled kernels take seconds to load

    size, mode = chosen(block, springs)
    return lambda study, target: fit_lattice(study, target, size, mode, stiffen=stiffen)


def _write(study: Study, sessions: Sequence[Session], target: Path, law: str) -> None:
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{target}: cannot be made: {error.strerror}; give another --out") from error
    picture = fit_figure(study)
    for name, data in (("fit.png", png(picture)), ("residuals.png", png(residual_figure(study)))):
        with whole_file(target / name, overwrite=True) as scratch:
            scratch.write_bytes(data)
    write_text(target / "fit.svg", svg(picture))
    write_text(target / "table.csv", as_csv(study))
    model_of(study, law, sessions[0].info.subject if len(sessions) == 1 else {}).save(target / "model.json")


def _print(study: Study, saved: str) -> None:
    speeds = [
        (f"{s.speed_mm_s:g}", f"{s.trials}", f"{s.max_depth_mm:.2f}", f"{s.max_force_N:.2f}") for s in study.speeds
    ]
    console.print(table(("speed mm/s", "trials", "largest depth mm", "largest force N"), speeds, "Curves"))
    for trial, reason in study.skipped:
        console.print(f"skipped {trial}: {reason}", highlight=False, markup=False)
    for names in _pairs(list(study.judged)):
        title = "Displacement in mm at given forces, and the worst error"
        console.print(table(*_displacements(study, names), title))
    console.print(table(*worst_errors(study.judged), "Worst errors: on trials fitted, and on what was left out"))
    console.print(table(*_parameters(study), "Parameters"))
    print_control(control_rows(study.judged[saved], study.force_N), saved)
    if study.rate:
        console.print(rate_sentence(study.rate), highlight=False)


def rate_sentence(rate: RateTest) -> str:
    """What the comparison of speeds found, and what it says of the study's B."""
    low, high = rate.effect_interval_N
    return (
        f"speed: B = {rate.damping_N_s_mm:.4g} N s/mm (95 %: {rate.interval[0]:.4g} to {rate.interval[1]:.4g}, "
        f"p = {rate.p_value:.3g}, {rate.trials} trials); slowest to fastest {rate.effect_N:.3g} N ({low:.3g} to "
        f"{high:.3g} N), scatter of trials {rate.spread_N:.2g} N; the study's {STUDY_B_N_S_MM:g} N s/mm would be "
        f"{rate.study_effect_N:.3g} N: {'excluded' if rate.excludes_study else 'not excluded'}"
    )


def print_control(found: Sequence[ControlRow], law: str) -> None:
    """K and B at each force, as a force loop needs them."""
    cells = [
        (
            f"{r.force_N:.2f}", f"{r.depth_mm:.2f}", f"{r.secant_N_mm:.3f}", f"{r.tangent_N_mm:.3f}",
            f"{r.tangent_low_N_mm:.3f}-{r.tangent_high_N_mm:.3f}", f"{r.damping_N_s_mm:.4f}",
            f"{r.damping_low_N_s_mm:.4f}-{r.damping_high_N_s_mm:.4f}",
        )
        for r in found
    ]  # fmt: skip
    header = ("force N", "depth mm", "secant", "tangent", "95 %", "B N s/mm", "95 %")
    console.print(table(header, cells, f"K and B for control ({law})"))


def _pairs(names: Sequence[str]) -> list[Sequence[str]]:
    """Laws side by side, as many as 80 columns take."""
    return [names[at : at + 2] for at in range(0, len(names), 2)]


def _displacements(study: Study, names: Sequence[str]) -> tuple[list[str], list[list[str]]]:
    header = ["force N", "measured"]
    columns = [rows(study.judged[name].fitted) for name in names]
    for name in names:
        header += [name, "off mm", "off %"]
    found = []
    for index, row in enumerate(columns[0]):
        cells = [f"{row.force_N:.2f}", f"{row.measured_mm:.2f}"]
        for column in columns:
            one = column[index]
            cells += [f"{one.predicted_mm:.2f}", f"{one.error_mm:.3f}", f"{one.error_percent:.1f}"]
        found.append(cells)
    return header, found


def worst_errors(judged: Mapping[str, Judged]) -> tuple[list[str], list[list[str]]]:
    """Header and one row a law: worst errors on what was fitted, and on trials, speeds and subjects left out."""
    subjects = any(found.subjects_left_out for found in judged.values())
    header = ["mm (%)", "fitted", "trial out", "speed out", *(["subject out"] if subjects else []), "rms N"]
    return header, [_worst_row(name, found, subjects) for name, found in judged.items()]


def _worst_row(name: str, judged: Judged, subjects: bool) -> list[str]:
    found: list[Errors | None] = [judged.fitted, judged.trials_left_out, judged.speeds_left_out]
    found += [judged.subjects_left_out] if subjects else []
    return [name, *map(_worst, found), f"{judged.fitted.rmse_N:.3f}"]


def _worst(errors: Errors | None) -> str:
    return f"{errors.max_error_mm:.3f} ({errors.max_error_percent:.1f})" if errors else "--"


def _parameters(study: Study) -> tuple[list[str], list[list[str]]]:
    found = []
    for name, judged in study.judged.items():
        for p in judged.law.parameters:
            lower, upper = judged.intervals[p.name]
            interval = "at its bound" if p.name in judged.fit.at_bounds else f"{lower:.4g} to {upper:.4g}"
            interval = "known" if p.name in judged.fit.known else interval
            found.append([name, p.name, f"{p.value:.4g}", interval, p.unit])
    return ["model", "parameter", "value", "95 % interval", "unit"], found
