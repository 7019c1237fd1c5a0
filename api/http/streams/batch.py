"""Rows into the bytes of one batch, and many samples into few rows of which none hides a peak.

A batch is little-endian: a header of 24 bytes (``HEADER``: channel u16, columns u16, seq u32, t0 i64 [ns], n u32,
covered u32), then ``n`` i32 times [ns] after t0, then one float32 column of ``n`` values after the other.
"""

import struct
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from api.http.streams.history import Rows

HEADER = struct.Struct("<HHIqII")
LAYOUT = (
    "channel u16, columns u16, seq u32, t0_ns i64, n u32, covered u32, n times i32 [ns] after t0_ns, columns of n f32"
)
SEQ_MASK = 0xFFFF_FFFF
# A time after t0 is an i32 in ns.
LONGEST_NS = 2_000_000_000
# How late a sample may come to the service; after that a part that got no more is over.
LATE_NS = 200_000_000
Decimation = Literal["none", "last", "minmax"]


def columns_of(fields: Sequence[str], decimation: Decimation) -> list[str]:
    """Names of a batch's columns."""
    if decimation != "minmax":
        return list(fields)
    return [f"{field}.{end}" for field in fields for end in ("min", "max")]


def encoded(channel: int, rows: Rows, fields: Sequence[str], decimation: Decimation, starts: NDArray[np.intp]) -> bytes:
    """One batch of ``rows``, which begin anew at each of ``starts``, the first at 0."""
    times = rows["time_ns"][starts]
    columns = [column for field in fields for column in _decimated(rows[field], decimation, starts)]
    head = HEADER.pack(channel, len(columns), int(rows["seq"][0]) & SEQ_MASK, int(times[0]), len(starts), len(rows))
    return b"".join([head, (times - times[0]).astype("<i4").tobytes(), *(column.tobytes() for column in columns)])


def _decimated(
    values: NDArray[np.float32], decimation: Decimation, starts: NDArray[np.intp]
) -> list[NDArray[np.float32]]:
    match decimation:
        case "none":
            return [values]
        case "last":
            return [values[np.append(starts[1:], len(values)) - 1]]
        case "minmax":  # a value that is not known hides none that is
            return [np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)]


def parts(times_ns: NDArray[np.int64], width_ns: int) -> NDArray[np.intp]:
    """Where each part of ``width_ns`` on the clock's own grid begins; with 0 each sample is one."""
    if not width_ns:
        return np.arange(len(times_ns))
    numbers = times_ns // width_ns
    return np.flatnonzero(np.diff(numbers, prepend=numbers[0] - 1))


def over(
    times_ns: NDArray[np.int64], starts: NDArray[np.intp], width_ns: int, now_ns: int
) -> tuple[NDArray[np.intp], int]:
    """The parts to which no sample can come any more, and how many rows they have."""
    if not width_ns or (int(times_ns[-1]) // width_ns + 1) * width_ns + LATE_NS <= now_ns:
        return starts, len(times_ns)
    return starts[:-1], int(starts[-1])
