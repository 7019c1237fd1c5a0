"""Commands that criticise: what a session shows of the simulation's errors, and what a protocol could show."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from api.cli.cohort import ByOption, SchedulerOption, is_cohort, refuse_with_cohort, work_on_cohort
from api.cli.computing import compute
from api.cli.options import JsonOption, MappingOption, OnlyOption, PlacesArgument, YesOption
from api.cli.output import show, write_json
from api.cli.records import mapping_for
from api.operations import diagnose as work
from api.operations.cohort.wanted import Wanted
from api.operations.judged import Simulation
from controller.operation import Operation
from rig.config.protocol import Indentation
from rig.config.table import load
from rig.results.diagnosis import FOLDER, DiagnosisResult
from rig.results.diagnosis_tables import check_parts, diagnosis_parts
from rig.tissue.model import load_model
from rig.trials.opening import AS_IT_IS, Opening, is_session


def diagnose(
    places: PlacesArgument,
    simulation: Annotated[Simulation, typer.Option(help="Which simulation is judged.")] = "index",
    mapping: MappingOption = None,
    only: OnlyOption = "",
    yes: YesOption = False,
    reference: Annotated[
        Path | None, typer.Option("--reference", help="TOML file: models of others to simulate a drive axis with.")
    ] = None,
    detectability: Annotated[
        bool,
        typer.Option("--detectability", help="Plants causes not found in these recordings, to see from what size."),
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for pictures and the extended model; else SESSION/diagnosis.")
    ] = None,
    by: ByOption = None,
    scheduler: SchedulerOption = "",
    json_file: JsonOption = None,
) -> None:
    """Says what the simulation gets wrong on a session, names the cause, extends the model and measures the gain.

    Ends with 1 where nothing could be judged. Of several sessions each is diagnosed by itself, and with --by
    each specimen or site, in parallel.

    Example: rig diagnose sessions/first --json diagnosis.json
    """
    wanted = Wanted("diagnose", simulation=simulation, detectability=detectability, only=only, by=by)
    refuse_with_cohort({"--reference": reference} if by or len(places) > 1 else {})
    if is_cohort(places, scheduler, by):
        work_on_cohort(places, out, wanted, scheduler, mapping, json_file, yes)
        return
    (place,) = places
    folder = place / FOLDER if out is None and is_session(place) else out
    opening = Opening(mapping_for(place, mapping, out or Path(place.stem), yes), only)
    result = diagnosed(place, simulation, folder, json_file, opening, reference, detectability)
    if result.verdict == "not judged":
        raise typer.Exit(1)


def protocol(
    action: Annotated[Literal["check"], typer.Argument(help="What to do with the protocol.")],  # noqa: ARG001 - a verb
    file: Annotated[Path, typer.Argument(help="Protocol file, for example examples/diagnosis.toml.")],
    model: Annotated[
        Path | None, typer.Option("--model", help="model.json of the tissue; else a limb like the mock bench's.")
    ] = None,
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
    tissue = None if model is None else load_model(model)
    result = compute(
        "protocol check", lambda operation: work.check_protocol(operation, plan, tracker, rate_hz, out, tissue)
    )
    show(*check_parts(result))
    write_json(json_file, result)


def diagnosed(
    place: Path,
    simulation: Simulation = "index",
    out: Path | None = None,
    json_file: Path | None = None,
    opening: Opening = AS_IT_IS,
    reference: Path | None = None,
    detectability: bool = False,
) -> DiagnosisResult:
    """The diagnosis, with progress on a terminal, shown; then what was written of it."""
    operation = Operation("diagnose")
    result = compute(
        operation,
        lambda now: work.diagnose(now, place, simulation, out, opening, reference, detectability),
        prints=False,
    )
    show(*diagnosis_parts(result))
    write_json(json_file, result)
    show(*operation.progress.log)
    return result
