"""How a table that nobody described says its time."""

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import groupby, pairwise, product

import numpy as np

from rig.config.table import TomlTable
from rig.errors import DataError
from rig.intake.families import ColumnGroup, UnitTold
from rig.intake.labelling import Labels
from rig.intake.mapping import RESTART, TimeColumn
from rig.intake.measured import line_of_unit, stated_unit
from rig.intake.notation import is_stamp, pattern_of
from rig.intake.questions import Choice, OpenQuestion
from rig.intake.rates import MOST_STROKES_HZ, named_rate_Hz, stated_rate_Hz
from rig.intake.readers import kind_of
from rig.intake.roles import WORDS, words_of
from rig.intake.rows import ANEW_ROWS, ANEW_SHARE
from rig.intake.survey import Looks, Numbers, wraps_at
from rig.intake.times import DATENUM, UNIX, is_iso, times_ns
from rig.intake.units import TIME_NS, unit_in, unit_of, unknown_unit
from rig.intake.workbook import EPOCH as EPOCH_DAY

# Numbers so large are time since 1970 (2001 to 2286), whatever the column is called.
EPOCH = {"s": (1e9, 1e10), "ms": (1e12, 1e13), "us": (1e15, 1e16), "ns": (1e18, 1e19)}
# A day of a spreadsheet between 2000 and 2064, in its calendar of 1900.
DAYS = (36_526.0, 60_000.0)
# And of MATLAB's between 2000 and 2064.
DATENUMS = tuple(day + DATENUM - (UNIX - EPOCH_DAY).days for day in DAYS)
# Of two units nobody states, one is impossible where the rows would come faster or slower than loggers for force and
# motion are, or the whole recording were shorter than anybody records.
RATES_HZ = (0.2, 20_000.0)
SHORTEST_S = 0.2
# What time may be counted from within a recording: the whole recording's is surer.
PARTS = frozenset(("step", "segment", "interval", "cycle", "stage", "phase", "block", "abschnitt", "schritt"))
# Where more of the rows have the stamp of the row before, it is coarser than they are: whole seconds of many rows each.
SAME_STAMPS = 0.1
# Where more of the rows would be left out, time starts anew for another recording, or the column is no time.
LATE_SHARE = 0.1
_SECOND = re.compile(r":\d\d:\d\d$")


# The `time` of a mapping, what is doubtful in it, and what has to be asked.
SaidTime = tuple[TomlTable, list[str], list[OpenQuestion]]


def clock_of(table: ColumnGroup) -> SaidTime:
    """The `time` of the mapping, what is doubtful in it, and what has to be asked."""
    if parted := _in_two(table):
        return parted, [], []
    for column in _fitting(table):
        found = _column(table, column)
        if found is not None:
            time, doubts, asked = found
            return time, [*doubts, *table.told_of(column), *_other_times(table, column)], asked
    rate_Hz = stated_rate_Hz(table.layout.sheet.facts)
    # Tables of one file that are recorded at rates of their own count from its beginning, whatever the frame is called.
    own = {} if "section" in table.layout.form else table.looks
    counter = next((number for number, looks in own.items() if looks.counts), None)
    known = {} if counter is None else {"column": table.place(counter), "form": "counter"}
    if rate_Hz is None:
        about = _rows_a_stamp(table)
        coarse = f" finer than {about} rows with one stamp" if about else ""
        named = [repr(table.place(number)) for number in table.fitting("time") if number in table.looks]
        still = f" that grows from row to row ({named[0]} does not)" if named and not about else ""
        named_Hz = named_rate_Hz(table.path.name)
        example = f"{named_Hz or about:.15g}" if named_Hz or about else ""
        its = f" (its name says {example})" if named_Hz else ""
        text = f"{table.path.name}: no column of time{coarse or still}; at what rate are the rows, in Hz{its}?"
        usual = example if named_Hz >= MOST_STROKES_HZ else ""
        return {}, [], [OpenQuestion(text, (), "time", usual=usual, example=example, known=known)]
    said = f"{table.path.name}: rows are counted at {rate_Hz:g} Hz, as stands above the table"
    return {**known, "rate_Hz": rate_Hz}, [said], []


def _in_two(table: ColumnGroup) -> TomlTable:
    """Whole seconds in one column, by number or clock, and the rest of them in another; empty without them."""
    for (rest, unit), whole in product(_rests(table), table.columns):
        time, said = _in_seconds(table, whole), words_of(table.layout.sheet.header[whole])
        others = {word for word in words_of(table.layout.sheet.header[rest]) if unit_in(word) != unit}
        known = any(word in WORDS["time"] or unit_in(word) == "s" for word in said) and others <= {
            *said,
            *WORDS["time"],
        }
        if time and known and whole != rest:
            time |= {"finer": table.place(rest), "finer_unit": unit}
            with suppress(DataError):  # where a cell is no time
                if Looks(_joined(table, whole, rest, time)).rises:
                    return time
    return {}


