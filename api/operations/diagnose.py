"""What a session shows of the simulation's errors, and what a protocol could show."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from controller.operation import Operation
from rig.config.protocol import Indentation
from rig.diagnosis.answers import Diagnosis
from rig.diagnosis.design import check
from rig.diagnosis.extended import extended_model
from rig.diagnosis.run import diagnose_session
from rig.progress import Progress
from rig.recording.files import make_folder, refuse_unwritable
from rig.results.check import check_result
from rig.results.diagnosis import FILE, MODEL, PICTURES, DiagnosisResult, ProtocolCheckResult
from rig.trials.reading import read_trials

Simulation = Literal["index", "constant", "axis"]


def diagnose(
    operation: Operation,
    folder: Path,
    simulation: Simulation = "index",
    columns: Sequence[str] = (),
    only: str = "",
    out: Path | None = None,
) -> DiagnosisResult:
    """The diagnosis of a session or a folder of CSV files; pictures and model go to ``out`` too."""
    if out is not None:
        refuse_unwritable(out / FILE)
    found = _found(folder, simulation, tuple(columns), only, operation.step)
    result = DiagnosisResult.model_validate(found)
    if out is not None:
        _write(operation, found, result, out)
    return result


def _found(folder: Path, simulation: Simulation, columns: tuple[str, ...], only: str, tell: Progress) -> Diagnosis:
    if simulation == "axis":
        # The axis needs none of the tissue's machinery, and the tissue none of the axis'.
        from rig.diagnosis.axis_run import diagnose_axis_folder  # noqa: PLC0415

        return diagnose_axis_folder(folder, tell)
    return diagnose_session(read_trials(folder, columns, only), simulation, tell)


def _write(operation: Operation, found: Diagnosis, result: DiagnosisResult, out: Path) -> None:
    """``diagnosis.json``, pictures, and the extended model where there is one."""
    from rig.report.diagnosis_figures import pictures  # noqa: PLC0415 - matplotlib takes a second to load
    from rig.report.drawing import save_figure  # noqa: PLC0415

    for old in (out / MODEL, *(out / f"{name}{kind}" for name in PICTURES for kind in (".svg", ".png"))):
        old.unlink(missing_ok=True)
    figures = pictures(found)
    make_folder(out)
    for name, figure in figures.items():
        save_figure(figure, out, name)
    result.write(out / FILE)
    operation.say(f"pictures and {FILE} are in {out}" if figures else f"{out / FILE} is written")
    if found.search is not None and found.simulation != "axis":
        model = extended_model(found)
        model.save(out / MODEL)
        what = "extended model" if model.effects else "simulation's own model, with nothing added,"
        operation.say(f"{out / MODEL} is the {what} for rig track, simulate and fit --with")
        operation.say(*(f"  {effect.name}: {effect.used}" for effect in model.effects))


def check_protocol(
    operation: Operation, protocol: Indentation, tracker: bool, rate_Hz: float, out: Path | None = None
) -> ProtocolCheckResult:
    """Which causes ``protocol`` can show; with ``out`` the picture of those it confuses is drawn there."""
    operation.step("laying out the protocol", 0.0)
    found = check(protocol, tracker, rate_Hz)
    if out is not None:
        from rig.report.diagnosis_figures import confusability_figure  # noqa: PLC0415 - matplotlib takes a second
        from rig.report.drawing import save_figure  # noqa: PLC0415

        make_folder(out)
        save_figure(confusability_figure(found.names, found.confusion), out, "confusability")
    return check_result(found)
