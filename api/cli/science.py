"""Commands that compute: fit and report. Their imports take seconds, so only who calls them pays."""

from pathlib import Path
from typing import Annotated

import typer

from api.cli.options import JsonOption
from api.cli.output import console, write_json

SessionArgument = Annotated[Path, typer.Argument(help="Session folder, as `rig capture` or `rig import` makes it.")]


def fit(
    session: SessionArgument,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for the results; else SESSION/fit.")] = None,
    lattice: Annotated[bool, typer.Option("--lattice", help="Also the mass-spring lattice, spring by spring.")] = False,
    json_file: JsonOption = None,
) -> None:
    """Fits constant stiffness and the index model to a session, and says how wrong each is.

    Writes fit.png, fit.svg, residuals.png, table.csv and model.json. Errors are taken on the trials fitted and on
    trials and speeds left out.

    Example: rig fit sessions/first --json fit.json
    """
    write_json(json_file, fit_session(session, out, lattice))


def fit_session(session: Path, out: Path | None = None, lattice: bool = False) -> dict[str, object]:
    """Fits, prints and writes; the result as `rig fit --json` gives it."""
    from api.cli.fitting import fit_and_write  # noqa: PLC0415

    return fit_and_write(session, out, lattice)


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