def _rests(table: ColumnGroup) -> Iterator[tuple[int, str]]:
    """Columns that hold parts of a second, with their units."""
    for number, looks in table.looks.items():
        unit = table.unit(number) or unit_in("".join(words_of(table.layout.sheet.header[number])[-1:]))
        whole = looks.known.size == looks.values.size and looks.known.min() >= 0
        if unit in ("ms", "us", "ns") and whole and looks.known.max() * TIME_NS[unit] < TIME_NS["s"]:
            yield number, unit


def _in_seconds(table: ColumnGroup, number: int) -> TomlTable:
    """A column of whole seconds as the `time` of a mapping; empty of another."""
    texts = table.texts.get(number, [])
    if (looks := table.looks.get(number)) is not None:
        is_said = table.unit(number) == "s" or not (table.unit(number) or looks.rises)
        whole = is_said and bool((looks.values % 1 == 0).all())
        return {"column": table.place(number), "unit": "s"} if whole else {}
    if not texts or not all(texts) or not is_stamp(texts[0]) or not _SECOND.search(texts[0]):
        return {}
    form = "iso" if is_iso(texts[0]) else next(iter(pattern_of([texts[0], texts[-1]])), "")
    form = "spreadsheet" if kind_of(table.path) == "workbook" else form
    return {"column": table.place(number), "form": form} if form else {}


def _joined(table: ColumnGroup, whole: int, rest: int, time: TomlTable) -> Numbers:
    """The times [ns] of both together."""
    column = table.texts[whole] if whole in table.texts else table.looks[whole].values
    form, sheet = TimeColumn.model_validate(time), table.layout.sheet
    return times_ns([column, table.looks[rest].values], 0, len(column), form, sheet).astype(np.float64)


def _other_times(table: ColumnGroup, column: int) -> list[str]:
    """That another column may be the time as well, where it runs otherwise."""
    looks, unit = table.looks, table.unit(column)
    alike = [number for number in table.fitting("time") if table.unit(number) == unit and number in looks]
    others = [number for number in alike if looks[number].rises and column in looks]
    own = looks[column].values if others else np.empty(0)
    shown = [repr(table.place(at)) for at in others if not np.array_equal(looks[at].values, own, equal_nan=True)]
    said = f"{table.path.name}: time is taken to be {table.place(column)!r}; it may be {', '.join(shown)}"
    return [said] if shown else []


def _rows_a_stamp(table: ColumnGroup) -> int:
    """How many rows follow each other with the same whole second, 0 without a column of those."""
    stamped = next((texts for texts in table.texts.values() if any(map(is_stamp, texts[:1]))), [])
    runs = [len(list(run)) for _, run in groupby(stamped)]
    return int(np.median(runs[1:-1])) if runs[2:] and _SECOND.search(stamped[0]) else 0


def span_s(table: ColumnGroup, time: TomlTable) -> tuple[float, float] | None:
    """First and last time of a table in s, None where they are days, or their unit is open."""
    if time.get("rate_Hz") and table.rows:
        return 0.0, (table.rows - 1) / time["rate_Hz"]
    number = table.layout.sheet.number(time.get("column", 1))
    texts = [text for text in table.texts.get(number, []) if text] if "form" in time else []
    if not texts and time.get("unit") not in TIME_NS:
        return None
    known = texts or table.looks[number].known
    ends = times_ns([known[:: max(1, len(known) - 1)], None], 0, 2, TimeColumn.model_validate(time), table.layout.sheet)
    return float(ends[0] * 1e-9), float(ends[-1] * 1e-9)


def disorder_of(table: ColumnGroup, at: int, labels: Labels) -> tuple[str, list[str]]:
    """What to do where time does not grow, and the doubt that says so; nothing where it does, or a label tells why."""
    if at not in table.looks or labels.telling:
        return "", []
    values = table.looks[at].values
    late = np.flatnonzero(values[1:] <= np.fmax.accumulate(values)[:-1])
    place = table.layout.sheet.place(int(late[0]) + 1) if late.size else ""
    if restarts := _restarts(values):
        said = f"{place}: time begins anew, as it does {restarts} times; each time a recording begins"
        return RESTART, [f"{said}; if they are one, write true times"]
    if labels.label is not None or not 0 < late.size <= LATE_SHARE * values.size:
        return "", []
    return "drop", [f"{place}: time does not grow, as in {late.size} rows in all; they are left out"]


def _restarts(values: Numbers) -> int:
    """How often time begins anew, if all that it does besides growing is to fall to where it began, after some rows."""
    known = values[np.isfinite(values)]
    ends = np.flatnonzero(np.diff(known) <= 0)
    begun, reached = known[ends + 1] - known[0], known[ends] - known[0]
    lengths = np.diff([0, *(ends + 1), known.size])
    anew = ends.size and lengths.min() >= ANEW_ROWS and bool((np.abs(begun) <= ANEW_SHARE * reached).all())
    return int(ends.size) if anew else 0


