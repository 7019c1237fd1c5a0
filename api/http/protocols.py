"""The protocols in a folder: each read when it has changed, and one that cannot be read hides no other."""

import threading
from pathlib import Path

from api.http.models import ProtocolView
from api.http.shared_file import FileState, file_state
from controller.experiments.capture import check
from rig.config.protocol import Indentation
from rig.config.table import load
from rig.config.wiring import Wiring
from rig.errors import RigError

MARK = 'kind = "indentation"'


class ProtocolShelf:
    """Safe from any thread."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._lock = folder, threading.Lock()
        self._known: dict[Path, tuple[FileState | None, Wiring, ProtocolView | None]] = {}

    def listed(self, wiring: Wiring) -> list[ProtocolView]:
        """Every protocol, also those that this bench refuses or that cannot be read."""
        with self._lock:
            found = (self._view(path, wiring) for path in sorted(self._folder.glob("*.toml")))
            return [view for view in found if view]

    def _view(self, path: Path, wiring: Wiring) -> ProtocolView | None:
        try:
            state = file_state(path)
        except OSError as error:
            return _unreadable(path, error)
        known = self._known.get(path)
        if known is None or known[:2] != (state, wiring):
            known = self._known[path] = (state, wiring, _read(path, wiring))
        return known[2]


def _read(path: Path, wiring: Wiring) -> ProtocolView | None:
    """None of a file that is no protocol and does not say it is: a wiring, a mapping."""
    if path.is_fifo() or path.is_char_device():  # whose end does not come
        return _refused(path, f"{path}: is no file")
    try:
        marked = MARK in path.read_text(errors="replace")
    except OSError as error:
        return _unreadable(path, error)
    try:
        plan = load(Indentation, path)
    except RigError as error:
        return _refused(path, str(error)) if marked else None
    view = ProtocolView(name=path.stem, file=path.name, settings=plan.model_dump(mode="json"), refusal="")
    try:
        check(plan, wiring)
    except RigError as error:
        return view.model_copy(update={"settings": {}, "refusal": str(error)})
    return view


def _unreadable(path: Path, error: OSError) -> ProtocolView:
    return _refused(path, f"{path}: cannot be read: {error.strerror}")


def _refused(path: Path, why: str) -> ProtocolView:
    return ProtocolView(name=path.stem, file=path.name, settings={}, refusal=why)
