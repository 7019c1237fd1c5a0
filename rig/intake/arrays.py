"""MAT, HDF5, Parquet, MCAP and lines of JSON: columns that carry their own names."""

import json
import re
import struct
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from numpy.typing import NDArray
from scipy.io.matlab import MatlabFunction, MatlabOpaque, MatReadError, MatReadWarning, mat_struct
from zstandard import ZstdError

from rig.errors import DataError
from rig.intake.sheet import DAMAGE, Batch, Column, Sheet, refuse_large, unreadable
from rig.intake.stored import UNIT_NAMES, Vectors, columns_of, fact_of, facts_of, is_numbers, named, tables_in, units_of
from rig.intake.text import bytes_of
from rig.intake.units import ros_unit, unit_in, unit_of

Texts = Mapping[str, str]
Clocks = Mapping[str, tuple[float, ...]]
BATCH_ROWS = 1 << 18  # two megabytes a column
HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
# What memory of 1.5 GB holds: vectors as they are, messages with what Python needs for each, and texts as numbers.
LARGEST_MAT_B, LARGEST_MCAP_B, LARGEST_LINES_B = 1e9, 0.4e9, 0.25e9
PIECES = "save it as Parquet, HDF5 or CSV, which are read piece by piece, or in parts"
# Time, force and position.
FEWEST_CHANNELS = 3
# What LabVIEW says of the times of a channel, in s.
WAVEFORM = ("wf_increment", "wf_start_offset")
# Longer lists in a message are images and clouds of points.
LONGEST_LIST = 64
OBJECT_ADVICE = "; save objects of MATLAB as plain vectors, a table by table2struct(T, 'ToScalar', true)"
# What a struct calls the channel that it holds.
CHANNEL_NAMES = ("name", "label", "title", "channel", "signal")


def open_mat(path: Path) -> list[Sheet]:
    """A sheet of the vectors of the file, and one of each struct; versions 5 to 7.3."""
    try:
        with path.open("rb") as file:
            head = file.read(520)
        if HDF5_MAGIC in head:
            return open_hdf5(path)
        refuse_large(path, LARGEST_MAT_B, "save it with -v7.3, which is read piece by piece")
        with warnings.catch_warnings():  # of two objects in one file, which are named when they are asked for
            warnings.simplefilter("ignore", MatReadWarning)
            found = scipy.io.loadmat(str(path), squeeze_me=True, struct_as_record=False, appendmat=False)
    except (*DAMAGE, MatReadError) as error:
        raise unreadable(path, "a MAT file", error, "copy it again, or save it with -v7") from error
    groups: dict[str, dict[str, object]] = {}
    _sort("", {name: value for name, value in found.items() if not name.startswith("__")}, groups)
    _join_beside(groups)
    _join(groups)
    groups = {name: values for group in groups.items() for name, values in _apart(*group)}
    titles = list(_titles(groups))
    return [_of_values(path, name, {**_facts_around(name, groups), **own}, titles) for name, own in groups.items()]


def _facts_around(name: str, groups: Mapping[str, Mapping[str, object]]) -> dict[str, object]:
    """Texts and single numbers of the structs that hold this one, and of those in it without vectors (`DataInfo`)."""
    inner = [own for own in groups if own.rpartition(".")[0] == name != own]
    within = [own for own in inner if max(map(_sized, groups[own].values()), default=0) < 2]  # numbers
    starts = {own: f"{own.rpartition('.')[2]}." if len(within) > 1 else "" for own in within}
    starts |= {name[: match.start()]: "" for match in re.finditer("[.]", name)}
    found = [(start + key, value) for own, start in starts.items() for key, value in groups.get(own, {}).items()]
    return {key: value for key, value in found if isinstance(value, str | int | float)}


def _titles(groups: Mapping[str, Mapping[str, object]]) -> Iterator[list[str]]:
    """The lists of texts in the file, which may be the names of a matrix's columns."""
    for value in (value for values in groups.values() for value in values.values()):
        if isinstance(value, np.ndarray) and value.ndim == 1 and all(isinstance(item, str) for item in value):
            yield [str(item).strip() for item in value]


