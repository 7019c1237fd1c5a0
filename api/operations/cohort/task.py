"""One session of a cohort, as whichever process has a core for it works on it: a place in, files out."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from api.operations.cohort.wanted import Wanted
from controller.operation import Operation
from rig.errors import RigError
from rig.recording.remote import address_of
from rig.results import fit
from rig.trials.opening import Opening

PAGE = "report.html"
Files = Mapping[str, bytes]


@dataclass(frozen=True)
class Task:
    """One session: where it lies, the mapping of files of others, and the name its results go by."""

    name: str
    place: str
    wanted: Wanted
    mapping: str = ""

    @classmethod
    def of(cls, name: str, place: Path, wanted: Wanted, mapping: Path | None) -> "Task":
        """With paths that another process, which may stand elsewhere, finds too."""
        where = address_of(place) or str(place.resolve())
        return cls(name, where, wanted, str(mapping.resolve()) if mapping else "")

    @property
    def opening(self) -> Opening:
        """How the place is read."""
        return Opening(Path(self.mapping) if self.mapping else None, self.wanted.only)


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
        with TemporaryDirectory(prefix="rig-") as folder:
            _WORKS[task.wanted.work](task, Path(folder))
            files = {file.name: file.read_bytes() for file in sorted(Path(folder).iterdir())}
        return TaskOutcome(task, files, time.monotonic() - began)
    except RigError as error:
        return TaskOutcome(task, {}, time.monotonic() - began, str(error))
    except Exception as error:
        reason = f"{task.place}: the work met an error of its own: {type(error).__name__}: {error}"
        return TaskOutcome(task, {}, time.monotonic() - began, reason)


def _fit(task: Task, folder: Path) -> None:
    from api.operations import fit as work  # noqa: PLC0415 - each work loads what it needs

    laws = replace(work.laws_of(task.wanted.laws, task.wanted.model), known=dict(task.wanted.known))
    found = work.fit(Operation("fit"), [Path(task.place)], folder, laws, opening=task.opening, drawn=False)
    found.model_copy(update={"model": fit.MODEL}).write(folder / fit.FILE)


def _diagnose(task: Task, folder: Path) -> None:
    from api.operations.diagnose import diagnose  # noqa: PLC0415

    wanted = task.wanted
    ask = partial(diagnose, Operation("diagnose"), Path(task.place), wanted.simulation, folder, task.opening)
    ask(detectability=wanted.detectability)


def _report(task: Task, folder: Path) -> None:
    from api.operations.report import report  # noqa: PLC0415

    report(Operation("report"), Path(task.place), folder / PAGE, task.opening)


_WORKS = {"fit": _fit, "diagnose": _diagnose, "report": _report}
