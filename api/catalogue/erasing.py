"""Sessions are put aside all at once, then removed; what an interruption left is finished later."""

import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from rig.errors import RigError

PREFIX = ".erasing-"


class NotErased(RigError):
    """A session could not be put aside or removed; what remains is said."""


@contextmanager
def put_aside(root: Path, names: Sequence[str]) -> Iterator[None]:
    """Takes ``names`` out of ``root`` for the block and removes them after it; brings all back where it fails.

    Whoever calls is the only one to erase: what others had put aside is removed too.
    """
    aside = Path(tempfile.mkdtemp(prefix=PREFIX, dir=root)) if names else root
    moved: dict[Path, Path] = {}
    try:
        for number, name in enumerate(names):
            moved[root / name] = (root / name).rename(aside / str(number))
        yield
    except OSError as error:
        _bring_back(moved, aside if names else None)
        raise NotErased(f"{error.filename}: cannot be put aside: {error.strerror}; nothing was erased") from error
    except BaseException:
        _bring_back(moved, aside if names else None)
        raise
    finish(root)


def _bring_back(moved: Mapping[Path, Path], aside: Path | None) -> None:
    for before, now in moved.items():
        now.rename(before)
    if aside is not None:
        aside.rmdir()


def left(root: Path) -> list[Path]:
    """Folders of erasures that have not ended."""
    return [path for path in root.glob(f"{PREFIX}*") if path.is_dir() and not path.is_symlink()]


def finish(root: Path) -> None:
    """Removes what was put aside; what another program is just removing is no matter."""
    for folder in left(root):
        shutil.rmtree(folder, ignore_errors=True)
        if folder.exists():
            raise NotErased(
                f"{folder}: holds sessions that could not be removed; see whose files they are, then remove it"
            )
