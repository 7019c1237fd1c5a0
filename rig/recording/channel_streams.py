"""Which stream of the bench each channel of a file is."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from rig.channels import BY_ID, BY_NAME, Stream
from rig.errors import DataError
from rig.recording.chunk import Bodies, Chunk, Definition
from rig.recording.mcap_layout import schema_words

# Fields of recordings that were made before they had the name on the right.
RENAMED = {"slot": "cycle"}


class ChannelStreams:
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