def _sort(name: str, values: Mapping[str, object], groups: dict[str, dict[str, object]]) -> None:
    """Structs, and the members of arrays of structs and of cells, into groups of their own, by the way to them."""
    flat = {}
    for key, value in values.items():
        if key == "_fieldnames":
            continue
        inner = f"{name}.{key}".lstrip(".")
        if isinstance(value, mat_struct):
            _sort(inner, vars(value), groups)
        elif isinstance(value, np.ndarray) and value.size and isinstance(value.flat[0], mat_struct | np.ndarray):
            for number, item in enumerate(value.flat, 1):
                _sort(f"{inner}({number})", vars(item) if isinstance(item, mat_struct) else {key: item}, groups)
        else:
            flat[key] = value
    groups[name] = flat


def _join(groups: dict[str, dict[str, object]]) -> None:
    """Structs of one vector, as Simulink nests signals, into the struct above them that has others of its length."""
    for name in sorted(groups, key=len, reverse=True):
        own = {key: value for key, value in groups[name].items() if _sized(value) > 1}
        above = [name[: match.start()] for match in re.finditer(r"[.]", name)][::-1]
        sizes = {_sized(value) for value in own.values()}
        home = next((up for up in above if any(_sized(value) in sizes for value in groups.get(up, {}).values())), None)
        if home is not None and 1 in (len(own), sum(_sized(value) > 1 for value in groups[home].values())):
            groups[home] |= {f"{name[len(home) + 1 :]}.{key}": value for key, value in own.items()}
            del groups[name]


def _join_beside(groups: dict[str, dict[str, object]]) -> None:
    """Structs of one vector beside each other, as channels with their units, into the one above, if alike in length."""
    alike: dict[tuple[str, int], dict[str, str]] = {}
    for name, values in groups.items():
        vectors = [key for key, value in values.items() if _sized(value) > 1]
        if len(vectors) == 1 and _channel(name, values):
            alike.setdefault((name.rpartition(".")[0], _sized(values[vectors[0]])), {})[name] = vectors[0]
    for (above, _), channels in alike.items():
        for name, key in channels.items() if len(channels) >= FEWEST_CHANNELS else ():
            values = groups.pop(name)
            unit = next((f" ({value})" for fact, value in values.items() if fact.lower() in UNIT_NAMES), "")
            groups[above][_channel(name, values) + unit] = values[key]


def _apart(name: str, values: Mapping[str, object]) -> Iterator[tuple[str, dict[str, object]]]:
    """The struct, and with all else in it each matrix that is a table of its own."""
    matrices = {key: value for key, value in values.items() if isinstance(value, np.ndarray) and value.ndim == 2}
    own = tables_in({key: _split(key, value) for key, value in matrices.items() if value.dtype.kind in "biuf"})
    rest = {key: value for key, value in values.items() if key not in own}
    yield name, rest
    yield from ((f"{name}.{key}".lstrip("."), {**rest, "matrix": values[key]}) for key in own)


def _channel(name: str, values: Mapping[str, object]) -> str:
    """What a struct is called by its place; where that is a number, what it calls itself."""
    own = (value for fact, value in values.items() if fact.lower() in CHANNEL_NAMES and isinstance(value, str))
    return next(own, "") if name.endswith(")") else name.rpartition(".")[2]


def _sized(value: object) -> int:
    return value.size if isinstance(value, np.ndarray) else 1


def _of_values(path: Path, name: str, values: Mapping[str, object], titles: Sequence[Sequence[str]]) -> Sheet:
    vectors, units, facts, objects = Vectors(), dict[str, str](), dict[str, str](), list[str]()
    for key, value in values.items():
        if isinstance(value, MatlabOpaque | MatlabFunction):
            objects.append(_object_name(key, value))
        elif isinstance(value, np.ndarray) and value.ndim in (1, 2) and value.size > 1 and value.dtype.kind in "biufO":
            split = _split(key, value)
            alike = [own for own in titles if len(own) == len(split) > 1]
            stated = next((own for own in alike if all(map(unit_in, own))), [])
            names = next((own for own in alike if vectors.keys().isdisjoint(own) and own != stated), stated)
            columns = named(split, names)
            vectors |= columns
            units |= zip(columns, stated, strict=False)
        else:
            facts[key] = str(value)
    unread = f"; {', '.join(objects)} cannot be read{OBJECT_ADVICE}" if objects else ""
    return _of_vectors(path, name, vectors, units, facts, unread)


