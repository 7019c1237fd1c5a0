"""What `rig fit` prints and writes."""

from pathlib import Path

from api.cli.output import console, table
from rig.errors import UsageError
from rig.recording.files import whole_file, write_text
from rig.recording.sessions import Session, open_session
from rig.report.drawing import png, svg
from rig.report.figures import fit_figure, residual_figure
from rig.tissue.judging import Errors, Judged
from rig.tissue.results import as_csv, as_json
from rig.tissue.study import Study, model_of, rows, study_session

SAVED_LAW = "index"


def fit_and_write(folder: Path, out: Path | None, lattice: bool = False) -> dict[str, object]:
    """Fits the session in ``folder``, prints tables, writes to ``out`` or ``folder/fit``; the JSON of it all."""
    session = open_session(folder)
    with console.status("fitting"):
        study = study_session(session)
    target = out or folder / "fit"
    _print(study)
    _write(study, session, target)
    console.print(f"fit.png, fit.svg, residuals.png, table.csv and model.json are in {target}", highlight=False)
    result = as_json(study) | {"model": str(target / "model.json")}
    return result | {"lattice": _lattice(study, target)} if lattice else result


def _lattice(study: Study, target: Path) -> dict[str, object]:
    from api.cli.lattice import fit_lattice  # noqa: PLC0415 - compiled kernels take seconds to load

    return fit_lattice(study, target)


def _write(study: Study, session: Session, target: Path) -> None:
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
    model_of(study, SAVED_LAW, session.info.subject).save(target / "model.json")


def _print(study: Study) -> None:
    speeds = [
        (f"{s.speed_mm_s:g}", f"{s.trials}", f"{s.max_depth_mm:.2f}", f"{s.max_force_N:.2f}") for s in study.speeds
    ]
    console.print(table(("speed mm/s", "trials", "largest depth mm", "largest force N"), speeds, "Curves"))
    for trial, reason in study.skipped:
        console.print(f"skipped {trial}: {reason}", highlight=False, markup=False)
    console.print(
        table(*_displacements(study), "Displacement in mm at given forces, and how far off the worst trial is")
    )
    console.print(
        table(*_worst(study), "Worst errors: on trials fitted, on each trial left out, on each speed left out")
    )
    console.print(table(*_parameters(study), "Parameters"))


def _displacements(study: Study) -> tuple[list[str], list[list[str]]]:
    header = ["force N", "measured"]
    columns = [rows(judged.fitted) for judged in study.judged.values()]
    for name in study.judged:
        header += [name, "off mm", "off %"]
    found = []
    for index, row in enumerate(columns[0]):
        cells = [f"{row.force_N:.2f}", f"{row.measured_mm:.2f}"]
        for column in columns:
            one = column[index]
            cells += [f"{one.predicted_mm:.2f}", f"{one.error_mm:.3f}", f"{one.error_percent:.1f}"]
        found.append(cells)
    return header, found


def _worst(study: Study) -> tuple[list[str], list[list[str]]]:
    header = ["model", "fitted mm", "%", "trial out mm", "%", "speed out mm", "%", "rms N"]
    return header, [_worst_row(name, judged) for name, judged in study.judged.items()]


def _worst_row(name: str, judged: Judged) -> list[str]:
    cells = [name]
    for errors in (judged.fitted, judged.trials_left_out, judged.speeds_left_out):
        cells += _pair(errors)
    return [*cells, f"{judged.fitted.rmse_N:.3f}"]


def _pair(errors: Errors | None) -> list[str]:
    return [f"{errors.max_error_mm:.3f}", f"{errors.max_error_percent:.1f}"] if errors else ["--", "--"]


def _parameters(study: Study) -> tuple[list[str], list[list[str]]]:
    found = []
    for name, judged in study.judged.items():
        for p in judged.law.parameters:
            lower, upper = judged.intervals[p.name]
            interval = "at its bound" if p.name in judged.fit.at_bounds else f"{lower:.4g} to {upper:.4g}"
            found.append([name, p.name, f"{p.value:.4g}", interval, p.unit])
    return ["model", "parameter", "value", "95 % interval", "unit"], found
