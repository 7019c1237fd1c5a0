"""A recording as numpy tables: opens a finished file, any prefix of one, and what a damaged one still holds."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rig.channels import BY_ID, BY_NAME, EVENT, STREAMS, EventSample, Stream
from rig.errors import DataError
from rig.recording.chunk import Chunk, Definition
from rig.recording.file_window import FileWindow
from rig.recording.growing_table import GrowingTable
from rig.recording.mcap_file import SUMMARY
from rig.recording.mcap_layout import MAGIC, schema_words
from rig.recording.scan import Scan, good_chunks

# Fields of recordings that were made before they had the name on the right.
RENAMED = {"slot": "cycle"}
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
        streams = Streams(path)
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


class Streams:
    """Which stream a channel is, by the definitions that came so far.

    Messages wait until there is a definition. Where the chunk that has them is lost, the numbers are those of our own
    writer.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._known: dict[int, Stream] = {}
        self._defined = False
        self._waiting: list[Chunk] = []

    def sorted(self, chunk: Chunk) -> Iterator[tuple[Stream, Bodies]]:
        """What stands in ``chunk``, and in those that waited for its definitions."""
        for number, definition in chunk.definitions.items():
            self._define(number, definition)
        self._waiting.append(chunk)
        if self._defined:
            yield from self._all(self._known)

    def rest(self) -> Iterator[tuple[Stream, Bodies]]:
        """What still waits at the end of the file."""
        if self._defined and not self._known:
            raise DataError(f"{self._path}: an MCAP file, but with no stream of this bench")
        yield from self._all(self._known or BY_ID)

    def _define(self, number: int, definition: Definition) -> None:
        self._defined = True
        stream = BY_NAME.get(definition.topic)
        if stream is None:
            return
        if layout(definition.schema) != layout(stream.schema()):
            raise DataError(
                f"{self._path}: stream {stream.name} has other fields than this version of the program; "
                "read it with the version named in its metadata"
            )
        self._known[number] = stream

    def _all(self, known: Mapping[int, Stream]) -> Iterator[tuple[Stream, Bodies]]:
        waiting, self._waiting = self._waiting, []
        for channel, bodies in (alike for chunk in waiting for alike in chunk.messages):
            stream = known.get(channel)
            if stream is None:
                continue
            size = bodies.shape[1]
            if not stream.has_text and size != stream.fixed.size:
                raise DataError(
                    f"{self._path}: a {stream.name} row of {size} bytes; its layout has {stream.fixed.size}"
                )
            yield stream, bodies


def layout(schema: str) -> list[list[str]]:
    """Types and names, as they are now, of a ``ros2msg`` text without comments."""
    return [[RENAMED.get(word, word) for word in words] for words in schema_words(schema)]
