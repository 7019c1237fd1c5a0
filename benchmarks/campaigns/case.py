"""A session whose truth is known, what an analysis said of it, and both written down."""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from pydantic import TypeAdapter

from rig.errors import UsageError
from rig.recording.files import write_text
from rig.trials.trial import TrialSet


@dataclass(frozen=True)
class Truth:
    """What is true of a session, in the words of docs/reference/causes.md.

    ``names`` has a set for each thing that the library has a name for, any of which is true of it; ``outside``: there
    is something that it has no name for, which depends on ``depends`` where that is known. ``sizes`` by parameter.
    ``told`` is for people.
    """

    names: tuple[frozenset[str], ...] = ()
    outside: bool = False
    sizes: Mapping[str, float] = field(default_factory=dict)
    depends: frozenset[str] = frozenset()
    told: str = "nothing"

    @property
    def all_names(self) -> frozenset[str]:
        """Every name that is true."""
        return frozenset[str]().union(*self.names)

    @property
    def is_clean(self) -> bool:
        """Whether nothing is hidden."""
        return not self.names and not self.outside


@dataclass(frozen=True)
class Named:
    """One finding: the first name and those it cannot be told from; value, low and high by parameter."""

    effects: tuple[str, ...]
    is_certain: bool
    confidence: float
    sizes: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Answer:
    """What was said of a session; ``smallest`` are the sizes stated for causes not found, where they were asked for.

    ``left_N`` is the error on recordings left out, ``noise_N`` the true noise (both None where unknown).
    """

    verdict: str
    named: tuple[Named, ...] = ()
    smallest: Mapping[str, float] = field(default_factory=dict)
    depends: tuple[str, ...] = ()
    left_N: float | None = None
    noise_N: float | None = None
    naive: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def all_names(self) -> frozenset[str]:
        """Every name in every set."""
        return frozenset(name for found in self.named for name in found.effects)


@dataclass(frozen=True)
class Case:
    """A session of one generator, made where it is asked for; ``asks_sizes`` where smallest sizes are to be tried."""

    seed: int
    generator: str
    truth: Truth
    make: Callable[[], tuple[TrialSet, float | None]]
    asks_sizes: bool = False

    @cached_property
    def made(self) -> tuple[TrialSet, float | None]:
        """The session and its noise [N]."""
        return self.make()


AnswerFunction = Callable[[Case], Answer]


@dataclass(frozen=True)
class Plant:
    """A cause that was put into a session already judged: its size, the size stated for it (None: none was), and what
    was named before."""

    cause: str
    size: float
    stated: float | None
    before: frozenset[str]

    @property
    def ratio(self) -> float | None:
        """Size over stated size."""
        return self.size / self.stated if self.stated else None


@dataclass(frozen=True)
class Record:
    """One seed of a campaign."""

    seed: int
    generator: str
    truth: Truth
    answer: Answer
    plant: Plant | None = None
    cpu_s: float = 0.0

    @property
    def false_names(self) -> tuple[tuple[str, ...], ...]:
        """Certain findings in whose set nothing is true."""
        return self._false(True)

    @property
    def false_hints(self) -> tuple[tuple[str, ...], ...]:
        """The same of provisional ones."""
        return self._false(False)

    def _false(self, is_certain: bool) -> tuple[tuple[str, ...], ...]:
        known = self.truth.all_names
        sets = (found.effects for found in self.answer.named if found.is_certain is is_certain)
        return tuple(names for names in sets if not known & set(names))

    @property
    def line(self) -> str:
        """Seed, generator, truth and answer in a line."""
        sets = " ".join(_told(found) for found in self.answer.named)
        depends = f" depends on {', '.join(self.answer.depends)}" if self.answer.depends else ""
        wrong = f"  WRONG {', '.join(' or '.join(names) for names in self.false_names)}" if self.false_names else ""
        said = f"answer {self.answer.verdict} {sets}{depends} ({self.cpu_s:.0f} s){wrong}"
        return f"seed {self.seed} {self.generator}: true is {self.truth.told}; {said}"


def _told(found: Named) -> str:
    """A set of names, with a question mark where it is provisional."""
    return f"{{{', '.join(found.effects)}}}{'' if found.is_certain else '?'}"


_RECORD = TypeAdapter(Record)


def read(path: Path | None) -> list[Record]:
    """The records in ``path``, one a line, but one cut short at the end; raises UsageError for anything else."""
    if path is None or not path.exists():
        return []
    whole, _, _ = path.read_text().rpartition("\n")
    try:
        return [_RECORD.validate_python(json.loads(line)) for line in whole.splitlines()]
    except ValueError as error:
        raise UsageError(f"{path}: holds no records of a campaign ({error}); give another file") from error


def write(path: Path, records: Iterable[Record]) -> None:
    """Keeps them, and no others."""
    write_text(path, "".join(map(_line, records)))


def append(path: Path, record: Record) -> None:
    """Keeps it after those that are there."""
    with path.open("a") as file:
        file.write(_line(record))


def _line(record: Record) -> str:
    return json.dumps(_RECORD.dump_python(record, mode="json")) + "\n"
