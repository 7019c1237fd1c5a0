"""`rig fit`: tissue laws and the lattice on sessions."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from api.cli.cohort import ByOption, CohortOption, SchedulerOption, refuse_with_cohort, work_on_cohort
from api.cli.computing import compute
from api.cli.options import PLACE, JsonOption, MappingOption, OnlyOption, YesOption
from api.cli.output import show, write_json
from api.cli.records import mapping_for
from api.operations import fit as work
from api.operations.cohort.wanted import Wanted
from api.operations.fit import DEFAULT_LAWS, Lattice, Laws
from rig.errors import UsageError
from rig.results.fit import FILE, FitResult
from rig.results.tables import fit_parts
from rig.tissue.laws import Law
from rig.tissue.registry import check_known
from rig.trials.opening import AS_IT_IS, Opening


def fit(
    places: Annotated[list[Path], typer.Argument(help=f"{PLACE} Several: subjects compared.")],
    out: Annotated[Path | None, typer.Option("--out", help="Folder for the results; else SESSION/fit.")] = None,
    laws: Annotated[
        str, typer.Option("--laws", help="Further laws to compare, with commas; `all` for every one there is.")
    ] = "",
    known: Annotated[
        list[str] | None,
        typer.Option("--known", help="A parameter not to be fitted: thickness_mm=25; may be repeated."),
    ] = None,
    model: Annotated[str, typer.Option("--model", help="The law that model.json holds.")] = "index",
    extended: Annotated[
        Path | None,
        typer.Option("--with", help="Also the law of this model.json, with what `rig diagnose` named in it as known."),
    ] = None,
    lattice: Annotated[bool, typer.Option("--lattice", help="Also the mass-spring lattice, spring by spring.")] = False,
    block: Annotated[
        str, typer.Option("--block", help="Vertices of the lattice and their spacing in mm: 51x51x40@1, the study's.")
    ] = "51x51x40@1",
    springs: Annotated[
        str, typer.Option("--springs", help="`stabilised` keeps cells from turning over; `study` is springs alone.")
    ] = "stabilised",
    per_spring: Annotated[
        bool, typer.Option("--per-spring", help="The lattice, and stiffness a exp(b |strain|) in each of its springs.")
    ] = False,
    cohort: CohortOption = False,
    by: ByOption = None,
    scheduler: SchedulerOption = "",
    mapping: MappingOption = None,
    only: OnlyOption = "",
    yes: YesOption = False,
    json_file: JsonOption = None,
) -> None:
    """Fits constant stiffness, the index model and other tissue laws to sessions, and says how wrong each is.

    Writes fit.json, pictures, table.csv and model.json. Errors are taken on the trials fitted and on
    trials, speeds and, with several sessions, subjects left out. With --cohort each session is fitted by itself, and
    with --by each specimen or site of it, in parallel; random effects say what they share.

    Example: rig fit sessions/first --laws fung,qlv --json fit.json

    Example: rig fit sessions/* --cohort --out cohort

    Example: rig fit sessions/second --with sessions/first/diagnosis/model.json
    """
    compared = laws_from(laws, known or [], model, extended)
    if cohort or scheduler or by:
        refuse_with_cohort({"--with": extended, "--lattice": lattice, "--per-spring": per_spring})
        named, given = tuple(law.name for law in compared.compared), tuple(compared.known.items())
        wanted = Wanted("fit", named, given, compared.saved, only=only, by=by)
        work_on_cohort(places, out, wanted, scheduler, mapping, json_file, yes)
        return
    simulated = _lattice(block, springs, per_spring) if lattice or per_spring else None
    target = work.target_of(places, out)
    chosen = mapping_for(places[0], mapping, target, yes) if len(places) == 1 else mapping
    write_json(json_file, fitted(places, out, compared, simulated, Opening(chosen, only)))


def fitted(
    places: Sequence[Path],
    out: Path | None = None,
    laws: Laws = DEFAULT_LAWS,
    lattice: Lattice | None = None,
    opening: Opening = AS_IT_IS,
) -> FitResult:
    """Fits and writes, with progress on a terminal, and shows what was found."""
    target = work.target_of(places, out)
    result = compute(
        work.fit_operation(lattice), lambda operation: work.fit(operation, places, out, laws, lattice, opening)
    )
    drawn = "lattice.png, lattice.svg, " if lattice else ""
    show(
        *fit_parts(result), f"{FILE}, fit.png, fit.svg, residuals.png, {drawn}table.csv and model.json are in {target}"
    )
    return result


def laws_from(laws: str, known: Sequence[str], saved: str, model: Path | None = None) -> Laws:
    """From the command's options; raises UsageError for laws, parameters and a model file that are not.

    The law of ``model`` is compared too, and what it takes as known it takes from there.
    """
    names = [name.strip() for name in laws.split(",") if name.strip()]
    found = work.laws_of(names, saved, model)
    return replace(found, known=dict(_known(text, found.compared) for text in known))


def _known(text: str, laws: Sequence[type[Law]]) -> tuple[str, float]:
    name, _, number = text.partition("=")
    try:
        value = float(number)
    except ValueError:
        raise UsageError(f"--known {text}: write NAME=NUMBER") from None
    try:
        check_known({name: value}, laws)
    except UsageError as error:
        raise UsageError(f"--known {error}") from None
    return name, value


def _lattice(block: str, springs: str, stiffen: bool) -> Lattice:
    from api.operations.lattice import lattice_from  # noqa: PLC0415 - compiled kernels take seconds to load

    return lattice_from(block, springs, stiffen)
