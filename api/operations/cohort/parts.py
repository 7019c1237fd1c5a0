"""The tasks of a cohort: a session each, or each part of one that a label of its recordings tells apart."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path

from api.operations.cohort.task import Task
from api.operations.cohort.wanted import Wanted
from api.operations.opening import opened
from rig.errors import RigError, UsageError
from rig.intake.folder import file_name
from rig.progress import Progress
from rig.trials.chosen import parts_of
from rig.trials.opening import Opening, is_recorded


@dataclass
class Parts:
    """Takes places apart; what has to be made of a place for it is there for as long as ``stack`` is.

    ``remarks`` is what was to be said of the places on the way.
    """

    wanted: Wanted
    mapping: Path | None
    stack: ExitStack
    tell: Progress
    remarks: list[str] = field(default_factory=list)

    def tasks(self, places: Mapping[str, Path]) -> list[Task]:
        """Those of each place, which have their names; of one that cannot be taken apart a task that says why.

        Raises UsageError where two would be written to one folder.
        """
        whole = [Task.of(name, place, self.wanted, self.mapping) for name, place in places.items()]
        if not self.wanted.by:
            return whole
        return list(_each_once(part for one in whole for part in self._apart(one, len(whole) == 1)))

    def _apart(self, whole: Task, alone: bool) -> list[Task]:
        try:
            return list(self._parts(whole, alone))
        except RigError as error:
            return [replace(whole, refused=str(error))]

    def _parts(self, whole: Task, alone: bool) -> Iterator[Task]:
        place, label = Path(whole.place), self.wanted.by or ""
        session = self.stack.enter_context(opened(place, self.tell, Opening(self.mapping, self.wanted.only)))
        self.remarks += session.remarks
        near = "" if self.mapping is None and is_recorded(place) else str(session.folder)
        for value in parts_of(session, label):
            own = file_name(value or f"no {label}")
            name = own if alone else f"{whole.name}-{own}"
            yield replace(whole, name=name, value=value, near=near)


def _each_once(tasks: Iterable[Task]) -> Iterator[Task]:
    taken: dict[str, Task] = {}
    for task in tasks:
        if task.name in taken:
            raise UsageError(
                f"{taken[task.name].called} and {task.called}: would both be written to {task.name}; take one after "
                "the other with --only"
            )
        taken[task.name] = task
        yield task
