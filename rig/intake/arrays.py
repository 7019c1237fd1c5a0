"""MAT, HDF5, Parquet and MCAP files: columns that carry their own names."""

import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow.parquet as pq
import scipy.io
from mcap.exceptions import McapError
from mcap.reader import make_reader
from numpy.typing import NDArray
from scipy.io.matlab import MatlabFunction, MatlabOpaque, MatReadError, mat_struct

from rig.errors import DataError
from rig.intake.sheet import Batch, Column, Sheet
from rig.intake.units import unit_in, unit_of

Vectors = dict[str, NDArray[np.generic]]
HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
# ROS 2 types of eight bytes and less that stand one after another in a message, by their name in a ros2msg schema.
ROS_TYPES = {"int64": "<i8", "float64": "<f8", "uint64": "<u8", "int32": "<i4", "float32": "<f4", "uint32": "<u4"}
OBJECT_ADVICE = "; save objects of MATLAB as plain vectors, a table by table2struct(T, 'ToScalar', true)"


def open_mat(path: Path) -> list[Sheet]:
    """A sheet of the vectors of the file, and one of each struct; versions 5 to 7.3."""
    with path.open("rb") as file:
        head = file.read(520)
    if HDF5_MAGIC in head:
        return open_hdf5(path)
    try:
        found = scipy.io.loadmat(str(path), squeeze_me=True, struct_as_record=False, appendmat=False)
    except (MatReadError, ValueError, OSError, TypeError, NotImplementedError) as error:
        raise DataError(f"{path}: not readable as a MAT file ({error}); copy it again, or save it with -v7") from error
    groups: dict[str, dict[str, object]] = {}
    _sort("", {name: value for name, value in found.items() if not name.startswith("__")}, groups)
    return [_of_values(path, name, values) for name, values in groups.items()]


def _sort(name: str, values: Mapping[str, object], groups: dict[str, dict[str, object]]) -> None:
    """Structs into groups of their own, by the way to them."""
    flat = {}
    for key, value in values.items():
        if key == "_fieldnames":
            continue
        if isinstance(value, mat_struct):
            _sort(f"{name}.{key}".lstrip("."), vars(value), groups)
        else:
            flat[key] = value
    groups[name] = flat


def _of_values(path: Path, name: str, values: Mapping[str, object]) -> Sheet:
    vectors, facts, objects = Vectors(), dict[str, str](), list[str]()
    for key, value in values.items():
        if isinstance(value, MatlabOpaque | MatlabFunction):
            objects.append(key)
        elif isinstance(value, np.ndarray) and value.ndim in (1, 2) and value.size > 1 and value.dtype.kind in "biufO":
            vectors |= _split(key, value)
        else:
            facts[key] = str(value)
    unread = f"; {', '.join(objects)} cannot be read{OBJECT_ADVICE}" if objects else ""
    return _of_vectors(path, name, vectors, {}, facts, unread)


def _split(name: str, value: NDArray[np.generic]) -> Vectors:
    """A vector as it is, a table by its columns ``name:1`` and so on; the longer side are the rows."""
    if value.ndim == 1:
        return {name: value}
    rows = value if value.shape[0] >= value.shape[1] else value.T
    if rows.shape[1] == 1:
        return {name: rows[:, 0]}
    return {f"{name}:{number + 1}": rows[:, number] for number in range(rows.shape[1])}


def _of_vectors(
    path: Path, name: str, vectors: Vectors, units: Mapping[str, str], facts: Mapping[str, str], unread: str = ""
) -> Sheet:
    names = tuple(vectors)

    def read(columns: Mapping[int, bool]) -> Iterator[Batch]:
        lengths = {names[number]: len(vectors[names[number]]) for number in columns}
        if len(set(lengths.values())) > 1:
            said = ", ".join(f"{key} has {length}" for key, length in lengths.items())
            raise DataError(f"{path}{name and f', {name}'}: columns of one table differ in length: {said} values")
        yield [_values(f"{path}, {names[number]}", vectors[names[number]], text) for number, text in columns.items()]

    return Sheet(
        path, name, names, tuple(units.get(key, "") or unit_of(key) for key in names), read, facts, unread=unread
    )


def _values(where: str, vector: NDArray[np.generic], text: bool) -> Column:
    if text:
        return [item.decode() if isinstance(item, bytes) else str(item) for item in vector.tolist()]
    if vector.dtype.kind not in "biuf":
        raise DataError(f"{where}: holds no numbers; name another column")
    return vector


def open_hdf5(path: Path) -> list[Sheet]:
    """A sheet of each group that holds vectors or tables."""
    try:
        with h5py.File(path) as file:
            groups: dict[str, Any] = {}
            file.visititems(groups.__setitem__)
            return [
                _of_group(path, name, group)
                for name, group in {"": file, **groups}.items()
                if isinstance(group, h5py.Group) and not name.startswith("#")
            ]
    except OSError as error:
        raise DataError(f"{path}: not readable as HDF5 ({error}); copy it again") from error


