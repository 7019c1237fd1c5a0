"""Which columns of a table that nobody described are its force and its position."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rig.config.table import TomlTable
from rig.errors import DataError
from rig.intake.families import COMPONENTS, DIRECTIONS, ColumnGroup, UnitTold, parts_of
from rig.intake.pulling import PULLS
from rig.intake.questions import Choice, OpenQuestion
from rig.intake.roles import UNIT_ALONE, WORDS, candidates, words_of
from rig.intake.senses import pulls, sense_of, signed
from rig.intake.signs import signs_of
from rig.intake.survey import Looks, sign_of
from rig.intake.units import LINEAR, ROTARY, SIGNALS, UNIT_WORDS, Meant, ros_unit, unit_in, unit_of, unknown_unit
from rig.recording.converter import at_the_end_of_range, run_lengths

# Whole numbers beyond this are a converter's counts: it has ten bits at least, and no one weighs and measures so.
COUNTS = 1000
# Words of an axis that turns; an angle of more than a turn is in degrees as a rule.
ROTARY_WORDS = frozenset(("torque", "tau", "drehmoment", "moment", "q", "dq", "angle", "winkel"))
TURN_RAD = 6.3
# Robots count the place of their tool in metres, of which none reaches far.
ROBOT_WORDS = frozenset(("tcp", "pose", "ee", "eef", "flange"))
REACH_M = 3.0
# A way this short in millimetres is pressed by nanoindenters, which write smaller units; robots write it in metres.
LEAST_MM = 0.05
# What a force cell reads across its axis, and another's noise, is a few percent of the force.
RIVAL_SHARE = 0.1
# The same force in another unit differs by rounding only, which is a few thousandths of it at most.
COPY_SHARE = 0.01
# Coarse noise stands at its lowest in the air; what is called the largest is nearer to the largest than to none.
AT_ITS_LARGEST = 0.5
USUAL = {"force": "N", "position": "mm", "velocity": "mm/s"}


class MeasuredColumns(NamedTuple):
    """The `columns` of a mapping, what is doubtful in them, and what has to be asked."""

    columns: TomlTable
    doubts: list[str]
    questions: list[OpenQuestion]


def chosen(table: ColumnGroup) -> dict[str, int]:
    """The columns that words and units say are which quantity, of those called alike the one that moves most."""
    found = dict[str, int]()
    for quantity in ("force", "position", "velocity"):
        if quantity == "velocity" and "position" in found:
            break
        columns = [number for number in table.fitting(quantity) if number not in found.values()]
        moving = [number for number in columns if number in table.looks and table.looks[number].moves]
        if moving:
            ranks = ranks_of(table, quantity)
            alike = [number for number in moving if ranks[number] == ranks[moving[0]]]
            found[quantity] = max(alike, key=lambda number: float(np.ptp(table.looks[number].known)))
    return found


def _forces(table: ColumnGroup, mine: int) -> list[int]:
    """The force, and others called alike that move as a force does and are neither its directions nor copies of it."""
    ranks, looks, sheet = ranks_of(table, "force"), table.looks, table.layout.sheet
    alike = [number for number, rank in ranks.items() if rank == ranks[mine] and number in looks]
    names = [set(parts_of(sheet.header[number])) for number in alike]
    apart = set[str]().union(*(name ^ names[0] for name in names))
    if apart <= DIRECTIONS or apart in COMPONENTS:
        return [mine]
    in_N = {number: looks[number].values * LINEAR["force"].get(table.unit(number), 1.0) for number in alike}
    range_N = {number: float(np.nanmax(own) - np.nanmin(own)) for number, own in in_N.items()}
    moving = [number for number in alike if range_N[number] > RIVAL_SHARE * range_N[mine]]
    away_N = {number: float(np.nan_to_num(np.abs(in_N[number] - in_N[mine])).max()) for number in moving}
    return [mine, *(number for number in moving if away_N[number] > COPY_SHARE * range_N[mine])]


def _which(table: ColumnGroup, forces: Sequence[int], known: Mapping[str, int]) -> OpenQuestion:
    """Which of several forces under one motion it is."""
    asked = _question(table, "force", forces, known)
    first, unit = asked.choices[0], _usual(table, "force", forces[0])
    shown = "; ".join(f"{choice.name} ({choice.why})" for choice in asked.choices)
    text = f"{table.path.name}: {len(forces)} forces under one motion: {shown}; name the one to read"
    usual = first.name if first.whole else f"{first.name} {unit}" if unit else ""
    return replace(asked, text=f"{text}, a mapping for each reads all", usual=usual)


def ranks_of(table: ColumnGroup, quantity: str) -> dict[int, tuple[bool, int, int]]:
    """How likely each column is the quantity by word and unit, the smaller the likelier."""
    return {table.columns[item.column]: item.rank for item in candidates(quantity, table.names, table.units)}


def measured_in(table: ColumnGroup, time: int | None, quantities: Sequence[str]) -> MeasuredColumns:
    """What is known of each quantity; a question where nothing tells its column, or its unit."""
    known = chosen(table)
    left = [number for number, looks in table.looks.items() if looks.moves and number not in (time, *known.values())]
    found = MeasuredColumns({}, [], [])
    for quantity in quantities:
        forces = _forces(table, known["force"]) if quantity == "force" and "force" in known else []
        if len(forces) > 1:
            found.questions.append(_which(table, forces, known))
        elif quantity in known:
            _take(found, table, quantity, known)
        else:
            found.questions.append(_question(table, quantity, left, known))
    return found


def _take(found: MeasuredColumns, table: ColumnGroup, quantity: str, known: Mapping[str, int]) -> None:
    column = known[quantity]
    value = value_of(table, quantity, column, known)
    found.columns[quantity] = value
    found.doubts.extend(_doubts(table, quantity, column))
    may_be = _meant(table, quantity, column).units
    if "unit" not in value:
        units = ", ".join((*LINEAR[quantity], *ROTARY.get(quantity, {})))
        said = "" if may_be else table.unit(column)
        other = unknown_unit(table.layout.heads[column])
        own = unit_of(str(value["column"]))
        twice = f"is in {own} by its name and in another by the row of units" if own and not said else "has no unit"
        told = table.told.get(column, UnitTold("", "", ""))
        twice = f"is {told.said}" if told.said else twice
        unsaid = f"is in {other}, which is none of" if other else f"{twice}; it is one of"
        how = f"is in {said}, which needs a scale" if said else f"{unsaid} {units}, or needs a scale"
        how = f"may be in {' or '.join(may_be)}, which capitals hide, else it needs a scale" if may_be else how
        what = f"{table.path.name}: {quantity} ({value['column']!r}, {table.looks[column].span}) {how}"
        text = f"{what} (how many {USUAL[quantity]} one of it is)"
        choice = Choice(str(value["column"]), value)
        usual = _usual(table, quantity, column)
        found.questions.append(OpenQuestion(text, (), quantity, (choice,), usual, told.example))


def _usual(table: ColumnGroup, quantity: str, column: int) -> str:
    """The unit it has nearly always; none where a sensor's signal or a count needs a scale."""
    known, name = table.looks[column].known, table.layout.sheet.header[column]
    counts = bool((known % 1 == 0).all()) and float(np.abs(known).max()) >= COUNTS
    if table.unit(column) or unknown_unit(table.layout.heads[column]) or unit_of(name):
        return ""
    if column in table.told or _meant(table, quantity, column).units:
        return ""
    stated = stated_unit(quantity, table.layout.sheet.facts)
    if counts or stated is not None:
        return stated or ""
    if unit := ros_unit(name):
        return unit
    words = words_of(name)
    if not ROTARY_WORDS.isdisjoint(words):
        return {"force": "N m", "velocity": "rad/s"}.get(quantity, "rad" if np.abs(known).max() <= TURN_RAD else "deg")
    robot = not ROBOT_WORDS.isdisjoint(words) and np.abs(known).max() < REACH_M
    return "m" if quantity == "position" and (robot or np.ptp(known) < LEAST_MM) else USUAL[quantity]


