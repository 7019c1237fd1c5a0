"""The trials of a session, as fit, diagnosis and whoever else read them."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

from rig.errors import RigError
from rig.progress import Progress, silent
from rig.recording.reader import Recording
from rig.recording.sessions import Session, TrialInfo
from rig.trials.findings import UNREADABLE, Finding
from rig.trials.quality import TrialQuality, quality_of
from rig.trials.recorded import NS, late, shifted, start_ns, trial_of
from rig.trials.stated import stated_findings
from rig.trials.trial import Trial, TrialSet

SEVERAL = ("specimen", "site", "operator")
GAP_NS = 1_000_000_000  # nobody states the time between them: a hundred times what is a gap within one


class TrialReading(NamedTuple):
    """What one recording gave: its trial, None where it has none that is used, when it began, what is said of it."""

    trial: Trial | None = None
    start_ns: int = 0
    findings: tuple[Finding, ...] = ()


class Readings:
    """Recordings as they come by, in memory or from their files, of each of which its trial alone is kept."""

    def __init__(self) -> None:
        self._found: dict[str, TrialReading] = {}

    def add(self, info: TrialInfo, recording: Recording) -> None:
        """Reads a recording that is at hand."""
        try:
            self._found[info.name] = _read(info, recording, trial_of(info.name, recording))
        except RigError as error:
            self._found[info.name] = _unreadable(info.name, error)

    def of(self, session: Session, tell: Progress = silent) -> TrialSet:
        """The trials of a session, those recordings read from their files that did not come by."""
        for number, info in enumerate(session.trials):
            if info.name not in self._found:
                tell(f"looking at {info.name}", number / len(session.trials))
                try:
                    self.add(info, session.recording(info.name))
                except RigError as error:
                    self._found[info.name] = _unreadable(info.name, error)
        return _together(session, self._found)


def trials_of(session: Session) -> TrialSet:
    """Every trial of a session that opens and is not bad, on one clock from 0; no runs of force tracking."""
    return Readings().of(session)


def _unreadable(name: str, error: RigError) -> TrialReading:
    return TrialReading(findings=(Finding(name, "recording", UNREADABLE, str(error)),))


def _read(info: TrialInfo, recording: Recording, trial: Trial) -> TrialReading:
    if recording.tracks_force:
        return TrialReading()
    found, stated = quality_of(recording, info, trial), stated_findings(trial)
    said = tuple(_judged(info.name, found, stated))
    if found is not None and found.verdict == "bad":
        return TrialReading(findings=said)
    came_late = late(info.name, recording.tables["axis"])
    return TrialReading(_without_wrong_surface(trial, stated), start_ns(recording), (*said, *came_late))


def _together(session: Session, found: Mapping[str, TrialReading]) -> TrialSet:
    readings = [found[info.name] for info in session.trials]
    findings = [_remarked(session, remark) for remark in session.remarks]
    findings += [finding for reading in readings for finding in reading.findings]
    pairs = [(reading.trial, reading.start_ns) for reading in readings if reading.trial]
    trials, starts_ns = [trial for trial, _ in pairs], [start for _, start in pairs]
    one_clock = session.info.kind != "import" or _follow(trials, starts_ns)
    surface_mm, unlike = _common_surface(trials)
    findings += [*unlike, *_mixed(trials)]
    laid_out = _laid_out(trials, starts_ns, one_clock)
    return TrialSet(session.folder.name, tuple(laid_out), surface_mm, tuple(findings), one_clock)


def _remarked(session: Session, remark: str) -> Finding:
    """A remark, as one on a recording where it begins with that one's name."""
    name, _, text = remark.partition(": ")
    own = any(trial.name == name for trial in session.trials)
    return Finding(name, "session", "incomplete", text) if own else Finding("", "session", "incomplete", remark)


def _judged(name: str, found: TrialQuality | None, stated: Sequence[Finding]) -> Iterator[Finding]:
    """What keeps a trial from being good; of one that is used, statements each as a finding of their own."""
    bad = found is not None and found.verdict == "bad"
    yield from () if bad else stated
    said = set() if bad else {finding.text for finding in stated}
    reasons = tuple(reason for reason in found.reasons if reason not in said) if found else ()
    if found and reasons:
        sentence = replace(found, reasons=reasons).sentence
        yield Finding(name, "recording", f"quality_{found.verdict}", sentence)


def _without_wrong_surface(trial: Trial, stated: Sequence[Finding]) -> Trial:
    wrong = any(finding.kind == "surface" for finding in stated)
    return replace(trial, surface_mm=math.nan) if wrong else trial


def _common_surface(trials: Sequence[Trial]) -> tuple[float | None, list[Finding]]:
    """The surface that is stated of all; None, with what is to be said of it, where there are several."""
    stated = [trial.surface_mm for trial in trials if not math.isnan(trial.surface_mm)]
    if not stated:
        return None, []
    if len(stated) == len(trials) and len(set(stated)) == 1:
        return stated[0], []
    text = "a surface is stated of some recordings only, or not alike: it is not used"
    return None, [Finding("", "session", "surface", text)]


def _mixed(trials: Sequence[Trial]) -> Iterator[Finding]:
    """Labels of which there are several: a model of all is a model of none of them."""
    for label in SEVERAL:
        names = list(dict.fromkeys(trial.labels.get(label, "") for trial in trials))
        if len(names) > 1:
            shown = ", ".join(name or "none" for name in names[:4]) + (", ..." if len(names) > 4 else "")
            text = f"{len(names)} {label}s ({shown}) are taken as one tissue under one hand: --by {label} takes each"
            yield Finding("", "session", label, text)


def _follow(trials: Sequence[Trial], starts_ns: Sequence[int]) -> bool:
    """Whether the recordings lie one after the other as they are: on a clock that runs through all of them."""
    return all(before[1] <= after[0] for before, after in pairwise(_spans_ns(trials, starts_ns)))


def _spans_ns(trials: Sequence[Trial], starts_ns: Sequence[int]) -> list[tuple[int, int]]:
    pairs = zip(trials, starts_ns, strict=True)
    return sorted((start, start + _length_ns(trial)) for trial, start in pairs if trial.force_s.size)


def _laid_out(trials: Sequence[Trial], starts_ns: Sequence[int], one_clock: bool) -> Iterator[Trial]:
    """Trials on the clock of the first; those that each count their own time one after the other."""
    first_ns = next((start for start, _ in _spans_ns(trials, starts_ns)), None)
    next_ns = 0
    for trial, start in zip(trials, starts_ns, strict=True):
        yield shifted(trial, start - first_ns if one_clock and first_ns is not None else next_ns)
        next_ns += _length_ns(trial) + GAP_NS


def _length_ns(trial: Trial) -> int:
    return round(float(max(trial.force_s.max(initial=0.0), trial.axis_s.max(initial=0.0))) / NS)
