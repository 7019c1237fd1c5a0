"""Streams of inputs: what a switch, a glove or a physiological stream brings, recorded beside the streams of the bench.

Each input of `rig.toml` is a stream of its own, under its own name, laid out by the channels that it declares. A
recording carries the layouts among its metadata, so that whoever reads it needs neither configuration nor product.
"""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from rig.channels import BY_NAME, STAMP, STREAMS, Stream

METADATA = "inputs"
# Numbers of streams on the ring: those of the bench come before, and the ring has 64.
FIRST_ID, MOST_INPUTS = 16, 16
# A slot of the ring takes 244 bytes: eight words that every input has, and these.
MOST_CHANNELS = 22
# What ROS 2 takes for a topic and for a field, since recordings carry such schemas; a unit may have capitals.
NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
CHANNEL_NAME = re.compile(r"[a-z][a-z0-9]*(_[A-Za-z0-9]+)*")
LONGEST_NAME = 24  # of a topic in a table on a terminal
_CLOCK = {
    "device_ns": ("ns", "the sender's own time stamp, or the device's own counter; 0 where it has none"),
    "correction_ns": ("ns", "what was added to device_ns to give capture_ns"),
    "uncertainty_ns": ("ns", "half of the interval in which the correction is known to lie; -1: nobody knows"),
}
_STATE = {
    "status": ("1", "status word of the product, as its page says; 0: nothing to say"),
    "valid": ("1", "1 if all channels are numbers that the device vouches for"),
}


class InputChannel(NamedTuple):
    """One quantity of an input; its name ends in its unit, as everywhere."""

    name: str
    unit: str
    meaning: str


class InputSample(NamedTuple):
    """One reading of an input: all of its channels at one time."""

    seq: int
    capture_ns: int
    arrival_ns: int
    device_ns: int
    correction_ns: int
    uncertainty_ns: int
    values: tuple[float, ...]
    status: int
    valid: int

    @property
    def row(self) -> tuple[int | float, ...]:
        """As its stream packs it."""
        return *self[:6], *self.values, self.status, self.valid


def input_stream(number: int, name: str, channels: Sequence[InputChannel]) -> Stream:
    """The stream of input ``name``, the ``number``-th of a configuration, counted from 0."""
    of_values = {channel.name: (channel.unit, channel.meaning) for channel in channels}
    units = STAMP | _CLOCK | of_values | _STATE
    kinds = [(field, float if field in of_values else int) for field in units]
    row = NamedTuple(f"{name.title().replace('_', '')}Row", kinds)  # type: ignore[misc]
    return Stream(FIRST_ID + number, name, row, units)


def channels_of(stream: Stream) -> tuple[str, ...]:
    """Names of an input's channels."""
    return tuple(name for name in stream.units if name not in taken_fields())


def taken_names() -> frozenset[str]:
    """Names that no input can have, since a stream of the bench has them."""
    return frozenset(BY_NAME)


def taken_fields() -> frozenset[str]:
    """Names that no channel can have."""
    return frozenset(STAMP | _CLOCK | _STATE)


def input_streams(inputs: Mapping[str, Sequence[InputChannel]]) -> tuple[Stream, ...]:
    """Streams of all ``inputs`` of a configuration (name to channels), in its order."""
    return tuple(input_stream(number, name, channels) for number, (name, channels) in enumerate(inputs.items()))


def layouts(inputs: Mapping[str, Sequence[InputChannel]]) -> dict[str, str]:
    """What a recording keeps of them: the channels of each, JSON, by number and name."""
    return {f"{number:02d} {name}": json.dumps(channels) for number, (name, channels) in enumerate(inputs.items())}


def all_streams(metadata: Mapping[str, Mapping[str, str]]) -> tuple[Stream, ...]:
    """Every stream that a recording with such ``metadata`` can hold: the bench's, then its inputs'."""
    return *STREAMS, *_recorded(metadata.get(METADATA, {}))


def _recorded(kept: Mapping[str, str]) -> Iterator[Stream]:
    """Streams of inputs by their layouts; what is no layout, of a file that somebody else made, gives none."""
    for key, text in sorted(kept.items()):
        number, _, name = key.partition(" ")
        channels = _channels(text)
        if number.isdecimal() and int(number) < MOST_INPUTS and NAME.fullmatch(name) and channels:
            yield input_stream(int(number), name, channels)


def _channels(text: str) -> tuple[InputChannel, ...]:
    try:
        found = [InputChannel(*map(str, item)) for item in json.loads(text)]
    except (ValueError, TypeError):
        return ()
    names = [channel.name for channel in found]
    sound = len(set(names)) == len(names) <= MOST_CHANNELS and taken_fields().isdisjoint(names)
    return tuple(found) if sound and all(map(CHANNEL_NAME.fullmatch, names)) else ()
