"""Columns of an HDF5 file that stay in it until they are sliced, so that a long one is never held whole."""

import math
import pickletools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from rig.intake.sheet import DAMAGE, unreadable


@dataclass(frozen=True)
class StoredVector:
    """A dataset of one dimension, a field of one, or one line along the longer side of one of two dimensions."""

    path: Path
    dataset: str
    length: int
    field: str = ""
    line: int | None = None
    across: bool = False

    def __len__(self) -> int:
        """How many values it has."""
        return self.length

    def __getitem__(self, rows: slice) -> NDArray[np.generic]:
        """Some of its values, read now; raises DataError where the file is damaged there."""
        try:
            with h5py.File(self.path) as file:
                return np.asarray(self._of(file[self.dataset], rows))
        except DAMAGE as error:
            raise unreadable(self.path, "HDF5", error) from error

    def _of(self, data: Any, rows: slice) -> Any:
        if self.field:
            found = data.fields(self.field)[rows]
            return found if self.line is None else found[:, self.line]
        if self.line is None:
            return data[rows]
        return data[self.line, rows] if self.across else data[rows, self.line]


def fields_of(path: Path, item: Any) -> dict[str, StoredVector]:
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


def lines_of(path: Path, name: str, item: Any) -> dict[str, StoredVector]:
    """A vector as it is, a table by its columns ``name:1`` and so on; the longer side are the rows."""
    if item.ndim == 1:
        return {name: StoredVector(path, item.name, len(item))}
    across = item.shape[0] < item.shape[1]
    length, count = max(item.shape), min(item.shape)
    found = [StoredVector(path, item.name, length, line=line, across=across) for line in range(count)]
    return {name: found[0]} if count == 1 else {f"{name}:{number}": one for number, one in enumerate(found, start=1)}
