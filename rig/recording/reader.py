"""A recording as numpy tables: opens a finished file, any prefix of one, and what a damaged one still holds."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rig.channels import EVENT, STREAMS, EventSample, Stream
from rig.errors import DataError
from rig.input_streams import all_streams
from rig.recording.file_streams import streams_of
from rig.recording.mcap_file import SUMMARY
from rig.recording.mcap_layout import MAGIC
from rig.recording.scan import Scan, scan

# The kind of a trial that tracked a force; one that indents has none.
TRACKING = "tracking"
# What is longer is not held whole: 220 bytes a row were measured for one that is read and looked at.
LONGEST_ROWS = 4_000_000
NUMERIC = tuple(stream for stream in STREAMS if not stream.has_text)
Bodies = NDArray[np.uint8]


@dataclass(frozen=True)
class Recording:
    """What one file holds.

    ``tables`` has every numeric stream by name, rows in file order with the stream's own dtype (read-only, possibly no
    rows). ``complete``: the recorder finished the file. ``cut`` says where a file ends that was not finished,
    ``damage`` what is bad in it; both are sentences, empty where there is nothing to say.
    """

    path: Path
    metadata: dict[str, dict[str, str]]
    tables: dict[str, NDArray[np.void]]
    events: tuple[EventSample, ...]
    complete: bool
    damage: tuple[str, ...]
    cut: str = ""

    @property
    def streams(self) -> tuple[Stream, ...]:
        """Every stream it can hold, its inputs' behind those of the bench."""
        return all_streams(self.metadata)

    @property
    def tracks_force(self) -> bool:
        """Whether a force was tracked in it, rather than a cycle made."""
        return self.metadata.get("trial", {}).get("kind") == TRACKING


def read_recording(path: Path) -> Recording:
    """The recording at ``path``; raises DataError only where there is no file or it never was a recording."""
    found = scan(read_bytes(path))
    streams = all_streams(found.metadata)
    bodies: dict[str, list[Bodies]] = {stream.name: [] for stream in streams}
    for stream, alike in messages(path, found):
        bodies[stream.name].append(alike)
    return Recording(
        path,
        found.metadata,
        {stream.name: _table(stream, bodies[stream.name]) for stream in streams if not stream.has_text},
        tuple(EventSample(*EVENT.unpack(body.tobytes())) for alike in bodies[EVENT.name] for body in alike),
        found.footer and SUMMARY in found.metadata,
        tuple(found.damage),
        found.cut,
    )


def read_bytes(path: Path) -> bytes:
    """The file's bytes; raises DataError where it cannot be read or is no recording in any state."""
    try:
        data = path.read_bytes()
    except FileNotFoundError as error:
        raise DataError(f"{path}: no such recording; `rig verify FOLDER` lists what a session holds") from error
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from error
    if not data.startswith(MAGIC[: len(data)]) and not scan(data).chunks:
        raise DataError(f"{path}: not a recording (no MCAP file)")
    return data


def _table(stream: Stream, bodies: list[Bodies]) -> NDArray[np.void]:
    size = stream.fixed.size
    rows = np.concatenate([np.empty((0, size), np.uint8), *bodies]).view(stream.dtype)[:, 0]
    rows.flags.writeable = False
    return rows


def messages(path: Path, found: Scan) -> Iterator[tuple[Stream, Bodies]]:
    """Every good sample in file order: a stream, and bodies alike in length; DataError for a file of another layout."""
    streams = streams_of(path, found.chunks, all_streams(found.metadata))
    for chunk in found.chunks:
        for channel, bodies in chunk.messages:
            stream = streams.get(channel)
            if stream is None:
                continue
            size = bodies.shape[1]
            if not stream.has_text and size != stream.fixed.size:
                raise DataError(f"{path}: a {stream.name} row of {size} bytes; its layout has {stream.fixed.size}")
            yield stream, bodies
