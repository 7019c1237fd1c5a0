"""Slots of the ring as one table: samples are taken out of it by stream, not one by one."""

import contextlib
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.channels import Stream

SLOT = 256
TRAILER = struct.Struct("<QHH")
BODY_LIMIT = SLOT - TRAILER.size
SLOT_TYPE = np.dtype(
    {
        "names": ["body", "number", "stream", "size"],
        "formats": [(np.uint8, BODY_LIMIT), "<u8", "<u2", "<u2"],
        "offsets": [0, BODY_LIMIT, BODY_LIMIT + 8, BODY_LIMIT + 10],
        "itemsize": SLOT,
    }
)
Slots = NDArray[np.void]


def holding(slots: Slots, stream: Stream) -> NDArray[np.bool_]:
    """Which of ``slots`` hold a whole row of ``stream``."""
    found: NDArray[np.bool_] = slots["stream"] == stream.id
    return found if stream.has_text else found & (slots["size"] == stream.dtype.itemsize)


def rows_of(slots: Slots, stream: Stream) -> NDArray[np.void]:
    """The rows of ``stream`` among ``slots``, as its table; streams with text have none."""
    # As so many bytes: one copy a row.
    bodies = slots["body"][:, : stream.dtype.itemsize].view(f"V{stream.dtype.itemsize}")[:, 0]
    return bodies[holding(slots, stream)].view(stream.dtype)


def bodies_of(slots: Slots, stream: Stream) -> Iterator[tuple[bytes, tuple[Any, ...]]]:
    """Bodies and rows of a ``stream`` with text among ``slots``; those cut short are left out."""
    for slot in slots[holding(slots, stream)]:
        body = slot["body"][: slot["size"]].tobytes()
        with contextlib.suppress(struct.error, IndexError):
            yield body, stream.unpack(body)


def texts_of(slots: Slots, stream: Stream) -> Iterator[tuple[Any, ...]]:
    """The rows of a ``stream`` with text among ``slots``; those cut short are left out."""
    return (row for _, row in bodies_of(slots, stream))