def stated_unit(quantity: str, facts: Mapping[str, str]) -> str | None:
    """The unit in a line above the table that states one of this quantity, or of whatever has it; None without a line.

    Empty where the line is of this quantity by name and its unit is none that is known, or another's.
    """
    said = line_of_unit(quantity, facts)
    return said if said is None or said in LINEAR[quantity] else ""


def line_of_unit(quantity: str, facts: Mapping[str, str]) -> str | None:
    """What such a line says, as `Length Units,Meters` in OptiTrack's Motive or `Unit:,lbF` of gauges; else None."""
    own = {*WORDS[quantity], *(("length",) if quantity == "position" else ())}
    for name, value in facts.items():
        words, unit = set(words_of(name)), unit_in(value) or ("" if any(map(str.isdigit, value)) else unit_of(value))
        others = words - UNIT_WORDS
        if others < words and (others & own or (not others and unit in LINEAR[quantity])):
            return unit or value
    return None


def value_of(table: ColumnGroup, quantity: str, column: int, known: Mapping[str, int]) -> TomlTable:
    """What the mapping says of a column: its place, its unit, where its sign stands, and its sense."""
    found = _meant(table, quantity, column)
    value: TomlTable = {"column": table.place(column), **({"unit": found.units[0]} if found.sure else {})}
    beside = signs_of(table, column) if quantity == "force" else None
    signs = beside.keys(table) if beside and beside.kind != "unsure" else sign_of(table.looks[column].values)
    return {**value, **signs, "positive": sense_of(table, quantity, column, known)}