def _object_name(name: str, value: Any) -> str:
    """What the object is called and its class; the name of one stands in itself, and scipy gives it as None."""
    if not isinstance(value, MatlabOpaque) or not value.size:
        return name
    inner = np.ravel(value)[0]
    return f"{inner['s0'].decode()} (a {inner['s2'].decode()})"


def _split(name: str, value: NDArray[np.generic]) -> Vectors:
    """A vector as it is, a table by its columns ``name:1`` and so on; the longer side are the rows."""
    lines = np.atleast_2d(value)
    lines = lines if lines.shape[0] < lines.shape[1] else lines.T
    return {f"{name}:{number}" if len(lines) > 1 else name: line for number, line in enumerate(lines, start=1)}


def _of_vectors(
    path: Path, name: str, vectors: Vectors, units: Texts, facts: Texts, unread: str = "", clocks: Clocks | None = None
) -> Sheet:
    names = tuple(vectors)

    def read(columns: Mapping[int, bool]) -> Iterator[Batch]:
        lengths = {names[number]: len(vectors[names[number]]) for number in columns}
        if len(set(lengths.values())) > 1:
            said = ", ".join(f"{key} has {length}" for key, length in lengths.items())
            raise DataError(f"{path}{name and f', {name}'}: columns of one table differ in length: {said} values")
        if clocks and len({clocks[key] for key in lengths if key in clocks}) > 1:
            said = f"{', '.join(lengths)} differ in {' or '.join(WAVEFORM)}"
            raise DataError(f"{path}{name and f', {name}'}: {said}; save each with a column of its times")
        for start in range(0, max(*lengths.values(), 1), BATCH_ROWS):
            rows = slice(start, start + BATCH_ROWS)
            yield [_values(f"{path}, {names[at]}", vectors[names[at]][rows], text) for at, text in columns.items()]

    return Sheet(
        path, name, names, tuple(unit_in(units.get(key, "")) or unit_of(key) for key in names), read, facts,
        unread=unread, rows=max(map(len, vectors.values()), default=0),
    )  # fmt: skip


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
            # MATLAB's own cells, and the indexes that PyTables makes.
            found = {"": file} | {name: group for name, group in groups.items() if not re.match("#|(.*/)?_i_", name)}
            known = [(path, name, group) for name, group in found.items() if isinstance(group, h5py.Group)]
            return [sheet for group in known for sheet in (*_of_group(*group), *_members(*group))]
    except DAMAGE as error:
        raise unreadable(path, "HDF5", error) from error


def _members(path: Path, name: str, group: Any) -> Iterator[Sheet]:
    """A sheet of each struct in an array of them, whose fields MATLAB stores as references to their values."""
    fields = {key: item for key, item in group.items() if isinstance(item, h5py.Dataset)}
    plain = (key for key, item in fields.items() if "MATLAB_object_decode" not in item.attrs)
    fields = {key: fields[key] for key in plain if h5py.check_ref_dtype(fields[key].dtype)}
    for number in range(min((item.size for item in fields.values()), default=0)):
        items = {key: group.file[np.ravel(item[()])[number]] for key, item in fields.items()}
        items = {key: item for key, item in items.items() if isinstance(item, h5py.Dataset)}
        numbers = [(key, item[()]) for key, item in items.items() if is_numbers(item)]
        vectors = {key: column for own in numbers for key, column in _split(*own).items()}
        facts = {key: fact_of(item) for key, item in items.items()}
        said = {key: fact for key, fact in facts.items() if fact}
        yield _of_vectors(path, f"{name}({number + 1})", vectors, {}, said)


