"""What commands print and write: one console, one kind of table and sentence, JSON."""

import functools
from collections.abc import Callable
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

from rig.errors import RigError
from rig.results.base import Failure, SavedResult
from rig.results.tables import Part, TextTable

WIDE = 1000  # letters: as wide as no terminal is
console = Console(markup=False, highlight=False)


def show(*parts: Part) -> None:
    """Prints tables and sentences. On a narrow terminal both go on in the next line; a pipe gets sentences whole.

    A table that is too wide for its place stands closer together before words in it are cut.
    """
    for part in parts:
        if isinstance(part, TextTable):
            console.print(_table(part))
        else:
            console.print(part, soft_wrap=not console.is_terminal)


def _table(part: TextTable) -> Table:
    found = Table(title=part.title, title_justify="left", show_edge=False)
    for name in part.header:
        found.add_column(name, overflow="fold")
    for row in part.rows:
        found.add_row(*row)
    if Measurement.get(console, console.options.update(max_width=WIDE), found).maximum > console.width:
        found.box, found.padding = SIMPLE_HEAD, 0
    return found


def write_json(path: Path | None, value: SavedResult) -> None:
    """Writes ``value`` to ``path``, whole or not at all; without a path does nothing."""
    if path is not None:
        value.write(path)


def with_reason(command: Callable[..., None]) -> Callable[..., None]:
    """The command, which writes to its --json why it ended where it wrote no result there."""

    @functools.wraps(command)
    def run(**options: object) -> None:
        file = options.get("json_file")
        before = _version(file)
        try:
            command(**options)
        except RigError as error:
            if isinstance(file, Path) and _version(file) == before:
                Failure(error=type(error).__name__, exit_code=error.exit_code, reason=str(error)).write(file)
            raise

    return run


def _version(file: object) -> tuple[int, int] | None:
    """What tells a file from one that took its place; None of none."""
    if not isinstance(file, Path) or not file.exists():
        return None
    found = file.stat()
    return found.st_ino, found.st_mtime_ns
