"""In which sense a table counts its force and its way: by what is said of the test, and by how the numbers run."""

from collections.abc import Iterator, Mapping

import numpy as np

from rig.config.table import TomlTable
from rig.intake.families import ColumnGroup
from rig.intake.pulling import PRESSES, PULLS, kinds_in, mentions, said_in_rows
from rig.intake.signs import doubt_of, signs_of
from rig.intake.survey import Looks, Numbers, sign_of, with_sign

DONE = {PRESSES: "pressed", PULLS: "pulled"}
# Of the range of a force: where its first tenth moves further, cycles have begun, and only its first row is at rest.
STANDS_SHARE = 0.1
# A force that reaches nearly as far to both sides is of full cycles, whose sign is taken as it stands.
FULL_CYCLE = 1.2
OTHER = {"compression": "tension", "tension": "compression", "into": "out", "out": "into"}


def sense_of(table: ColumnGroup, quantity: str, column: int, known: Mapping[str, int]) -> str:
    """The sense in which the largest force presses, or pulls where that is said; ours where none is seen."""
    pressed = _pressed(table, quantity, column, known)
    return OTHER[pressed] if pulls(table, known) else pressed


def pulls(table: ColumnGroup, known: Mapping[str, int]) -> bool:
    """Whether all that is said of the test, or of its columns, is that it pulls."""
    return _said(table, known).keys() == {PULLS}


def _said(table: ColumnGroup, known: Mapping[str, int]) -> dict[str, str]:
    """By what is done the text that says so; a column of tension says it only where its numbers rise."""
    found = dict(table.said_of_test)
    for texts in table.texts.values():
        found |= said_in_rows(texts)
    for quantity in ("force", "position"):
        name = table.layout.sheet.header[known[quantity]] if quantity in known else ""
        rising = _pressed(table, quantity, known[quantity], known) in ("compression", "into") if name else False
        found |= {kind: name for kind in kinds_in(name) if kind == PRESSES or rising}
    return found


def _pressed(table: ColumnGroup, quantity: str, column: int, known: Mapping[str, int]) -> str:
    """The sense in which the largest force is compression and lies deeper than the start; ours where none is seen.

    Where words of each row say which force presses, it is that one.
    """
    at = column if quantity == "force" else known.get("force")
    found, force = (None, table.force) if at is None else (signs_of(table, at), table.looks[at])
    risen = _risen(signed(force or Looks(np.zeros(1))) * (found.rows if found and found.kind != "unsure" else 1))
    most = int(np.argmax(np.where(risen < 0, -risen, FULL_CYCLE * risen)))
    by_words = found is not None and found.kind == "words"
    if quantity == "force":
        return "tension" if risen[most] < 0 and not by_words else "compression"
    way = signed(table.looks[column])
    way = np.cumsum(np.nan_to_num(way)) if quantity == "velocity" else way
    there = np.flatnonzero(np.isfinite(way))
    deeper = way[there[np.argmin(np.abs(there - most))]] >= way[there[0]]
    return "into" if deeper != (by_words and risen[most] < 0) else "out"


def _risen(force: Numbers) -> Numbers:
    """Above its first tenth, where the machine stands in air or at its preload, or its first row if it moves there."""
    known = force[np.isfinite(force)]
    first = known[: max(1, known.size // 10)]
    stands = np.ptp(first) <= STANDS_SHARE * np.ptp(known)
    return np.nan_to_num(force - (np.median(first) if stands else first[0]))


def signed(looks: Looks) -> Numbers:
    """The numbers with the sign where it stands in a bit."""
    return with_sign(looks.values, **sign_of(looks.values))


def doubts_of_senses(table: ColumnGroup, known: Mapping[str, int], columns: TomlTable) -> Iterator[str]:
    """How the senses are read, by whose word, and what is said that they do not follow."""
    name, found = table.path.name, _said(table, known)
    said = ", ".join(f"positive {quantity} as {column['positive']}" for quantity, column in columns.items())
    if said and len(found) == 1:
        ((kind, who),) = found.items()
        yield f"{name}: {said}, as {DONE[kind]}, which {who!r} says; else write the other of each pair"
    elif said:
        other = "as if pressed; pulled, write the other of compression and tension, into and out"
        yield f"{name}: {said}, {other}"
    signs = signs_of(table, known["force"]) if "force" in known else None
    if signs:
        yield doubt_of(table, known["force"], signs)
    elif len(found) > 1:
        yield f"{name}: {found[PULLS]!r} says tension and {found[PRESSES]!r} compression; it is read as if pressed"
    if not found:
        yield from (f"{name}: {fact!r} speaks of tension" for fact in list(mentions(table.layout.sheet.facts))[:1])