def _of_group(path: Path, name: str, group: Any) -> Sheet:
    vectors, units, facts, objects = Vectors(), dict[str, str](), dict[str, str](), list[str]()
    for key, item in group.items():
        if not isinstance(item, h5py.Dataset):
            continue
        if "MATLAB_object_decode" in item.attrs:
            objects.append(key)
        elif item.dtype.names:
            vectors |= {field: item[field] for field in item.dtype.names}
        elif item.ndim in (1, 2) and item.size > 1 and item.dtype.kind in "biuf" and _is_numeric(item):
            vectors |= _split(key, item[()])
            units[key] = unit_in(_text(item.attrs.get("unit", item.attrs.get("units", ""))))
        elif item.size == 1:
            facts[key] = str(np.ravel(item[()])[0])
    unread = f"; {', '.join(objects)} cannot be read{OBJECT_ADVICE}" if objects else ""
    return _of_vectors(path, name, vectors, units, facts, unread)


def _is_numeric(item: Any) -> bool:
    return _text(item.attrs.get("MATLAB_class", "double")) not in ("char", "cell")


def _text(value: object) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)


def open_parquet(path: Path) -> list[Sheet]:
    """The one table of a Parquet file, a row group at a time."""
    try:
        schema = pq.ParquetFile(path).schema_arrow
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: not readable as Parquet ({error}); copy it again") from error
    stated = [(field.metadata or {}).get(b"unit", b"").decode() for field in schema]
    units = tuple(unit_in(unit) or unit_of(name) for unit, name in zip(stated, schema.names, strict=True))

    def read(columns: Mapping[int, bool]) -> Iterator[Batch]:
        with pq.ParquetFile(path) as file:
            for batch in file.iter_batches(columns=[schema.names[number] for number in columns]):
                yield [
                    _values(f"{path}, {schema.names[number]}", _array(batch[schema.names[number]]), text)
                    for number, text in columns.items()
                ]

    return [Sheet(path, "", tuple(schema.names), units, read)]


def _array(column: Any) -> NDArray[np.generic]:
    found = column.to_numpy(zero_copy_only=False)
    return np.asarray(found.astype("datetime64[ns]").astype(np.int64) if found.dtype.kind == "M" else found)


def open_mcap(path: Path) -> list[Sheet]:
    """A sheet of each topic whose messages are JSON or numbers in CDR, with ``log_time`` and ``publish_time`` [ns]."""
    bodies: dict[str, tuple[Any, Any, list[bytes], list[tuple[int, int]]]] = {}
    try:
        with path.open("rb") as file:
            for schema, channel, message in make_reader(file).iter_messages(log_time_order=False):
                kept = bodies.setdefault(channel.topic, (schema, channel, [], []))
                kept[2].append(message.data)
                kept[3].append((message.log_time, message.publish_time))
    except (McapError, OSError, ValueError) as error:
        raise DataError(
            f"{path}: not readable as MCAP ({error}); `rig repair` saves what is good in a recording"
        ) from error
    return [_of_topic(path, topic, *found) for topic, found in bodies.items()]


def _of_topic(
    path: Path, topic: str, schema: Any, channel: Any, bodies: list[bytes], times: list[tuple[int, int]]
) -> Sheet:
    decode = _DECODERS.get(channel.message_encoding)
    vectors = decode(schema, bodies) if decode else Vectors()
    unread = (
        ""
        if vectors
        else f"; its messages are {channel.message_encoding}, of which only JSON and plain numbers are read"
    )
    log_ns, publish_ns = np.array(times, np.int64).T
    units = {"log_time": "ns", "publish_time": "ns"}
    return _of_vectors(path, topic, {"log_time": log_ns, "publish_time": publish_ns, **vectors}, units, {}, unread)


def _of_json(_: Any, bodies: list[bytes]) -> Vectors:
    rows = [json.loads(body) for body in bodies]
    names = [name for name, value in rows[0].items() if isinstance(value, int | float | str)]
    return {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}


def _of_cdr(schema: Any, bodies: list[bytes]) -> Vectors:
    """Messages of numbers alone, little-endian, all of one size; none where there is anything else in them."""
    lines = (line.split("#")[0].split() for line in schema.data.decode().splitlines())
    fields = [(name, ROS_TYPES.get(kind, "")) for kind, name in (line for line in lines if len(line) == 2)]
    if not all(kind for _, kind in fields):
        return {}
    layout = np.dtype([(name, kind) for name, kind in fields], align=True)
    if any(len(body) < 4 + layout.itemsize for body in bodies):
        return {}
    rows = np.frombuffer(b"".join(body[4 : 4 + layout.itemsize] for body in bodies), layout)
    return {name: rows[name] for name, _ in fields}


_DECODERS: dict[str, Callable[[Any, list[bytes]], Vectors]] = {"json": _of_json, "cdr": _of_cdr}
