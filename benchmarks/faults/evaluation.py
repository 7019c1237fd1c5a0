"""What a trial is worth: who noticed its fault, how soon, and whether that is who was declared to, and soon enough."""

from dataclasses import dataclass
from typing import NamedTuple

from benchmarks.faults.fault import DRIVE, NOBODY, QUALITY, REFUSED, Fault, bound_s
from benchmarks.faults.scenarios import Ended

GOOD = "good"
# A drive that stops by itself says so within a cycle, and our loop names it; a loop that cannot is not who noticed.
FOLLOWS_NS = 100_000_000


class Notice(NamedTuple):
    """What stopped motion, when (monotonic ns), and its sentence."""

    code: str
    at_ns: int
    text: str = ""

    @property
    def is_stall(self) -> bool:
        """Whether the sentence is of time alone, as where the computer stood still for a moment."""
        return self.code == "loop_overrun" or "ms old (limit" in self.text


@dataclass(frozen=True)
class Outcome:
    """What was seen of a trial; ``stops`` oldest first, ``refusal`` the sentence that turned something down,
    ``end`` where the tip rests, ``moves`` what is said where it does not."""

    ended: Ended
    happened_ns: int
    onset_ns: int | None
    stops: tuple[Notice, ...]
    unpowered_ns: int | None
    refusal: str
    end: str
    moves: str
    complete: bool


@dataclass(frozen=True)
class Finding:
    """Who noticed, how long after the fault's onset [s], and why that is not enough ("" where it is)."""

    by: str
    detected_s: float | None
    unnoticed: str


def evaluate(fault: Fault, outcome: Outcome) -> Finding:
    """A fault counts as noticed only by what is declared for it, and only within the bound of that."""
    by, at_ns = _first(outcome)
    if by == QUALITY and not set(fault.named) & set(outcome.ended.measures):
        return Finding(by, None, f"the quality names {', '.join(outcome.ended.measures)} only")
    if not by and NOBODY not in fault.expected:
        return Finding("", None, "nobody noticed")
    detected_s = None if at_ns is None else round(max(at_ns - _since_ns(outcome), 0) * 1e-9, 4)
    if by not in fault.expected:
        return Finding(by, detected_s, f"noticed by {by} only, not by {' or '.join(fault.expected) or 'nobody'}")
    if detected_s is not None and detected_s > bound_s(fault, by):
        return Finding(by, detected_s, f"late: {detected_s:.3f} s, bound {bound_s(fault, by):g} s")
    return Finding(by, detected_s, "")


def _first(outcome: Outcome) -> tuple[str, int | None]:
    """The loop's own stop before the drive's, which follows it; then what does not stop motion."""
    drive_ns = outcome.unpowered_ns
    if drive_ns is not None and drive_ns < outcome.happened_ns:
        drive_ns = None
    if outcome.stops and (drive_ns is None or outcome.stops[0].at_ns < drive_ns + FOLLOWS_NS):
        return outcome.stops[0].code, outcome.stops[0].at_ns
    if drive_ns is not None:
        return DRIVE, drive_ns
    if outcome.refusal or outcome.ended.refused:
        return REFUSED, None
    if outcome.ended.verdict not in ("", GOOD) and outcome.ended.measures:
        return QUALITY, None
    return "", None


def _since_ns(outcome: Outcome) -> int:
    """The onset, or the fault itself where what it leads to never came: then it was noticed before."""
    if outcome.onset_ns is not None:
        return outcome.onset_ns
    return outcome.stops[0].at_ns if outcome.stops else outcome.happened_ns
