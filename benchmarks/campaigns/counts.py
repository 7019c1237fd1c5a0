"""Questions to the records of a campaign, their goals, and the exact intervals of what was counted."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from typing import NamedTuple

from scipy.stats import binomtest

from benchmarks.campaigns.case import Record

LEVEL = 0.95
Value = str | int | float | bool | None | dict[str, str]


class Goal(NamedTuple):
    """Between which shares the counted one is to lie."""

    low: float = 0.0
    high: float = 1.0

    def __str__(self) -> str:
        if self.low == 0:
            return f"at most {self.high:g}"
        return f"at least {self.low:g}" if self.high == 1 else f"{self.low:g} to {self.high:g}"


class Question(NamedTuple):
    """What is asked of every record: no answer, one or several; ``goal`` None where it is for information."""

    text: str
    goal: Goal | None
    ask: Callable[[Record], Iterable[bool]]


@dataclass(frozen=True)
class Share:
    """Hits among all that could be one, by generator too."""

    text: str
    goal: Goal | None
    hits: int
    count: int
    by_generator: Mapping[str, tuple[int, int]] = field(default_factory=dict)

    @property
    def interval(self) -> tuple[float, float]:
        """Exact (Clopper-Pearson) 95 % interval; 0 to 1 where nothing was counted."""
        return exact_interval(self.hits, self.count)

    @property
    def met(self) -> bool:
        """Whether the goal is; nothing counted meets no goal."""
        if self.goal is None:
            return True
        return self.count > 0 and self.goal.low <= self.hits / self.count <= self.goal.high

    def contradicts(self, level: float) -> bool:
        """Whether a share within the goal would give such counts with a probability below 1 - ``level`` only."""
        low, high = exact_interval(self.hits, self.count, level)
        return self.goal is not None and (low > self.goal.high or high < self.goal.low)

    @property
    def line(self) -> str:
        """Text, counts, interval, goal."""
        low, high = self.interval
        share = f"{self.hits / self.count:.3f} ({low:.3f} to {high:.3f})" if self.count else "not counted"
        return f"{self.text:62s} {self.hits:4d}/{self.count:<4d} {share:24s} {self.against}"

    @property
    def missed(self) -> str:
        """In words how the goal was missed; nothing where it was not."""
        if self.met:
            return ""
        return "MISSED" if self.count else "no trial at all: MISSED"

    @property
    def against(self) -> str:
        """The goal, and whether it was missed."""
        return "" if self.goal is None else f"goal {self.goal}  {self.missed}".rstrip()

    @property
    def json(self) -> dict[str, Value]:
        """The same for programs."""
        low, high = self.interval
        return {
            "hits": self.hits, "count": self.count, "low": round(low, 4), "high": round(high, 4),
            "goal": None if self.goal is None else str(self.goal), "met": self.met, "missed": self.missed,
            "by_generator": {name: f"{hits}/{count}" for name, (hits, count) in self.by_generator.items()},
        }  # fmt: skip


def exact_interval(hits: int, count: int, level: float = LEVEL) -> tuple[float, float]:
    """Clopper-Pearson; 0 to 1 where nothing was counted."""
    if not count:
        return 0.0, 1.0
    found = binomtest(hits, count).proportion_ci(level, "exact")
    return float(found.low), float(found.high)


def share_of(question: Question, records: Sequence[Record]) -> Share:
    """The question asked of all records."""
    asked = sorted((one.generator, bool(hit)) for one in records for hit in question.ask(one))
    by = {name: [hit for _, hit in group] for name, group in groupby(asked, key=lambda pair: pair[0])}
    counted = {name: (sum(hits), len(hits)) for name, hits in by.items()}
    return Share(question.text, question.goal, sum(hit for _, hit in asked), len(asked), counted)


def table(shares: Sequence[Share], generators: Sequence[str]) -> Iterable[str]:
    """Hits by generator, a column each; what was not asked of one is left empty."""
    width = [max(len(name), 7) for name in generators]
    yield f"{'':62s} " + "  ".join(f"{name:>{w}s}" for name, w in zip(generators, width, strict=True))
    for share in shares:
        cells = (
            "/".join(map(str, share.by_generator[name])) if name in share.by_generator else "" for name in generators
        )
        yield f"{share.text:62s} " + "  ".join(f"{cell:>{w}s}" for cell, w in zip(cells, width, strict=True))


@dataclass(frozen=True)
class Reliability:
    """Stated confidence against how often the first name was right, in equal bins of confidence."""

    confidence: tuple[float, ...]
    right: tuple[bool, ...]
    bins: int = 5
    most: float = 0.05

    @property
    def brier(self) -> float:
        """Mean square of confidence less outcome."""
        pairs = zip(self.confidence, self.right, strict=True)
        return sum((p - hit) ** 2 for p, hit in pairs) / max(len(self.right), 1)

    @property
    def rows(self) -> list[tuple[float, int, int]]:
        """Of each bin that holds any: mean confidence, right, count."""
        found = []
        for k in range(self.bins):
            own = [(p, hit) for p, hit in zip(self.confidence, self.right, strict=True) if self._bin(p) == k]
            if own:
                found.append((sum(p for p, _ in own) / len(own), sum(hit for _, hit in own), len(own)))
        return found

    def _bin(self, p: float) -> int:
        return min(int(p * self.bins), self.bins - 1)

    @property
    def error(self) -> float:
        """Expected calibration error: distance of confidence from frequency, over all names."""
        return sum(abs(p * count - right) for p, right, count in self.rows) / max(len(self.right), 1)

    @property
    def met(self) -> bool:
        """Whether it is within the goal; no name at all meets none."""
        return bool(self.right) and self.error <= self.most

    @property
    def lines(self) -> list[str]:
        """A line a bin, and the error beside its goal."""
        bins = [
            f"  stated {p:.2f}: right {right}/{count} ({low:.2f} to {high:.2f})"
            for p, right, count in self.rows
            for low, high in [exact_interval(right, count)]
        ]
        said = f"{self.error:.3f}, Brier score {self.brier:.3f}" if self.right else "not counted"
        return [
            f"confidence against frequency of {len(self.right)} names: calibration error {said}; "
            f"goal at most {self.most:g}{'' if self.met else '  MISSED'}",
            *bins,
        ]

    @property
    def json(self) -> dict[str, Value]:
        """The same for programs."""
        return {
            "error": round(self.error, 4), "brier": round(self.brier, 4), "count": len(self.right),
            "goal": f"at most {self.most:g}", "met": self.met,
        }  # fmt: skip


def reliability_of(records: Iterable[Record]) -> Reliability:
    """Of every name given first, certain or not."""
    named = [(found, one.truth.all_names) for one in records for found in one.answer.named]
    return Reliability(
        tuple(found.confidence for found, _ in named), tuple(found.effects[0] in true for found, true in named)
    )
