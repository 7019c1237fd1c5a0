"""`rig report`: the page about a session."""

from pathlib import Path
from typing import Annotated

import typer

from api.cli.live import compute
from api.cli.options import JsonOption, SessionArgument
from api.cli.output import write_json
from api.operations import report as work


def report(
    session: SessionArgument,
    out: Annotated[Path | None, typer.Option("--out", help="File to write; else SESSION/report.html.")] = None,
    json_file: JsonOption = None,
) -> None:
    """Writes one self-contained HTML page about a session; it needs no network.

    Example: rig report sessions/first --out first.html
    """
    write_json(json_file, compute("report", lambda operation: work.report(operation, session, out)))
