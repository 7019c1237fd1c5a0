"""`rig report`: the page about a session."""

from pathlib import Path
from typing import Annotated

import typer

from api.cli.cohort import ByOption, SchedulerOption, is_cohort, work_on_cohort
from api.cli.computing import compute
from api.cli.options import JsonOption, MappingOption, OnlyOption, PlacesArgument, YesOption
from api.cli.output import write_json
from api.cli.records import mapping_for
from api.operations import report as work
from api.operations.cohort.wanted import Wanted
from rig.trials.opening import Opening


def report(
    places: PlacesArgument,
    out: Annotated[
        Path | None, typer.Option("--out", help="File to write, else SESSION/report.html; of several a folder.")
    ] = None,
    by: ByOption = None,
    scheduler: SchedulerOption = "",
    mapping: MappingOption = None,
    only: OnlyOption = "",
    yes: YesOption = False,
    json_file: JsonOption = None,
) -> None:
    """Writes one self-contained HTML page about a session, or about each of several or of its parts.

    A page needs no network. Of files of others it shows the results in fit/ and diagnosis/ beside the page.

    Example: rig report sessions/first --out first.html
    """
    if is_cohort(places, scheduler, by):
        work_on_cohort(places, out, Wanted("report", only=only, by=by), scheduler, mapping, json_file, yes)
        return
    (place,) = places
    opening = Opening(mapping_for(place, mapping, out or Path(place.stem), yes), only)
    write_json(json_file, compute("report", lambda operation: work.report(operation, place, out, opening)))