def _of_group(path: Path, name: str, group: Any) -> Iterator[Sheet]:
    """A sheet of its vectors, and one of each dataset that is a table of its own, with the vectors beside it."""
    own = tables_in({key: columns_of(path, group, key) for key in group})
    rest = [key for key in group if key not in own]
    yield _of_items(path, name, group, rest)
    yield from (_of_items(path, f"{name}/{key}".lstrip("/"), group, [*rest, key], f"{key}:") for key in own)


def _of_items(path: Path, name: str, group: Any, keys: Sequence[str], before: str = "") -> Sheet:
    """The sheet of these datasets of the group, without what stands ``before`` the numbers of its columns."""
    vectors, units, objects, clocks = Vectors(), dict[str, str](), list[str](), dict[str, tuple[float, ...]]()
    facts = facts_of(group)
    found = {key: group.get(key) for key in keys}  # None where a link leads nowhere
    for key, item in ((key, item) for key, item in found.items() if isinstance(item, h5py.Dataset)):
        if "MATLAB_object_decode" in item.attrs or h5py.check_ref_dtype(item.dtype):
            objects.append(key)
        elif columns := {own.removeprefix(before): column for own, column in columns_of(path, group, key).items()}:
            vectors |= columns
            if WAVEFORM[0] in item.attrs:
                clocks |= dict.fromkeys(columns, tuple(float(item.attrs.get(name, 0)) for name in WAVEFORM))
            own = units_of(item)
            units |= zip(item.dtype.names or columns, own * len(columns) if len(own) == 1 else own, strict=False)
        elif fact := fact_of(item):
            facts[key] = fact
        facts |= facts_of(item)
    if len(set(clocks.values())) > 1:  # no rate of all
        facts = {key: value for key, value in facts.items() if key not in WAVEFORM}
    unread = f"; {', '.join(objects)} cannot be read{OBJECT_ADVICE}" if objects else ""
    return _of_vectors(path, name, vectors, units, facts, unread, clocks)


def open_parquet(path: Path) -> list[Sheet]:
    """The one table of a Parquet file, a row group at a time."""
    try:
        with pq.ParquetFile(path) as file:
            schema, rows = file.schema_arrow, file.metadata.num_rows
    except DAMAGE as error:
        raise unreadable(path, "Parquet", error) from error
    stated = _stated_units(schema)
    units = tuple(
        "ns" if pa.types.is_temporal(own.type) else stated.get(own.name) or unit_of(own.name) for own in schema
    )

    def read(columns: Mapping[int, bool]) -> Iterator[Batch]:
        names = [schema.names[number] for number in columns]
        try:
            with pq.ParquetFile(path, page_checksum_verification=True) as file:
                for batch in file.iter_batches(columns=names):
                    yield [
                        _values(f"{path}, {name}", _array(batch[name]), text)
                        for name, text in zip(names, columns.values(), strict=True)
                    ]
        except DAMAGE as error:
            raise unreadable(path, "Parquet", error) from error

    return [Sheet(path, "", tuple(schema.names), units, read, rows=rows)]


def _stated_units(schema: pa.Schema) -> dict[str, str]:
    """The unit of each column that its own metadata state, or those of the whole: ``force_unit``, a table in JSON."""
    own = [(f"unit.{field.name}", key, value) for field in schema for key, value in (field.metadata or {}).items()]
    said = [(name, value) for name, key, value in own if key.decode().lower() in UNIT_NAMES]
    for name, value in [*((key.decode(), value) for key, value in (schema.metadata or {}).items()), *said]:
        try:
            said += [(way, str(unit).encode()) for way, unit in _flat(name, json.loads(value))]
        except ValueError:
            said.append((name, value))
    parted = [(re.split(r"\.|_?units?_?", name, flags=re.IGNORECASE), value) for name, value in said if "unit" in name]
    return {name: unit for parts, value in parted for name in parts if (unit := unit_in(value.decode()))}


def _array(column: Any) -> NDArray[np.generic]:
    found = (column.cast(pa.float64()) if pa.types.is_decimal(column.type) else column).to_numpy(zero_copy_only=False)
    return np.asarray(found.astype(f"{found.dtype.kind}8[ns]").astype(np.int64) if found.dtype.kind in "Mm" else found)


