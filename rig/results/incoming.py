"""From a session to what came in: numbers of its streams, and what fit and diagnosis take of it, asked of them."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from rig.diagnosis.observations import OMITTED, observe
from rig.diagnosis.run import judged_trials, unusable
from rig.errors import DataError
from rig.progress import Progress, portion, silent
from rig.recording.reader import LONGEST_ROWS, Recording
from rig.recording.sessions import Session, TrialInfo
from rig.results.came_in import CameInResult, CycleIn, Quality, RecordingIn, StreamIn, Use
from rig.results.seen import Rests, Seen, see
from rig.tissue.study import curves_in
from rig.tissue.summary import Skipped
from rig.trials.curves import Curve
from rig.trials.findings import BAD, UNREADABLE, Finding
from rig.trials.reading import Readings
from rig.trials.trial import Trial, TrialSet, inspected

# Enough of a trial to say whether a diagnosis can be made of it, which itself takes all of them.
DIAGNOSE_SAMPLES = 4000
# As much as a gigabyte holds: beyond, nothing is looked at.
MOST_ROWS = 30_000_000
KINDS = {"contact": "starts in contact", "tension": "tension", "unsteady": "steps or swings"}
# With these a recording is of no use to any later step.
USELESS = frozenset({BAD, UNREADABLE, "missing", "constant"})
Reasons = Mapping[str, str]


class Looked(Readings):
    """Recordings as they come by, of each of which its trial is kept, its numbers and what is drawn of it."""

    def __init__(self) -> None:
        super().__init__()
        self.seen: dict[str, Seen] = {}
        self._rows = 0

    def add(self, info: TrialInfo, recording: Recording) -> None:
        """Looks at a recording that is at hand, while that is of any use."""
        self._rows += sum(map(len, recording.tables.values()))
        if self._rows > MOST_ROWS:
            return
        with suppress(DataError):
            self.seen[info.name] = see(recording)
        super().add(info, recording)


def came_in_result(session: Session, tell: Progress = silent, looked: Looked | None = None) -> CameInResult:
    """What came in with ``session``, none that ``looked`` has seen read again; never raises on what they hold."""
    rows = [sum(trial.samples.values()) for trial in session.trials]
    if sum(rows) > MOST_ROWS or max(rows, default=0) > LONGEST_ROWS:
        remark = (
            f"{sum(rows)} rows, {max(rows)} of them in one recording, were not looked at (limits {MOST_ROWS} and "
            f"{LONGEST_ROWS}); import them in several sessions, in shorter recordings"
        )
        return CameInResult(session=session.info.id, recordings=(), sha256={}, remarks=(remark,))
    looked = looked or Looked()
    trials = looked.of(session, portion(tell, 0.0, 0.6))
    found, out, files = inspected(trials), "", session.info.axis_files
    if files:
        trials, found = TrialSet(trials.name, ()), replace(found, trials=())
        out = f"a drive axis has no tissue; `rig diagnose` of {files} with their mapping judges it"
    tell("the contact of every cycle", 0.6)
    curves, skipped = curves_in(found)
    tell("what a diagnosis takes", 0.95)
    refused = _not_diagnosed(trials)
    recordings = [
        _recording(one, looked.seen.get(one.name), found, curves, skipped, refused, out) for one in session.trials
    ]
    sums = {trial.name: trial.sha256 for trial in session.trials}
    return CameInResult(session=session.info.id, recordings=tuple(recordings), sha256=sums)


def _recording(
    info: TrialInfo, seen: Seen | None, found: TrialSet, curves: Sequence[Curve], skipped: Sequence[Skipped],
    refused: Reasons, out: str,
) -> RecordingIn:  # fmt: skip
    cycles = tuple(_cycles(info.name, curves, skipped))
    said = [finding for finding in found.findings if finding.recording == info.name]
    trial = next((trial for trial in found.trials if trial.name == info.name), None)
    reasons = list(dict.fromkeys([*info.reasons, *(finding.text for finding in said)]))
    streams = () if seen is None else tuple(_in_air(*one, cycles) for one in zip(seen.streams, seen.rests, strict=True))
    tracks = seen is not None and seen.tracks_force
    known = trial is not None or tracks or bool(out)
    out = out or ("it tracks a force" if tracks else "; ".join(reasons) or "it is left out")
    return RecordingIn(
        name=info.name, streams=(*streams, *(seen.inputs if seen else ())),
        one_clock=seen is not None and seen.one_clock,
        alignments={} if seen is None else seen.alignments, cycles=cycles,
        quality=_quality(info, known, said), reasons=tuple(reasons),
        fit=_fitted(cycles) if trial else Use(used=False, why=out),
        diagnose=Use(used=info.name not in refused, why=refused.get(info.name, "")) if trial
        else Use(used=False, why=out),
    )  # fmt: skip


def _quality(info: TrialInfo, read: bool, said: Sequence[Finding]) -> Quality:
    """What the session says of it; else bad where it is of no use, good where nothing is to be said."""
    if info.quality:
        return info.quality
    if not read or any(finding.kind in USELESS and finding.stream != "marker" for finding in said):
        return "bad"
    return "usable" if said else "good"


def _cycles(recording: str, curves: Sequence[Curve], skipped: Sequence[Skipped]) -> Iterator[CycleIn]:
    yield from (_cycle(curve) for curve in curves if curve.trial == recording)
    for one in skipped:
        if one.trial == recording or one.trial.startswith(f"{recording}, cycle "):
            unknown = dict.fromkeys(("contact_mm", "contact_low_mm", "contact_high_mm", "zero_N", "depth_mm", "peak_N"))
            yield CycleIn(name=one.trial, kind=(), **unknown, speed_mm_s=None, refused=one.reason)


def _cycle(curve: Curve) -> CycleIn:
    contact = curve.contact
    known = np.isfinite([contact.low_mm, contact.high_mm]).all()
    return CycleIn(
        name=curve.name, kind=tuple(KINDS[finding.kind] for finding in curve.findings if finding.kind in KINDS),
        contact_mm=contact.position_mm, contact_low_mm=contact.low_mm if known else contact.lower_mm,
        contact_high_mm=contact.high_mm if known else contact.upper_mm, zero_N=curve.zero_N,
        depth_mm=curve.max_depth_mm, peak_N=curve.max_force_N, speed_mm_s=curve.speed_mm_s,
    )  # fmt: skip


def _in_air(stream: StreamIn, rests: Rests, cycles: Sequence[CycleIn]) -> StreamIn:
    """The stream with its noise in the air, where it was at rest above every surface found."""
    surfaces_mm = [cycle.contact_low_mm for cycle in cycles if cycle.contact_low_mm is not None and not cycle.kind]
    above = rests.deviation[rests.position_mm < min(surfaces_mm, default=-np.inf)]
    if not len(above):
        return stream
    return stream.model_copy(update={"noise": float(np.median(above)), "noise_from": "air"})


def _fitted(cycles: Sequence[CycleIn]) -> Use:
    refused = [cycle for cycle in cycles if cycle.refused]
    if len(refused) == len(cycles) == 1:
        return Use(used=False, why=refused[0].refused)
    why = [f"{cycle.name.rpartition(', ')[2]}: {cycle.refused}" for cycle in refused]
    return Use(used=len(refused) < len(cycles), why="; ".join(why))


def _not_diagnosed(found: TrialSet) -> Reasons:
    """Why a diagnosis takes a recording not, by name; empty where it takes them all."""
    names = [trial.name for trial in found.trials]
    try:
        data = observe(judged_trials(replace(found, trials=tuple(map(_thinned, found.trials)))), _unasked)
    except DataError as error:
        return dict.fromkeys(names, str(error).removeprefix(f"{found.name}: "))
    flaw = unusable(data)
    if flaw is not None:
        return dict.fromkeys(names, f"{flaw.reason}; {flaw.remedy}")
    taken = {name.rpartition(", cycle ")[0] or name for name in data.names}
    omitted = {finding.recording: finding.text for finding in data.findings if finding.text.startswith(OMITTED)}
    usual = next(iter(omitted.values()), OMITTED)
    return {name: omitted.get(name, usual).removeprefix(OMITTED) for name in names if name not in taken}


def _unasked(_trials: Sequence[Trial]) -> None:
    """Contact takes most of the time, the curves have it already, and whether anything can be judged is not by it."""


def _thinned(trial: Trial) -> Trial:
    """Every so many samples of force and axis."""
    kept = {
        name: getattr(trial, name)[:: max(1, getattr(trial, name).size // DIAGNOSE_SAMPLES)]
        for name in ("force_s", "force_N", "axis_s", "axis_mm")
    }
    return replace(trial, **kept, marker_s=None, marker_mm=None, temperature_C=None)
