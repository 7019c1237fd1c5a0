"""Commands that compute: fit and report. Their imports take seconds, so only who calls them pays."""

from pathlib import Path
from typing import Annotated

import typer

from api.cli.options import JsonOption
from api.cli.output import console, write_json
from rig.results.fit import FitResult

FOLDER = "Session folder, as `rig capture` or `rig import` makes it."
SessionArgument = Annotated[Path, typer.Argument(help=FOLDER)]
SessionsArgument = Annotated[list[Path], typer.Argument(help=f"{FOLDER} Several: subjects compared.")]


def fit(
    session: SessionsArgument,
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
    json_file: JsonOption = None,
) -> None:
    """Fits constant stiffness, the index model and other tissue laws to sessions, and says how wrong each is.

    Writes fit.json, pictures, table.csv and model.json. Errors are taken on the trials fitted and on
    trials, speeds and, with several sessions, subjects left out.

    Example: rig fit sessions/first --laws fung,qlv --json fit.json

    Example: rig fit sessions/second --with sessions/first/diagnosis/model.json
    """
    from api.cli.fitting import Wanted, fit_and_write  # noqa: PLC0415

    wanted = Wanted.from_options(laws, known or [], model, extended)
    simulated = (block, springs, per_spring) if lattice or per_spring else None
    write_json(json_file, fit_and_write(session, out, wanted, simulated))


def fit_session(session: Path) -> FitResult:
    """Fits, prints and writes; the result as it is saved."""
    from api.cli.fitting import fit_and_write  # noqa: PLC0415

    return fit_and_write([session])


def report(
    session: SessionArgument,
    out: Annotated[Path | None, typer.Option("--out", help="File to write; else SESSION/report.html.")] = None,
) -> None:
    """Writes one self-contained HTML page about a session; it needs no network.

    Example: rig report sessions/first --out first.html
    """
    from rig.report.page import write_report  # noqa: PLC0415

    target = out or session / "report.html"
    with console.status("reading, fitting, drawing"):
        write_report(session, target)
    console.print(f"{target} is written", highlight=False)