def open_mcap(path: Path) -> list[Sheet]:
    """A sheet of each topic whose messages are JSON or numbers in CDR, with ``log_time`` and ``publish_time`` [ns]."""
    bodies: dict[str, tuple[Any, Any, list[bytes], list[tuple[int, int]]]] = {}
    refuse_large(path, LARGEST_MCAP_B, PIECES)
    try:
        with path.open("rb") as file:
            for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages(log_time_order=False):
                kept = bodies.setdefault(channel.topic, (schema, channel, [], []))
                kept[2].append(message.data)
                kept[3].append((message.log_time, message.publish_time))
        return [_of_topic(path, topic, *found) for topic, found in bodies.items()]
    except (*DAMAGE, McapError, ZstdError) as error:
        raise unreadable(path, "MCAP", error, "`rig repair` saves what is good in a recording") from error


def _of_topic(
    path: Path, topic: str, schema: Any, channel: Any, bodies: list[bytes], times: list[tuple[int, int]]
) -> Sheet:
    decode = _DECODERS.get(channel.message_encoding)
    vectors = decode(schema, bodies) if decode else Vectors()
    unread = f"; its messages are {channel.message_encoding}, of which only JSON and plain numbers are read"
    log_ns, publish_ns = np.array(times, np.int64).T
    units = {"log_time": "ns", "publish_time": "ns", **{name: ros_unit(name) for name in vectors if decode is _of_cdr}}
    found = {"log_time": log_ns, "publish_time": publish_ns, **vectors}
    return _of_vectors(path, topic, found, units, {}, "" if vectors else unread)


def open_json_lines(path: Path) -> list[Sheet]:
    """The one table of a file with a JSON object a line."""
    rows = list[dict[str, object]]()
    refuse_large(path, LARGEST_LINES_B, PIECES)
    try:
        with bytes_of(path) as file:
            for number, line in enumerate(file, 1):
                place = f"{path} line {number}"
                rows += [dict(_flat("", json.loads(line)))] if line.strip() else []
    except json.JSONDecodeError as error:
        raise DataError(f"{place}: no JSON object ({error.msg} in column {error.colno}); mend the line") from error
    except DAMAGE as error:
        raise unreadable(path, "lines of JSON", error) from error
    return [_of_vectors(path, "", _of_rows(rows), {}, {})] if rows else []


def _of_json(_: Any, bodies: list[bytes]) -> Vectors:
    return _of_rows([dict(_flat("", json.loads(body))) for body in bodies])


def _of_rows(rows: Sequence[Mapping[str, object]]) -> Vectors:
    """The numbers and texts that any of the rows has; nothing where one has none."""
    names = dict.fromkeys(name for row in rows for name, value in row.items() if isinstance(value, int | float | str))
    found = {name: [row.get(name) for row in rows] for name in names}
    return {name: np.array([np.nan if value is None else value for value in values]) for name, values in found.items()}


def _flat(name: str, value: object) -> Iterator[tuple[str, object]]:
    """The plain values in nested tables, messages and short lists, by the way to them."""
    items = _items(value)
    if items is None:
        yield name, value
    for key, item in items or ():
        yield from _flat(f"{name}.{key}".lstrip("."), item)


def _items(value: object) -> Iterable[tuple[object, object]] | None:
    if isinstance(value, dict):
        return value.items()
    if isinstance(value, list | tuple):
        return enumerate(value) if len(value) <= LONGEST_LIST else ()
    names = getattr(value, "__slots__", None)
    return None if names is None else [(name, getattr(value, name)) for name in names]


def _of_cdr(schema: Any, bodies: list[bytes]) -> Vectors:
    """Messages of ROS 2; none where the schema or the bytes are not as ROS has them."""
    try:
        decode = DecoderFactory().decoder_for("cdr", schema)
        return _of_rows([dict(_flat("", decode(body))) for body in bodies]) if decode else {}
    except (McapError, ValueError, IndexError, struct.error):
        return {}


_DECODERS: dict[str, Callable[[Any, list[bytes]], Vectors]] = {"json": _of_json, "cdr": _of_cdr}
