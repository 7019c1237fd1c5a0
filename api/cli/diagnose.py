"""Commands that criticise: what a session shows of the simulation's errors, and what a protocol could show."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from api.cli.options import JsonOption
from api.cli.output import console, say, show, write_json
from rig.config.protocol import Indentation
from rig.config.table import load
from rig.diagnosis.answers import Diagnosis
from rig.diagnosis.design import check
from rig.diagnosis.extended import extended_model
from rig.diagnosis.run import diagnose_session
from rig.diagnosis.sources import read_source
from rig.errors import UsageError
from rig.recording.files import write_text
from rig.recording.sessions import SESSION_FILE
from rig.results.check import check_result
from rig.results.diagnosis import FILE, FOLDER, MODEL, PICTURES, DiagnosisResult
from rig.results.diagnosis_tables import (
    check_tables,
    further_sentences,
    gain_sentence,
    named_table,
    not_found_table,
    untestable_sentences,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Simulation = Literal["index", "constant", "axis"]


def diagnose(
    session: Annotated[Path, typer.Argument(help="Session folder, or a folder of CSV files as `rig import` reads it.")],
    simulation: Annotated[Simulation, typer.Option(help="Which simulation is judged.")] = "index",
    columns: Annotated[list[str] | None, typer.Option(help="[STREAM.]FIELD=HEADER for other column names.")] = None,
    only: Annotated[
        str, typer.Option("--only", help="Of recordings stacked in one CSV file: those matching, for example 'pork*'.")
    ] = "",
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for pictures and the extended model; else SESSION/diagnosis.")
    ] = None,
    json_file: JsonOption = None,
) -> None:
    """Says what the simulation gets wrong on a session, names the cause, extends the model and measures the gain.

    Example: rig diagnose sessions/first --json diagnosis.json
    """
    result = run_diagnosis(session, simulation, tuple(columns or ()), only)
    show_diagnosis(DiagnosisResult.model_validate(result))
    write_json(json_file, DiagnosisResult.model_validate(result))
    folder = session / FOLDER if out is None and (session / SESSION_FILE).exists() else out
    if folder is not None:
        save(result, folder)


def protocol(
    action: Annotated[Literal["check"], typer.Argument(help="What to do with the protocol.")],  # noqa: ARG001 - a verb
    file: Annotated[Path, typer.Argument(help="Protocol file, for example examples/diagnosis.toml.")],
    tracker: Annotated[bool, typer.Option(help="Whether a tracker sees the tip.")] = True,
    rate_hz: Annotated[
        float, typer.Option("--rate-Hz", min=10, max=100_000, help="Rate of the force sensor.")
    ] = 1000.0,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for the confusability picture.")] = None,
    json_file: JsonOption = None,
) -> None:
    """Says before any recording which causes a protocol can show, from what size, and which it cannot separate.

    Example: rig protocol check examples/diagnosis.toml --json check.json
    """
    found = check(load(Indentation, file), tracker, rate_hz)
    result = check_result(found)
    console.print(f"{result.cycles} cycles in {result.duration_s:.0f} s", highlight=False)
    for shown in check_tables(result):
        show(shown)
    say(untestable_sentences(result.not_testable))
    write_json(json_file, result)
    if out is not None:
        from rig.report.diagnosis_figures import confusability_figure  # noqa: PLC0415 - matplotlib takes a second

        draw({"confusability": confusability_figure(found.names, found.confusion)}, out)


def run_diagnosis(folder: Path, simulation: Simulation, columns: tuple[str, ...] = (), only: str = "") -> Diagnosis:
    """The diagnosis of a folder, with a progress bar on stderr."""
    bar_columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    screen = Console(stderr=True)
    with Progress(*bar_columns, console=screen, disable=not screen.is_terminal, transient=True) as bar:
        task = bar.add_task("reading", total=1.0)

        def progress(text: str, done: float) -> None:
            bar.update(task, description=text, completed=done)

        if simulation == "axis":
            # The axis needs none of the tissue's machinery, and the tissue none of the axis'.
            from rig.diagnosis.axis_run import diagnose_axis_folder  # noqa: PLC0415

            return diagnose_axis_folder(folder, progress)
        return diagnose_session(read_source(folder, columns, only), simulation, progress)


def show_diagnosis(result: DiagnosisResult) -> None:
    """The diagnosis for a person."""
    say([f"{result.verdict}: {result.statement}"])
    if result.findings:
        show(named_table(result))
        say(map(gain_sentence, result.findings))
    if result.detectable:
        show(not_found_table(result))
    say(further_sentences(result))


def save(result: Diagnosis, folder: Path) -> None:
    """``diagnosis.json``, pictures, and the extended model where there is one, in ``folder``."""
    from rig.report.diagnosis_figures import pictures  # noqa: PLC0415 - matplotlib takes a second to load

    for old in (folder / MODEL, *(folder / f"{name}{kind}" for name in PICTURES for kind in (".svg", ".png"))):
        old.unlink(missing_ok=True)
    figures = pictures(result)
    draw(figures, folder)
    DiagnosisResult.model_validate(result).write(folder / FILE)
    said = f"pictures and {FILE} are in {folder}" if figures else f"{folder / FILE} is written"
    console.print(said, highlight=False)
    if result.search is not None and result.simulation != "axis":
        model = extended_model(result)
        model.save(folder / MODEL)
        what = "extended model" if model.effects else "simulation's own model, with nothing added,"
        console.print(f"{folder / MODEL} is the {what} for rig track, simulate and fit --with", highlight=False)
        for effect in model.effects:
            console.print(f"  {effect.name}: {effect.used}", highlight=False)


def draw(figures: Mapping[str, "Figure"], folder: Path) -> None:
    """Each figure as PNG and SVG in ``folder``, which is made."""
    from rig.report.drawing import png, svg  # noqa: PLC0415 - matplotlib takes a second to load

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder}: cannot be made: {error.strerror}; give another --out") from error
    for name, picture in figures.items():
        (folder / f"{name}.png").write_bytes(png(picture))
        write_text(folder / f"{name}.svg", svg(picture))
