"""Which channel of a file is which stream, those of inputs included."""

from collections.abc import Iterable, Mapping
from pathlib import Path

from rig.channels import Stream
from rig.errors import DataError
from rig.recording.mcap_layout import schema_words
from rig.recording.scan import Chunk, Definition

# Fields of recordings that were made before they had the name on the right.
RENAMED = {"slot": "cycle"}


def streams_of(path: Path, chunks: Iterable[Chunk], known: Iterable[Stream]) -> Mapping[int, Stream]:
    """Channel number to stream; the numbers of our own writer where the chunk with the definitions is lost."""
    by_name = {stream.name: stream for stream in known}
    definitions: dict[int, Definition] = {}
    for chunk in chunks:
        definitions |= chunk.definitions
    for definition in definitions.values():
        stream = by_name.get(definition.topic)
        if stream is not None and layout(definition.schema) != layout(stream.schema()):
            raise DataError(
                f"{path}: stream {stream.name} has other fields than this version of the program; "
                "read it with the version named in its metadata"
            )
    found = {number: by_name[item.topic] for number, item in definitions.items() if item.topic in by_name}
    if definitions and not found:
        raise DataError(f"{path}: an MCAP file, but with no stream of this bench")
    return found or dict(enumerate(by_name.values(), 1))


def layout(schema: str) -> list[list[str]]:
    """Types and names, as they are now, of a ``ros2msg`` text without comments."""
    return [[RENAMED.get(word, word) for word in words] for words in schema_words(schema)]
