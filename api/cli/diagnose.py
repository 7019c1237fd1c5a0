"""Commands that criticise: what a session shows of the simulation's errors, and what a protocol could show."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from api.cli.live import compute
from api.cli.options import JsonOption
from api.cli.output import show, write_json
from api.operations import diagnose as work
from api.operations.diagnose import Simulation
from controller.operation import Operation
from rig.config.protocol import Indentation
from rig.config.table import load
from rig.recording.sessions import SESSION_FILE
from rig.results.diagnosis import FOLDER, DiagnosisResult
from rig.results.diagnosis_tables import check_parts, diagnosis_parts


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
    folder = session / FOLDER if out is None and (session / SESSION_FILE).exists() else out
    diagnosed(session, simulation, tuple(columns or ()), only, folder, json_file)


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
    plan = load(Indentation, file)
    result = compute("protocol check", lambda operation: work.check_protocol(operation, plan, tracker, rate_hz, out))
    show(*check_parts(result))
    write_json(json_file, result)


def diagnosed(
    folder: Path,
    simulation: Simulation = "index",
    columns: tuple[str, ...] = (),
    only: str = "",
    out: Path | None = None,
    json_file: Path | None = None,
) -> DiagnosisResult:
    """The diagnosis, with progress on a terminal, shown; then what was written of it."""
    operation = Operation("diagnose")
    result = compute(operation, lambda now: work.diagnose(now, folder, simulation, columns, only, out), prints=False)
    show(*diagnosis_parts(result))
    write_json(json_file, result)
    show(*operation.progress.log)
    return result
