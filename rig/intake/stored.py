"""Columns of an HDF5 file that stay in it until they are sliced, so that a long one is never held whole."""

from dataclasses import dataclass
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
            return data.fields(self.field)[rows]
        if self.line is None:
            return data[rows]
        return data[self.line, rows] if self.across else data[rows, self.line]


def fields_of(path: Path, item: Any) -> dict[str, StoredVector]:
    """The columns of a dataset whose rows have named fields."""
    return {name: StoredVector(path, item.name, len(item), field=name) for name in item.dtype.names}


def lines_of(path: Path, name: str, item: Any) -> dict[str, StoredVector]:
    """A vector as it is, a table by its columns ``name:1`` and so on; the longer side are the rows."""
    if item.ndim == 1:
        return {name: StoredVector(path, item.name, len(item))}
    across = item.shape[0] < item.shape[1]
    length, count = max(item.shape), min(item.shape)
    found = [StoredVector(path, item.name, length, line=line, across=across) for line in range(count)]
    return {name: found[0]} if count == 1 else {f"{name}:{number}": one for number, one in enumerate(found, start=1)}
