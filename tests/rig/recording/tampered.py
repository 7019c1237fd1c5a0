"""What may have become of the files of a session of two recordings, in the order of their names."""

import json
import shutil
from pathlib import Path

from rig.recording.sessions import SESSION_FILE
from rig.recording.verify import repair


def _recordings(folder: Path) -> tuple[Path, Path]:
    one, two = sorted(folder.glob("*.mcap"))
    return one, two


def swap(folder: Path) -> None:
    """Each in the other's place."""
    one, two = _recordings(folder)
    one.rename(folder / "kept")
    two.rename(one)
    (folder / "kept").rename(two)


def copy(folder: Path) -> None:
    """The first in the second's place too."""
    shutil.copy(*_recordings(folder))


def edit_recording(folder: Path) -> None:
    """One letter of the first, in its header."""
    path, _ = _recordings(folder)
    data = bytearray(path.read_bytes())
    place = data.index(b"tissue-rig")  # the library's name in the header, which no checksum of MCAP covers
    data[place : place + 6] = b"TISSUE"
    path.write_bytes(data)


def rewrite(folder: Path) -> None:
    """The first with the same samples, written anew: as a recording it is whole."""
    path, _ = _recordings(folder)
    repair(path, folder / "kept.mcap")
    (folder / "kept.mcap").replace(path)


def edit_list(folder: Path) -> None:
    """Another speed."""
    path = folder / SESSION_FILE
    table = json.loads(path.read_text())
    table["trials"][0]["speed_mm_s"] = 30.0
    path.write_text(json.dumps(table))


def strip_seal(folder: Path) -> None:
    """A list without its own hash."""
    path = folder / SESSION_FILE
    table = json.loads(path.read_text())
    del table["sha256"]
    path.write_text(json.dumps(table))
