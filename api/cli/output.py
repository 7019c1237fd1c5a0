"""What commands print and write: one console, one kind of table and sentence, JSON."""

from pathlib import Path

from rich.console import Console
from rich.table import Table

from rig.results.base import SavedResult
from rig.results.tables import Part, TextTable

console = Console(markup=False, highlight=False)


def show(*parts: Part) -> None:
    """Prints tables and sentences. On a narrow terminal both go on in the next line; a pipe gets sentences whole."""
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
    return found


def write_json(path: Path | None, value: SavedResult) -> None:
    """Writes ``value`` to ``path``, whole or not at all; without a path does nothing."""
    if path is not None:
        value.write(path)
