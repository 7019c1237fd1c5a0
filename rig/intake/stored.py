"""Columns of an HDF5 file that stay in it until they are sliced, so that a long one is never held whole."""

import math
import pickletools
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from rig.intake.roles import quantities_of
from rig.intake.sheet import DAMAGE, unreadable

HEAD_ROWS = 1000  # which tell a time from what it moves
# What attributes are called in which HDF5 writers put the unit and the names of columns.
UNIT_NAMES = ("unit", "units", "engineeringunit", "unit_string", "engineering_units", "column_units", "channel_units")
COLUMN_NAMES = ("columns", "column_names", "channels", "channel_names", "names", "fields", "labels")


@dataclass(frozen=True)
class StoredVector:
    """A dataset of one dimension, a field of one, or one line along the longer side of one of two dimensions."""

    path: Path
    dataset: str
    length: int
    field: str = ""
    line: int | None = None
    across: bool = False
    packing: tuple[float, ...] = ()

    def __len__(self) -> int:
        """How many values it has."""
        return self.length

    def __getitem__(self, rows: slice) -> NDArray[np.generic]:
        """Some of its values, read now; raises DataError where the file is damaged there."""
        try:
            with h5py.File(self.path) as file:
                return self._unpacked(np.asarray(self._of(file[self.dataset], rows)))
        except DAMAGE as error:
            raise unreadable(self.path, "HDF5", error) from error

    def _unpacked(self, found: NDArray[np.generic]) -> NDArray[np.generic]:
        """What packed numbers stand for, as the CF conventions have it (8.1: packed data, 2.5.1: fill values)."""
        if not self.packing:
            return found
        scale, offset, gap = self.packing
        return np.where(found == gap, math.nan, scale * found.astype(np.float64) + offset)

    def _of(self, data: Any, rows: slice) -> Any:
        if self.field:
            found = data.fields(self.field)[rows]
            return found if self.line is None else found[:, self.line]
        if self.line is None:
            return data[rows]
        return data[self.line, rows] if self.across else data[rows, self.line]


Vectors = dict[str, NDArray[np.generic] | StoredVector]


def columns_of(path: Path, group: Any, name: str) -> Vectors:
    """The columns of a dataset of rows with fields, of a vector or of a table of numbers; none of anything else."""
    item = group.get(name)  # None where a link leads nowhere
    if not isinstance(item, h5py.Dataset) or not (item.dtype.names or (item.ndim in (1, 2) and is_numbers(item))):
        return {}
    return dict(_fields_of(path, item)) if item.dtype.names else _lines_of(path, group, name)


def tables_in(datasets: Mapping[str, Vectors]) -> list[str]:
    """Which are tables of their own: of columns that others have too, or with a time each in the first of several."""
    wide = {name: own for name, own in datasets.items() if len(own) > 1}
    often = Counter(column for own in wide.values() for column in own)
    return _timed(wide) or [key for key, own in wide.items() if max(often[each] for each in own) > 1]


def _timed(wide: Mapping[str, Vectors]) -> list[str]:
    """All of them, where each is unnamed columns of which the first only rises, and none is called a channel's name."""
    firsts = [own.get(f"{name}:1") for name, own in wide.items()]
    if len(wide) < 2 or any(first is None for first in firsts) or any(map(quantities_of, wide)):
        return []
    rise = all((np.diff(first[:HEAD_ROWS].astype(np.float64)) > 0).all() for first in firsts if first is not None)
    return list(wide) if rise else []


def _fields_of(path: Path, item: Any) -> dict[str, StoredVector]:
    """The columns of a dataset whose rows have named fields; in a field of several, by a pickle that is only read."""
    found: dict[str, StoredVector] = {}
    for field in item.dtype.names:
        whole, size = StoredVector(path, item.name, len(item), field=field), math.prod(item.dtype[field].shape)
        said = _pickled(item.attrs.get(f"{field}_kind"))
        names = said if len(said) == size else [f"{field}:{number}" for number in range(1, size + 1)]
        several = {name: replace(whole, line=line) for line, name in enumerate(names)}
        found |= several if item.dtype[field].shape else {field: whole}
    return found


