"""What commands print and write: one console, one kind of table, JSON whole or not at all."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from rig.results.base import SavedResult
from rig.results.tables import TextTable

console = Console()


def table(header: Sequence[str], rows: Iterable[Sequence[str]], title: str = "") -> Table:
    """A table for people; where the terminal is narrow, cells go on in the next line instead of being cut."""
    found = Table(title=title, title_justify="left", show_edge=False)
    for name in header:
        found.add_column(name, overflow="fold")
    for row in rows:
        found.add_row(*row)
    return found


def show(found: TextTable) -> None:
    """Prints a result's table."""
    console.print(table(found.header, found.rows, found.title))


def say(sentences: Iterable[str]) -> None:
    """One line each."""
    for sentence in sentences:
        console.print(sentence, highlight=False, markup=False)


def write_json(path: Path | None, value: SavedResult) -> None:
    """Writes ``value`` to ``path``, whole or not at all; without a path does nothing."""
    if path is not None:
        value.write(path)
