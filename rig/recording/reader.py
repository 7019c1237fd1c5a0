"""A recording as numpy tables: opens a finished file, any prefix of one, and what a damaged one still holds."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rig.channels import EVENT, STREAMS, EventSample, Stream
from rig.errors import DataError
from rig.recording.channel_streams import ChannelStreams
from rig.recording.chunk import Bodies
from rig.recording.file_window import FileWindow
from rig.recording.growing_table import GrowingTable
from rig.recording.mcap_file import SUMMARY
from rig.recording.mcap_layout import MAGIC
from rig.recording.scan import Scan, good_chunks

# The kind of a trial that tracked a force; one that indents has none.
TRACKING = "tracking"
# What is longer is not held whole: 220 bytes a row were measured for one that is read and looked at.
LONGEST_ROWS = 4_000_000
NUMERIC = tuple(stream for stream in STREAMS if not stream.has_text)


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
    def tracks_force(self) -> bool:
        """Whether a force was tracked in it, rather than a cycle made."""
        return self.metadata.get("trial", {}).get("kind") == TRACKING


def read_recording(path: Path) -> Recording:
    """The recording at ``path``; raises DataError only where there is no file or it never was a recording."""
    tables = {stream.name: GrowingTable(stream.fixed.size) for stream in NUMERIC}
    events: list[EventSample] = []
    found = Scan()
    for stream, bodies in messages(path, found):
        if stream is EVENT:
            events += [EventSample(*EVENT.unpack(body.tobytes())) for body in bodies]
        else:
            tables[stream.name].add(bodies)
    return Recording(
        path,
        found.metadata,
        {stream.name: tables[stream.name].rows(stream.dtype) for stream in NUMERIC},
        tuple(events),
        found.footer and SUMMARY in found.metadata,
        tuple(found.damage),
        found.cut,
    )


def messages(path: Path, found: Scan) -> Iterator[tuple[Stream, Bodies]]:
    """Every good sample in file order, read as it is asked for: a stream, and bodies alike in length.

    ``found`` is complete after the last. Raises DataError where the file cannot be read, is no recording in any state,
    or has another layout.
    """
    with opened(path) as data:
        streams = ChannelStreams(path)
        begins = data[: len(MAGIC)] == MAGIC[: len(data)]
        for chunk in good_chunks(data, found):
            begins = True
            yield from streams.sorted(chunk)
        if not begins:
            raise DataError(f"{path}: not a recording (no MCAP file)")
        yield from streams.rest()


@contextmanager
def opened(path: Path) -> Iterator[FileWindow]:
    """The file's bytes; raises DataError where it cannot be read."""
    try:
        with FileWindow(path) as data:
            yield data
    except FileNotFoundError as error:
        raise DataError(f"{path}: no such recording; `rig verify FOLDER` lists what a session holds") from error
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from error
