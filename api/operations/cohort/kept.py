"""Results kept by the content of what they were made from: asked for again they are there, whoever asked before.

The key is a hash over every byte of the place (of an object store, over its objects' tags), what is asked for, and the
program's own source; an edited recording, another option or another version therefore makes another key.
"""

import hashlib
import io
import os
import zipfile
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict
from functools import cache
from pathlib import Path

import rig
from api.operations.cohort.task import PAGE, Files, Task
from rig.errors import DataError
from rig.recording.files import make_folder, whole_file
from rig.recording.manifest import file_sha256
from rig.recording.remote import Store, address_of
from rig.results import diagnosis, fit
from rig.version import SOFTWARE

# Two thousand fits of some 100 kB and as many pages of 1 MB: more than a lab asks for twice.
MOST_BYTES = 2_000_000_000
_OWN = {fit.FOLDER, diagnosis.FOLDER, "parquet", PAGE}
_SHOWN = {"parquet", PAGE}  # a page shows what fit and diagnosis found, so these count for it


def kept_folder() -> Path:
    """Below XDG_CACHE_HOME, else ~/.cache."""
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "tissue-rig" / "results"


def key_of(task: Task) -> str:
    """Of what there is now; raises DataError where the place cannot be read."""
    digest = hashlib.sha256(f"{SOFTWARE} {program_digest()} {sorted(asdict(task.wanted).items())} {task.part}".encode())
    address = address_of(Path(task.place))
    for line in _remote(address) if address else _local(Path(task.place), task):
        digest.update(line.encode() + b"\n")
    if task.mapping:
        digest.update(Path(task.mapping).read_bytes())
    return digest.hexdigest()


def _remote(address: str) -> Iterator[str]:
    yield from (f"{each.name} {each.tag} {each.bytes}" for each in Store(address).objects())


def _local(place: Path, task: Task) -> Iterator[str]:
    if not place.exists():
        raise DataError(f"{place}: no such file or folder; give a session, a recording, or files with their mapping")
    left_out = _SHOWN if task.wanted.work == "report" else _OWN
    files = sorted(place.rglob("*")) if place.is_dir() else [place]
    for file in files:
        name = file.relative_to(place) if file != place else Path(file.name)
        if file.is_file() and not name.parts[0].startswith(".") and name.parts[0] not in left_out:
            yield f"{name} {file_sha256(file)}"


@cache
def program_digest() -> str:
    """Hash of the program's own source: a result of another state of it is another result."""
    root, digest = Path(rig.__file__).parents[1], hashlib.sha256()
    for package in ("rig", "api/operations"):
        for file in sorted((root / package).rglob("*.py")):
            digest.update(file.read_bytes())
    return digest.hexdigest()


def recall(key: str) -> Files | None:
    """The files kept under ``key``, None where there are none that open."""
    path = kept_folder() / f"{key}.zip"
    with suppress(OSError, zipfile.BadZipFile), zipfile.ZipFile(path) as archive:
        found = {name: archive.read(name) for name in archive.namelist()}  # each with its checksum
        path.touch()
        return found
    return None


def keep(key: str, files: Files) -> None:
    """Keeps ``files``, and forgets what was not asked for longest where all are more than `MOST_BYTES`."""
    folder, memory = kept_folder(), io.BytesIO()
    with zipfile.ZipFile(memory, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    make_folder(folder)
    with whole_file(folder / f"{key}.zip", overwrite=True) as scratch:
        scratch.write_bytes(memory.getvalue())


def forget_oldest(most_bytes: int = MOST_BYTES) -> None:
    """Leaves the newest results that ``most_bytes`` hold."""
    found = [(file.stat(), file) for file in kept_folder().glob("*.zip")]
    total = 0
    for about, file in sorted(found, key=lambda each: each[0].st_mtime, reverse=True):
        total += about.st_size
        if total > most_bytes:
            file.unlink(missing_ok=True)
