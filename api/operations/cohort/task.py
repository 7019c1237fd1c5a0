"""One session of a cohort, as whichever process has a core for it works on it: a place in, files out."""

import glob
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from api.operations.cohort.wanted import Wanted
from controller.operation import Operation
from rig.errors import RigError
from rig.plugins import blaming
from rig.recording.remote import address_of
from rig.results import fit
from rig.trials.opening import Opening

PAGE = "report.html"
Files = Mapping[str, bytes]


@dataclass(frozen=True)
class Task:
    """One session: where it lies, the mapping of files of others, and the name its results go by.

    ``value`` is what those of its recordings are of that are meant, None for all of them. ``near`` is a session made of
    the place for as long as this computer works on the cohort; another computer makes its own. ``refused`` says why
    nothing can be worked on.
    """

    name: str
    place: str
    wanted: Wanted
    mapping: str = ""
    value: str | None = None
    near: str = ""
    refused: str = ""

    @classmethod
    def of(cls, name: str, place: Path, wanted: Wanted, mapping: Path | None) -> "Task":
        """With paths that another process, which may stand elsewhere, finds too."""
        where = address_of(place) or str(place.resolve())
        return cls(name, where, wanted, str(mapping.resolve()) if mapping else "")

    @property
    def part(self) -> str:
        """The recordings that are meant, as a pattern over a label, ``site=B5``; empty for all."""
        return "" if self.value is None else f"{self.wanted.by}={glob.escape(self.value)}"

    @property
    def at_hand(self) -> tuple[Path, Opening]:
        """What is read, and how."""
        near = Path(self.near) if self.near and Path(self.near).is_dir() else None
        mapping = Path(self.mapping) if self.mapping and not near else None
        return near or Path(self.place), Opening(mapping, self.wanted.only, self.part)

    @property
    def called(self) -> str:
        """What to call it by: its place, and the part of it."""
        return self.place if self.value is None else f"{self.place} {self.wanted.by}={self.value}"


@dataclass(frozen=True)
class TaskOutcome:
    """The files made, by name, or the ``reason`` why there are none."""

    task: Task
    files: Files
    seconds: float = 0.0
    reason: str = ""


def run(task: Task) -> TaskOutcome:
    """Works on one session; whatever it meets ends with it and not with the others."""
    began = time.monotonic()
    try:
        with TemporaryDirectory(prefix="rig-") as folder, blaming():
            _WORKS[task.wanted.work](task, Path(folder))
            files = {file.name: file.read_bytes() for file in sorted(Path(folder).iterdir())}
        return TaskOutcome(task, files, time.monotonic() - began)
    except RigError as error:
        return TaskOutcome(task, {}, time.monotonic() - began, _reason(task, error))
    except Exception as error:
        reason = f"{task.called}: the work met an error of its own: {type(error).__name__}: {_reason(task, error)}"
        return TaskOutcome(task, {}, time.monotonic() - began, reason)


def _reason(task: Task, error: Exception) -> str:
    """What was met, of the place that somebody named."""
    return str(error).replace(task.near, task.place) if task.near else str(error)


def _fit(task: Task, folder: Path) -> None:
    from api.operations import fit as work  # noqa: PLC0415 - each work loads what it needs

    laws = replace(work.laws_of(task.wanted.laws, task.wanted.model), known=dict(task.wanted.known))
    place, opening = task.at_hand
    found = work.fit(Operation("fit"), [place], folder, laws, opening=opening, drawn=False)
    found.model_copy(update={"model": fit.MODEL}).write(folder / fit.FILE)


def _diagnose(task: Task, folder: Path) -> None:
    from api.operations.diagnose import diagnose  # noqa: PLC0415

    (place, opening), wanted = task.at_hand, task.wanted
    ask = partial(diagnose, Operation("diagnose"), place, wanted.simulation, folder, opening)
    ask(detectability=wanted.detectability)


def _report(task: Task, folder: Path) -> None:
    from api.operations.report import report  # noqa: PLC0415

    place, opening = task.at_hand
    report(Operation("report"), place, folder / PAGE, opening)


_WORKS = {"fit": _fit, "diagnose": _diagnose, "report": _report}