def _pickled(content: object) -> list[str]:
    try:
        found = pickletools.genops(content if isinstance(content, bytes) else b"")
        return [text for _, text, _ in found if isinstance(text, str)]
    except ValueError:
        return []


def _lines_of(path: Path, group: Any, name: str) -> Vectors:
    """A vector as it is, a table by its columns, ``name:1`` and so on without names; the longer side are the rows."""
    item = group[name]
    usual = {"scale_factor": 1.0, "add_offset": 0.0, "_FillValue": math.nan}
    told = [float(np.ravel(item.attrs.get(key, value))[0]) for key, value in usual.items()]
    packing = tuple(told) if usual.keys() & item.attrs.keys() else ()
    if item.ndim == 1:
        return named({name: StoredVector(path, item.name, len(item), packing=packing)}, _attribute(item, COLUMN_NAMES))
    across = item.shape[0] < item.shape[1]
    length, count = max(item.shape), min(item.shape)
    found = [StoredVector(path, item.name, length, line=line, across=across, packing=packing) for line in range(count)]
    split = {name: found[0]} if count == 1 else {f"{name}:{number}": one for number, one in enumerate(found, start=1)}
    return named(split, _attribute(item, COLUMN_NAMES) or _names_beside(group, name))


def units_of(item: Any) -> list[str]:
    """The units that its attributes state, one for all of its columns or one for each."""
    return _attribute(item, UNIT_NAMES)


def facts_of(item: Any) -> dict[str, str]:
    """Its attributes as texts."""
    return {name: " ".join(map(_text, np.ravel(value))) for name, value in item.attrs.items()}


def fact_of(item: Any) -> str:
    """A text, or a single number, of a file of MATLAB; empty of anything else."""
    if item.dtype.kind in "biuf" and _is_text(item):
        return "".join(map(chr, np.ravel(item[()])))
    return _text(np.ravel(item[()])[0]) if item.size == 1 else ""


def _names_beside(group: Any, key: str) -> list[str]:
    """The texts of the dataset that is called most like ``key``, as pandas puts `block0_items` beside its values."""
    texts = {name: item for name, item in group.items() if isinstance(item, h5py.Dataset) and item.dtype.kind in "SO"}
    lists = [name for name, item in texts.items() if item.ndim == 1 and h5py.check_string_dtype(item.dtype)]
    best = max(lists, key=lambda name: sum(map(str.__eq__, name, key)), default="")
    return [_text(one) for one in group[best][()]] if best else []


def _attribute(item: Any, names: Sequence[str]) -> list[str]:
    """The texts of the first attribute with one of these names, whatever its case; none without it."""
    known = {name.lower(): value for name, value in item.attrs.items()}
    value = next((known[name] for name in names if name in known), None)
    found = [] if value is None else [_text(one) for one in np.ravel(np.asarray(value, object))]
    return [one.strip() for text in found for one in text.split(",")] if len(found) == 1 else found


def is_numbers(item: Any) -> bool:
    """Whether it holds several numbers, and no letters as MATLAB stores them."""
    return bool(item.size > 1 and item.dtype.kind in "biuf" and not _is_text(item))


def _is_text(item: Any) -> bool:
    return _text(item.attrs.get("MATLAB_class", "double")) in ("char", "cell")


def _text(value: object) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)


def named(vectors: Mapping[str, NDArray[np.generic] | StoredVector], names: Sequence[str]) -> Vectors:
    """With other names, where there is one for each and none twice."""
    told = len(set(names)) == len(names) == len(vectors)
    return dict(zip(names, vectors.values(), strict=True)) if told else dict(vectors)