def _meant(table: ColumnGroup, quantity: str, column: int) -> Meant:
    return table.meant(quantity, column, _unit_beside(table, column))


def _unit_beside(table: ColumnGroup, column: int) -> str:
    """The unit in the column behind it, where that holds units; raises DataError where it holds several."""
    texts, header = table.texts.get(column + 1, []), table.layout.sheet.header
    if not texts or UNIT_WORDS.isdisjoint(words_of(header[column + 1])) or not all(map(unit_in, texts)):
        return ""
    other = next((row for row, text in enumerate(texts) if unit_in(text) != unit_in(texts[0])), None)
    if other is None:
        return unit_in(texts[0])
    why = f"{header[column]!r} is in {texts[other]} from here on and in {texts[0]} above"
    raise DataError(f"{table.layout.sheet.place(other)}: {why}; save the rows of each unit as a file of its own")


def beside(way: ColumnGroup, force: ColumnGroup) -> ColumnGroup:
    """``way`` with the force of the table that goes together with it, which begins and ends as it does."""
    own = chosen(force)
    measured, said = signed(force.looks[own["force"]]), {PULLS: force.path.name} if pulls(force, own) else {}
    known, at = np.flatnonzero(np.isfinite(measured)), np.linspace(0, measured.size - 1, way.rows)
    return replace(way, force=Looks(np.interp(at, known, measured[known])), said=said)


def _doubts(table: ColumnGroup, quantity: str, column: int) -> Iterator[str]:
    name, looks = table.path.name, table.looks[column]
    header = table.layout.sheet.header
    ranks = ranks_of(table, quantity)
    own, moving = ranks[column], [number for number in ranks if number in table.looks and table.looks[number].moves]
    others = [
        number for number in moving
        if number != column and ranks[number][0] == own[0] and ranks[number][1] in (own[1], UNIT_ALONE)
    ]  # fmt: skip
    if others:
        shown = ", ".join(repr(header[number]) for number in others)
        yield f"{name}: {quantity} is taken to be {header[column]!r}; it may be {shown}"
    yield from table.told_of(column)
    if (found := _meant(table, quantity, column)).sure and not (table.unit(column) or _unit_beside(table, column)):
        yield f"{name}: {header[column]!r} is taken to be in {found.units[0]}, by the end of its name"
    for key, value in sign_of(looks.values).items():
        yield f"{name}: {header[column]!r} has its sign in high numbers, read with {key} = {value}; if not, take it out"


def spoilt(table: ColumnGroup, quantity: str, column: int) -> Iterator[str]:
    """Cells of a column that are no numbers, and a force that stays at the end of its range, with their place."""
    looks, sheet = table.looks[column], table.layout.sheet
    if looks.odd:
        row, text = looks.odd
        yield f"{sheet.place(row)}, column {sheet.header[column]}: {text!r} is no number; mend it"
    row, count = _full_rows(table, column) if quantity == "force" else (0, 0)
    end = float(np.abs(looks.values[row : row + count]).min()) if count else 0.0
    if end > AT_ITS_LARGEST * float(np.abs(looks.known).max()):
        said = f"{sheet.place(row)}, column {sheet.header[column]}: {count} rows stay at {end:g}, its largest"
        yield f"{said}; if that is the end of its range, say saturates = [{-end:g}, {end:g}]"


def _full_rows(table: ColumnGroup, column: int) -> tuple[int, int]:
    """First row and length of the longest stretch of a force at an end of its range; 0, 0 without one."""
    values, position = table.looks[column].values, chosen(table).get("position")
    sound, full = np.isfinite(values), np.zeros(values.size, bool)
    full[sound] = at_the_end_of_range(values[sound], None if position is None else table.looks[position].values[sound])
    lengths = run_lengths(full)
    row = int(np.argmax(lengths))
    return row, int(lengths[row])


def _question(table: ColumnGroup, quantity: str, left: Sequence[int], known: Mapping[str, int]) -> OpenQuestion:
    """Which column it is, of those that move and are nothing else."""
    units = {column: table.unit(column) for column in left}
    choices = tuple(
        Choice(
            str(table.place(column)), value_of(table, quantity, column, known),
            f"{units[column] or 'no unit'}, {table.looks[column].span}, moves",
        )
        for column in left
    )  # fmt: skip
    signals = [choice for choice, column in zip(choices, left, strict=True) if units[column] in SIGNALS]
    clear = signals if len(signals) == 1 else choices if len(choices) == 1 else ()
    usual = clear[0].name if len(clear) == 1 and clear[0].whole else ""
    shown = "; ".join(f"{choice.name} ({choice.why})" for choice in choices) or "none whose cells are mostly numbers"
    text = f"{table.path.name}: no name tells which column is the {quantity}; it may be {shown}; say it with its unit"
    return OpenQuestion(text, (), quantity, choices, usual)
