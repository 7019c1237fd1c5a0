"""Streams as Arrow tables with their units: what Parquet, CSV, HDF5 and MAT are made of."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from rig.channels import EVENT, FORCE, Stream
from rig.config.force_map import CHANNELS, UNIT, ForceMap, Matrix
from rig.errors import DataError
from rig.recording.files import whole_file
from rig.recording.reader import Recording

FORCE_FIELDS = ("fx_N", "fy_N", "fz_N")


def filled(recording: Recording) -> Iterator[tuple[Stream, pa.Table]]:
    """Every stream that has rows, as ``arrow_table`` gives it."""
    for stream in recording.streams:
        if len(recording.events if stream is EVENT else recording.tables[stream.name]):
            yield stream, arrow_table(recording, stream)


def arrow_table(recording: Recording, stream: Stream) -> pa.Table:
    """The stream with ``unit`` and ``meaning`` on each field and the recording's metadata, as JSON, on the whole."""
    kinds = {int: pa.int64(), float: pa.float64(), str: pa.string()}
    fields = [
        pa.field(name, kinds[kind], metadata=dict(zip(("unit", "meaning"), stream.units[name], strict=True)))
        for name, kind in stream.kinds.items()
    ]
    columns = (
        [[event[index] for event in recording.events] for index in range(len(fields))]
        if stream is EVENT
        else [np.ascontiguousarray(recording.tables[stream.name][field.name]) for field in fields]
    )
    schema = pa.schema(fields, {name: json.dumps(values) for name, values in recording.metadata.items()})
    return pa.table(columns, schema=schema)


def compression_N(recording: Recording) -> NDArray[np.float64]:
    """Compressive force of every force row [N], by the recording's calibration; no zero is taken off."""
    rows = recording.tables[FORCE.name]
    forces = (rows[field].astype(np.float64) for field in FORCE_FIELDS)
    return np.asarray(force_map(recording).compression_N(*forces))


def force_map(recording: Recording) -> ForceMap:
    """How compression is read from the recording's force rows; raises DataError where its metadata do not say it.

    A recording made without a calibration has no matrix, and compression is its channel with its sign.
    """
    known, name = recording.metadata.get("calibration", {}), recording.path.stem
    channel, compression = known.get("force_axis", "fz"), known.get("compression", "negative")
    if channel not in CHANNELS:
        raise DataError(f"{name}: calibration force_axis is {channel!r}; it must be fx, fy or fz")
    if compression not in ("positive", "negative"):
        raise DataError(f"{name}: calibration compression is {compression!r}; it must be positive or negative")
    return ForceMap(
        channel, "positive" if compression == "positive" else "negative", _matrix(name, known.get("matrix", ""))
    )


def _matrix(name: str, text: str) -> Matrix:
    try:
        return TypeAdapter(Matrix).validate_json(text, strict=True) if text else UNIT
    except ValidationError as error:
        raise DataError(f"{name}: calibration matrix is {text!r}; it must be three rows of three numbers") from error


def write_parquet(recording: Recording, folder: Path, name: str) -> list[Path]:
    """``NAME.STREAM.parquet`` in ``folder`` for every stream with rows, each replaced in one step; their paths."""
    paths = []
    for stream, table in filled(recording):
        path = folder / f"{name}.{stream.name}.parquet"
        with whole_file(path, overwrite=True) as scratch:
            pq.write_table(table, scratch, compression="zstd")
        paths.append(path)
    return paths