def _fitting(table: ColumnGroup) -> list[int]:
    """Columns that may be time: by their words, then those of stamps, then the first if it runs like a clock."""
    named = table.fitting("time")
    named.sort(key=lambda number: not PARTS.isdisjoint(words_of(table.layout.sheet.header[number])))
    first = [number for number in table.columns[:1] if number in table.looks]
    clocks = [number for number in first if table.looks[number].even and not table.looks[number].counts]
    stamps = [number for number in table.columns if any(map(is_stamp, table.texts.get(number, [])[:1]))]
    return list(dict.fromkeys((*named, *stamps, *clocks)))


def _column(table: ColumnGroup, column: int) -> SaidTime | None:
    """The column as time, None where its cells are no times."""
    place, own = table.place(column), table.meant("time", column)
    unit = own.units[0] if own.sure else table.unit(column) or stated_unit("time", table.layout.sheet.facts) or ""
    if column in table.texts:
        return _of_texts(table, place, [text for text in table.texts[column] if text])
    looks = table.looks.get(column)
    if looks is None:
        return None
    anew = wraps_at(looks.values)
    gone = np.cumsum(np.diff(looks.values, prepend=looks.values[:1]) < 0)
    found = _of_numbers(table, place, unit, looks._replace(values=looks.values + anew * gone))
    if found is None or not anew:
        return found
    said = f"{table.path.name}: time {place!r} goes on where it begins anew, at {anew:.15g}"
    return {**found[0], "wraps_at": anew}, [*found[1], said], found[2]


def _of_numbers(table: ColumnGroup, place: str | int, unit: str, looks: Looks) -> SaidTime | None:
    """Times that are numbers."""
    if not looks.rises or (_rows_a_stamp(table) and (np.diff(looks.known) < 0).any()):
        return None
    first, last = looks.known.min(), looks.known.max()
    days = {"spreadsheet": DAYS, "datenum": DATENUMS}
    form = next((form for form, (low, high) in days.items() if low < first and last < high and last - first < 100), "")
    if form and not unit and (kind_of(table.path) == "workbook" or not possible_units(looks)):
        return {"column": place, "form": form}, [], []
    told = table.told.get(table.layout.sheet.number(place))
    if unit in TIME_NS and (not told or unit in possible_units(looks, (unit,))):
        return {"column": place, "unit": unit}, [], []
    if several := unknown_unit(str(place)) or ("" if unit else line_of_unit("time", table.layout.sheet.facts)):
        text = f"{table.path.name}: time {place!r} is in {several}, which is none that is known; how many are a second?"
        return {}, [], [OpenQuestion(text, (), "time", known={"column": place, "form": "counter"})]
    if (unit and not told) or (looks.counts and not unit_of(str(place)) and stated_rate_Hz(table.layout.sheet.facts)):
        return None
    return _without_unit(table, place, looks)


def _of_texts(table: ColumnGroup, place: str | int, texts: Sequence[str]) -> SaidTime | None:
    """Times that are written as texts."""
    same = sum(one == other for one, other in pairwise(texts))
    if not texts or not is_stamp(texts[0]) or same > SAME_STAMPS * len(texts):
        return None
    if kind_of(table.path) == "workbook":
        return {"column": place, "form": "spreadsheet"}, [], []
    if is_iso(texts[0]):
        return {"column": place, "form": "iso"}, [], []
    patterns = pattern_of([texts[0], texts[len(texts) // 2], texts[-1]])
    if not patterns:
        return None
    others = [pattern for pattern in patterns[1:] if "%d" in pattern]
    said = f"{table.path.name}: {texts[0]!r} is read as {patterns[0]}; it may be {', '.join(others)}"
    return {"column": place, "form": patterns[0]}, [said] if others else [], []


def _without_unit(table: ColumnGroup, place: str | int, looks: Looks) -> SaidTime:
    """The only unit that is possible, with a doubt; else a question."""
    units = possible_units(looks)
    told = table.told.get(table.layout.sheet.number(place), UnitTold("", "", ""))
    if len(units) == 1 and not told.unit:
        said = f"{table.path.name}: nothing says the unit of time ({place!r}); taken as {units[0]}, no other is likely"
        return {"column": place, "unit": units[0]}, [said], []
    text = f"nothing says the unit of time ({place!r}, {looks.span}); one of {', '.join(TIME_NS)}"
    choice, usual = Choice(str(place), {"column": place}), "s" if "s" in units and not told.said else ""
    return {"column": place}, [], [OpenQuestion(text, (), "time", (choice,), usual, told.example or usual)]


def possible_units(looks: Looks, among: Sequence[str] = ("s", "ms", "us", "ns")) -> list[str]:
    """Those in which the column is time since 1970, or else, ``among`` these, has a rate and length of recordings."""
    since = [unit for unit, (low, high) in EPOCH.items() if low <= looks.known.min() and looks.known.max() < high]
    if since:
        return since
    step, length = float(np.median(np.diff(looks.known))), float(np.ptp(looks.known))
    scales = {unit: TIME_NS[unit] * 1e-9 for unit in among}
    low, high = RATES_HZ
    return [unit for unit, size in scales.items() if low <= 1 / (step * size) <= high and length * size >= SHORTEST_S]
