"""Channels of a recording's inputs, for the numbers of what came in."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.channels import STREAMS
from rig.input_streams import channels_of
from rig.recording.converter import Array
from rig.recording.reader import Recording


class ChannelIn(NamedTuple):
    """A stream as it was recorded: times [s], values (n,) or (n, 3), and which of them are numbers vouched for."""

    name: str
    time_s: Array
    value: Array
    sound: NDArray[np.bool_]
    unit: str


def channels_in(recording: Recording) -> Iterator[ChannelIn]:
    """Each channel of each input that has rows, named after both."""
    for stream in recording.streams[len(STREAMS) :]:
        rows = recording.tables[stream.name]
        time_s = (rows["capture_ns"] - rows["capture_ns"][:1].sum()) * 1e-9
        for channel in channels_of(stream) if len(rows) else ():
            value = rows[channel]
            yield ChannelIn(f"{stream.name}.{channel}", time_s, value, np.isfinite(value), stream.units[channel][0])
