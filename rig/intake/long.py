"""Tables with a row for each value (time, channel, value): a column for each channel instead, or a table for each."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.errors import DataError
from rig.intake.mapping import LongForm
from rig.intake.sheet import Batch, Sheet
from rig.intake.units import unit_in, unit_of

Rows = NDArray[np.intp]
# Rows that are held whole, with their texts some four gigabytes: six channels at 1 kHz for an hour have 22 million.
MOST_ROWS = 20_000_000
# Names of sheets are looked for by patterns, to which these are signs.
_PLAIN = str.maketrans("[]{}*?/", "()()___")


class ChannelRows(NamedTuple):
    """A channel, what its values are in, and where they stand."""

    name: str
    unit: str
    rows: Rows


def by_channel(sheet: Sheet, form: LongForm) -> list[Sheet]:
    """A column a channel where all were taken at the same times, else a sheet a channel; raises DataError."""
    value = sheet.number(form.value)
    taken = {sheet.number(place) for place in (form.channel, form.value, form.unit) if place is not None}
    others = [number for number in range(len(sheet.header)) if number not in taken]
    channels = list(_channels(sheet, form))
    shared = _shared(sheet, others, channels)
    if shared:
        return [_view(sheet, sheet.name, shared, channels, value)]
    return [
        _view(sheet, f"{sheet.name}-{one.name}".lstrip("-").translate(_PLAIN), others, [one], value) for one in channels
    ]


def _channels(sheet: Sheet, form: LongForm) -> Iterator[ChannelRows]:
    """Each with its rows; raises DataError where one changes its unit."""
    at = [sheet.number(place) for place in (form.channel, form.unit) if place is not None]
    names, *units = _columns(sheet, dict.fromkeys(at, True)).values()
    for name in dict.fromkeys(names.tolist()):
        rows = np.flatnonzero(names == name)
        own = list(dict.fromkeys(units[0][rows].tolist())) if units else [""]
        if len(own) > 1:
            row = int(rows[int(np.argmax(units[0][rows] != own[0]))])
            raise DataError(f"{sheet.place(row)}: {name} is in {own[1]!r} here and in {own[0]!r} above; mend the file")
        yield ChannelRows(name or "unnamed", unit_in(own[0]) or unit_of(name), rows)


def _shared(sheet: Sheet, others: Sequence[int], channels: Sequence[ChannelRows]) -> list[int]:
    """The columns that are the same for each channel; none where others than constants differ."""
    if len({one.rows.size for one in channels}) > 1:
        return []
    texts = _columns(sheet, dict.fromkeys(others, True))
    first = channels[0].rows
    same = [at for at, own in texts.items() if all(np.array_equal(own[first], own[one.rows]) for one in channels)]
    lost = (texts[number][one.rows] for number in others if number not in same for one in channels)
    return [] if any(np.unique(own).size > 1 for own in lost) else same


def _columns(sheet: Sheet, columns: Mapping[int, bool]) -> dict[int, NDArray[np.generic]]:
    """Whole columns; raises DataError where there are too many rows."""
    parts, rows = list[list[NDArray[np.generic]]](), 0
    for batch in sheet.read(columns):
        parts.append([np.asarray(column) for column in batch])
        rows += len(batch[0]) if batch else 0
        if rows > MOST_ROWS:
            raise DataError(f"{sheet.where}: a row for each value, and more than {MOST_ROWS} of them; save it wide")
    return {number: np.concatenate([part[at] for part in parts]) for at, number in enumerate(columns)}


def _view(sheet: Sheet, name: str, others: Sequence[int], channels: Sequence[ChannelRows], value: int) -> Sheet:
    """The sheet with the ``others`` and a column a channel, all of the same rows as the first channel has."""
    places = [*((number, channels[0].rows) for number in others), *((value, one.rows) for one in channels)]

    def read(columns: Mapping[int, bool]) -> Iterator[Batch]:
        kinds = {(places[number][0], text) for number, text in columns.items()}
        found = {kind: _columns(sheet, dict([kind]))[kind[0]] for kind in sorted(kinds)}
        taken = [found[places[number][0], text][places[number][1]] for number, text in columns.items()]
        yield [own.tolist() if text else own for own, text in zip(taken, columns.values(), strict=True)]

    header = (*(sheet.header[number] for number in others), *(one.name for one in channels))
    units = (*(sheet.units[number] for number in others), *(one.unit for one in channels))
    return Sheet(
        sheet.path, name, header, units, read, sheet.facts, counted="row", unread=sheet.unread,
        rows=channels[0].rows.size,
    )  # fmt: skip
