"""Columns of a table whose texts say which rows belong together: recordings below each other, who, what, how."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.config.table import TomlTable
from rig.intake.families import ColumnGroup
from rig.intake.naming import KINDS, OPERATORS, templates_of
from rig.intake.notation import is_stamp
from rig.intake.roles import WORDS, words_of
from rig.intake.survey import Numbers

# A label holds for many rows: one that changes more often is a state of the machine, or noise.
FEWEST_ROWS = 5
# Of the words for labels those that are a whole recording's; a cycle, an operator and a condition may change within.
RECORDINGS = WORDS["label"][: WORDS["label"].index("cycle")]
UNKNOWN = len(WORDS["label"])
# What is stated above a table of whom or what it is of; a cycle's number is not, and a sample may have a rate as well.
FACTS = {"specimen": KINDS["specimen"], "site": KINDS["site"], "operator": OPERATORS}
IDENTIFIERS = frozenset(("name", "id", "identifier", "label", "code", "no", "nr", "number", "nummer", "bezeichnung"))


class Labels(NamedTuple):
    """The `label` of a mapping, the templates over it, what is doubtful, and whether labels tell recordings apart."""

    label: TomlTable | str | int | None
    templates: TomlTable
    doubts: list[str]
    telling: bool = False


def labels_in(table: ColumnGroup, taken: Sequence[int], time: int | None) -> Labels:
    """The columns of labels of a table; those that tell recordings apart are named in the template of `recording`."""
    anew = _anew(table, time)
    texts = {number: texts for number, texts in _labelled(table, taken, anew) if _holds(texts)}
    telling = _telling(table, texts, anew)
    kept = [number for number in texts if number in telling or _rank(table, number) < UNKNOWN]
    if not kept:
        return Labels(None, {}, [])
    parting = any(len(set(texts[number])) > 1 for number in telling)
    doubts = list(_doubts(table, texts, telling, anew)) if telling else []
    if kept == telling and len(telling) == 1:
        return Labels(table.place(telling[0]), {}, doubts, parting)
    called = {number: _called(table, number) for number in kept}
    recording = "-".join(f"{{{called[number]}}}" for number in telling)
    templates = {**({"recording": recording} if telling else {}), **templates_of(list(called.values()))}
    return Labels({called[number]: table.place(number) for number in kept}, templates, doubts, parting)


def stated_in(tables: Sequence[ColumnGroup], known: TomlTable) -> tuple[TomlTable, TomlTable]:
    """The `facts` of a mapping, and templates over them: what stands above each table of whom or what it is of.

    Only what differs between the tables, and of which the templates ``known`` say nothing.
    """
    stated = [table.layout.sheet.facts for table in tables]
    told = [name for name in stated[0] if len({facts.get(name) for facts in stated}) > 1]
    told = [name for name in told if all(name in facts for facts in stated)]
    found: TomlTable = {}
    for kind, words in FACTS.items():
        named = [name for name in told if _is_called(name, words)]
        found |= {kind: named[0]} if named and kind not in known else {}
    return found, templates_of(list(found))


def _is_called(name: str, words: Sequence[str]) -> bool:
    said = [word for word in words_of(name) if word not in IDENTIFIERS]
    return len(said) == 1 and said[0] in words


def _labelled(table: ColumnGroup, taken: Sequence[int], anew: Sequence[int]) -> Iterator[tuple[int, list[str]]]:
    """Columns called as labels are, of texts that are no numbers, or that change where time begins anew, as texts."""
    for number in table.columns:
        words = words_of(table.layout.sheet.header[number])
        named, texts = any(word in WORDS["label"] for word in words), table.texts.get(number, [])
        if number in taken or any(map(is_stamp, texts[:1])):
            continue
        if number in table.texts and (named or len(set(texts)) > 1):
            yield number, texts
        elif number in table.looks and not table.looks[number].counts:
            rows, steps = _steps(table.looks[number].values)
            if named or (anew and np.array_equal(rows[steps != 0], anew)):
                yield number, [f"{value:g}" for value in table.looks[number].values]


def _holds(texts: Sequence[str]) -> bool:
    runs = 1 + sum(before != after for before, after in pairwise(texts))
    return runs * FEWEST_ROWS <= len(texts) and all(texts)


def _called(table: ColumnGroup, number: int) -> str:
    """The column's name as one of a template."""
    name = "_".join(words_of(table.layout.sheet.header[number]))
    return name if name.isidentifier() else f"column_{number + 1}"


def _anew(table: ColumnGroup, time: int | None) -> list[int]:
    """Rows at which time starts anew."""
    if time is None or time not in table.looks:
        return []
    rows, steps = _steps(table.looks[time].values)
    return list(map(int, rows[steps < 0]))


def _steps(values: Numbers) -> tuple[NDArray[np.intp], Numbers]:
    """Rows that hold a number, but the first, and by how much it differs from the one before."""
    known = np.flatnonzero(np.isfinite(values))
    return known[1:], np.diff(values[known])


def _telling(table: ColumnGroup, texts: Mapping[int, Sequence[str]], anew: Sequence[int]) -> list[int]:
    """The fewest columns, surest words first, that change wherever time starts anew; else one that is called so."""
    ordered = sorted(texts, key=lambda number: _rank(table, number))
    if not anew:
        sure = [number for number in ordered if _rank(table, number) < len(RECORDINGS) and len(set(texts[number])) > 1]
        return sure[:1]
    needed = ordered
    for number in ordered[::-1]:
        fewer = [other for other in needed if other != number]
        needed = fewer if fewer and _apart([texts[other] for other in fewer], anew) else needed
    return needed


def _rank(table: ColumnGroup, number: int) -> int:
    words = words_of(table.layout.sheet.header[number])
    return min((WORDS["label"].index(word) for word in words if word in WORDS["label"]), default=UNKNOWN)


def _apart(columns: Sequence[Sequence[str]], anew: Sequence[int]) -> bool:
    rows = list(zip(*columns, strict=True))
    starts = [at for at in range(1, len(rows)) if rows[at] != rows[at - 1]]
    runs = [rows[0], *(rows[at] for at in starts)]
    return set(anew) <= set(starts) and len(runs) == len(set(runs))


def _doubts(
    table: ColumnGroup, texts: Mapping[int, Sequence[str]], telling: Sequence[int], anew: Sequence[int]
) -> Iterator[str]:
    """Where two recordings, or two specimens, have the same name: time starts anew, or the name comes again."""
    rows = list(zip(*(texts[number] for number in telling), strict=True))
    starts = [0, *(at for at in range(1, len(rows)) if rows[at] != rows[at - 1])]
    first = {rows[at]: at for at in starts[::-1]}
    again = [at for at in starts if first[rows[at]] != at]
    for row in sorted({*(at for at in anew if at not in starts), *again})[:1]:
        name = "-".join(rows[row])
        yield f"{table.layout.sheet.place(row)}: {name} begins here again: two under one name; name what parts them"
