"""`rig fit`, `diagnose` and `report` of many sessions: each by itself, in parallel, and what they share."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import typer

from api.operations.cohort.wanted import By, Wanted
from rig.errors import UsageError

SchedulerOption = Annotated[
    str,
    typer.Option(
        "--scheduler",
        metavar="ADDRESS",
        help="Dask scheduler whose workers take the sessions; else this computer's cores.",
    ),
]
CohortOption = Annotated[
    bool, typer.Option("--cohort", help="Each session by itself, in parallel, then a summary over subjects.")
]
ByOption = Annotated[By | None, typer.Option("--by", help="Each specimen, site, operator or recording by itself.")]


def work_on_cohort(
    places: Sequence[Path],
    out: Path | None,
    wanted: Wanted,
    scheduler: str,
    mapping: Path | None,
    json_file: Path | None,
    yes: bool,
) -> None:
    """Works on all, shows and writes what was found; raises CheckFailed where some have no result."""
    # What a cohort needs takes a second to load, and the options above are told by every command's help.
    from api.cli.computing import compute  # noqa: PLC0415
    from api.cli.output import show, write_json  # noqa: PLC0415
    from api.cli.records import mapping_for  # noqa: PLC0415
    from api.operations.cohort import cohort as work  # noqa: PLC0415
    from api.operations.cohort.runners import on_cluster, on_cores  # noqa: PLC0415
    from rig.results.cohort import FILE  # noqa: PLC0415
    from rig.results.cohort_tables import cohort_parts  # noqa: PLC0415

    if out is None:
        several = f"parts by {wanted.by}" if wanted.by else f"{len(places)} sessions"
        raise UsageError(f"{several} have no one place for results: give a folder with --out")
    if len(places) == 1:
        mapping = mapping_for(places[0], mapping, out, yes)
    runner = on_cluster(scheduler) if scheduler else on_cores
    result = compute(
        work.cohort_operation(wanted, places),
        lambda operation: work.cohort(operation, places, out, wanted, runner, mapping),
    )
    show(*cohort_parts(result), f"{out / FILE} is written; the results of each are in its folder beside it")
    write_json(json_file, result)
    work.refuse_failed(result)


def is_cohort(places: Sequence[Path], scheduler: str, by: By | None) -> bool:
    """Whether there are several, of one place too, or a cluster is named."""
    return len(places) != 1 or bool(scheduler or by)


def refuse_with_cohort(options: Mapping[str, object]) -> None:
    """Raises UsageError where one of ``options``, which are for one session, is given."""
    given = [name for name, value in options.items() if value]
    if given:
        raise UsageError(f"{', '.join(given)}: is for one session at a time; leave it out, or give that session alone")
