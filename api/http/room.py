"""Room on the disk, asked for before it is taken: what is measured must always find some."""

import shutil
from pathlib import Path

from api.http.problems import RequestRefused

# The recorder of an hour's session needs less than half of it.
LEFT_FREE_BYTES = 1_000_000_000


def refuse_full(folder: Path, more_bytes: int) -> None:
    """Raises RequestRefused where so many more would leave too little on the disk of ``folder`` for recordings."""
    there = next(each for each in (folder, *folder.absolute().parents) if each.exists())
    free_bytes = shutil.disk_usage(there).free
    if free_bytes < more_bytes + LEFT_FREE_BYTES:
        text = (
            f"the disk of {folder} has {free_bytes / 1e6:.0f} MB free, and {more_bytes / 1e6:.0f} MB are to be written"
            f" beside the {LEFT_FREE_BYTES / 1e6:.0f} MB that recordings need; remove what is not needed and try again"
        )
        raise RequestRefused(507, "disk-full", text)


def size_of(folder: Path) -> int:
    """Bytes of all files below it."""
    return sum(path.lstat().st_size for path in folder.rglob("*") if path.is_file())
