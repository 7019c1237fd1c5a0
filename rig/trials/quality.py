"""How good a trial is: what was measured of its recording, against the bounds of its protocol, in words."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Literal, NamedTuple

from pydantic import ValidationError

from rig.config.protocol import FORCE_LIMIT
from rig.config.quality import Bounds, QualityLimits
from rig.errors import DataError
from rig.recording.mcap_file import SUMMARY
from rig.recording.reader import Recording, read_recording
from rig.recording.sessions import TrialInfo
from rig.recording.slope import tracker_slope
from rig.trials import measures
from rig.trials.curves import Curve, loading_curve
from rig.trials.cycles import cycle_of
from rig.trials.findings import BAD
from rig.trials.recorded import trial_of
from rig.trials.stated import stated_findings
from rig.trials.trial import Trial

Verdict = Literal["good", "usable", "bad"]


@dataclass(frozen=True)
class TrialQuality:
    """The verdict, a sentence for each thing that keeps it from being good, and what was measured, by name.

    A name is that of a bound in `rig.config.quality`, for streams with the stream before it: ``force.gap_ms``.
    """

    verdict: Verdict
    reasons: tuple[str, ...] = ()
    measured: Mapping[str, float] = field(default_factory=dict)

    @property
    def sentence(self) -> str:
        """The verdict with its reasons."""
        left_out = ", left out" if self.verdict == "bad" else ""
        return f"quality {self.verdict}{left_out}: {'; '.join(self.reasons)}"


class Measure(NamedTuple):
    """One thing measured, under the name of its bound; shown ``scale`` times with ``unit``, not shown where NaN."""

    name: str
    value: float
    text: str
    unit: str = ""
    scale: float = 1.0

    def bounds(self, limits: QualityLimits) -> Bounds:
        """What a protocol allows of it."""
        found: Bounds = getattr(limits, self.name.rpartition(".")[2])
        return found

    def sentence(self, limits: QualityLimits) -> str:
        """The value beside what is good."""
        value, good = self.value * self.scale, self.bounds(limits).good * self.scale
        return f"{self.text} {value:.3g}{self.unit} (good up to {good:.3g}{self.unit})"


def evaluate_trial(recording: Recording, limits: QualityLimits, peaks_before_N: Sequence[float] = ()) -> TrialQuality:
    """The verdict on a captured or tracked trial: bad where anything is, good where everything is.

    ``peaks_before_N``: what trials to the same depth on the same site reached before.
    """
    curve = None if recording.tracks_force else _curve(recording)
    measured = (*_of_streams(recording), *_of_force(recording), *_of_tracker(recording), *_of_loading(recording, curve))
    found = [one for one in (*measured, *_against_before(recording, peaks_before_N)) if not math.isnan(one.value)]
    unusable = tuple(_unusable(recording, curve))
    beyond = [(measure, measure.bounds(limits)) for measure in found if measure.value > measure.bounds(limits).good]
    bad = unusable or any(bounds.bad is not None and measure.value > bounds.bad for measure, bounds in beyond)
    verdict: Verdict = "bad" if bad else "usable" if beyond else "good"
    reasons = (*unusable, *(measure.sentence(limits) for measure, _ in beyond))
    return TrialQuality(verdict, reasons, {measure.name: measure.value for measure in found})


def evaluate_file(file: Path, limits: QualityLimits, peaks_before_N: Sequence[float] = ()) -> TrialQuality:
    """The same for the recording in ``file``; raises DataError where it cannot be read."""
    return evaluate_trial(read_recording(file), limits, peaks_before_N)


def _unusable(recording: Recording, curve: Curve | str | None) -> Iterator[str]:
    """What makes a trial bad whatever else holds; ``curve`` is its loading, or why there is none."""
    summary = recording.metadata.get(SUMMARY, {})
    if not recording.complete:
        yield "the recording was not finished"
    elif summary.get("cause") and not _answered(recording):
        yield f"it was stopped: {summary['cause']}"
    if recording.damage:
        yield f"the recording is damaged: {recording.damage[0]}"
    if isinstance(curve, str):
        yield f"no loading can be read from it: {curve}"


def _answered(recording: Recording) -> bool:
    """Whether the subject ended a run of force: that is what a threshold is measured by, and no fault of the trial."""
    return recording.tracks_force and recording.metadata.get(SUMMARY, {}).get("outcome") == "pain_stop"


def _curve(recording: Recording) -> Curve | str:
    try:
        return loading_curve(cycle_of(trial_of(recording.path.stem, recording)))
    except DataError as error:
        return str(error)


def _of_streams(recording: Recording) -> Iterator[Measure]:
    rates = measures.nominal_Hz(recording)
    yield Measure("cycles_missed", measures.cycles_missed(recording), "the loop missed of its cycles", " %", 100)
    for role, share in measures.wire_damage(recording).items():
        yield Measure(f"{role}.wire_damage", share, f"{role}: damaged or foreign on its wire, bytes a message:")
    for stream in ("force", "axis"):
        lost = measures.rate_lost(recording, stream, rates[stream]) if stream in rates else math.nan
        yield Measure(f"{stream}.rate_lost", lost, f"{stream}: below its nominal rate by", " %", 100)
        yield Measure(f"{stream}.gap_ms", measures.gap_ms(recording, stream), f"{stream}: a gap of", " ms")


def _of_force(recording: Recording) -> Iterator[Measure]:
    lost, full = measures.samples_lost(recording), measures.saturated(recording)
    yield Measure("force.samples_lost", lost, "force: samples lost or invalid", " %", 100)
    yield Measure("saturated", full, "force: samples at the end of the range", " %", 100)
    frozen = measures.frozen_samples(recording)
    yield Measure("frozen_samples", frozen, "force: equal readings in a row, as of a frozen sensor:")
    dead = measures.dead_channels(recording)
    yield Measure("dead_channels", float(len(dead)), f"force: channels that never change ({', '.join(dead)}):")
    drift_N = abs(measures.zero_drift_N(recording))
    yield Measure("zero_drift_N", drift_N, "force in the air went off during the trial by", " N")


def _of_tracker(recording: Recording) -> Iterator[Measure]:
    nominal_Hz = measures.nominal_Hz(recording).get("marker")
    if nominal_Hz is None:
        return
    lost = measures.tracker_lost(recording, nominal_Hz)
    yield Measure("tracker_lost", lost, "tracker: frames of the tip lost", " %", 100)
    slope = tracker_slope(recording)
    if slope is not None:
        off = max(abs(slope.slope - 1.0) - 2 * slope.deviation, 0.0)
        text = f"tracker: travels {slope.slope:.4f} mm while the axis says 1 mm, off by"
        yield Measure("tracker_slope_off", off, text, " %", 100)
        jump_mm = measures.tracker_jump_mm(recording, slope)
        yield Measure("tracker_jump_mm", jump_mm, "tracker: the tip's marker jumps by", " mm")


def _of_loading(recording: Recording, curve: Curve | str | None) -> Iterator[Measure]:
    """Of a recording with a cycle; ``curve`` is its loading, None of one without."""
    if curve is None:
        return
    within_mm = _contact_within_mm(recording)
    yield Measure("contact_within_mm", within_mm, "the surface is known no better than +-", " mm")
    if isinstance(curve, str):
        return
    reached_mm, asked_mm = measures.depth_mm(recording, curve.contact.position_mm), measures.asked_mm(recording)
    # A loading that the protocol's own limit of force ended is as deep as it should be, unless it is deeper.
    ended_early = recording.metadata.get(SUMMARY, {}).get("outcome") == FORCE_LIMIT
    missed_mm = reached_mm - asked_mm if ended_early else abs(reached_mm - asked_mm)
    # The whole loading leaves two deviations of contact open.
    off_mm = max(missed_mm - 2 * curve.contact.likely_mm, 0.0)
    yield Measure("depth_off_mm", off_mm, f"depth reached {reached_mm:.2f} of {asked_mm:g} mm: off by", " mm")
    yield Measure("loading_lost", measures.loading_lost(curve, reached_mm), "loading no fit can use:", " %", 100)


def _against_before(recording: Recording, peaks_before_N: Sequence[float]) -> Iterator[Measure]:
    """The force of a trial that reached its depth against the median of those that did before it."""
    summary = recording.metadata.get(SUMMARY, {})
    if recording.tracks_force or not peaks_before_N or summary.get("outcome") != "complete":
        return
    peak_N, usual_N = float(summary.get("peak_force_N", "nan")), median(peaks_before_N)
    text = f"peak force {peak_N:.2f} N, {usual_N:.2f} N in the trials before (another gain, or another site?): off by"
    yield Measure("peak_off", abs(peak_N / usual_N - 1.0), text, " %", 100)


def _contact_within_mm(recording: Recording) -> float:
    """Half of the interval in which the loop knew the surface when it set out the depth; NaN where nothing is said."""
    try:
        found = json.loads(recording.metadata.get(SUMMARY, {}).get("contact") or "{}")
        return float(max(found["high_mm"] - found["surface_mm"], found["surface_mm"] - found["low_mm"]))
    except (ValueError, KeyError, TypeError):
        return math.nan


def limits_of(recording: Recording) -> QualityLimits | None:
    """The bounds in the protocol a recording was made by; None where it was made by none that has them."""
    text = recording.metadata.get("protocol", {}).get("quality", "")
    try:
        return QualityLimits.model_validate_json(text) if text else None
    except ValidationError:
        return None


def quality_of(recording: Recording, trial: TrialInfo, read: Trial | None = None) -> TrialQuality | None:
    """What the session says of ``trial``, else what its recording gives by its bounds, or by what is stated of it.

    ``read`` is the trial in the recording, where the caller has it.
    """
    if trial.quality:
        return TrialQuality(trial.quality, trial.reasons, trial.measured)
    limits = limits_of(recording)
    return evaluate_trial(recording, limits) if limits else _of_statements(trial.name, recording, read)


def _of_statements(name: str, recording: Recording, read: Trial | None) -> TrialQuality | None:
    """The verdict on a recording of others, where what they state of it is not its motion's; None where it is."""
    found = () if recording.tracks_force else stated_findings(read or trial_of(name, recording))
    bad = any(finding.kind == BAD for finding in found)
    return TrialQuality("bad" if bad else "usable", tuple(finding.text for finding in found)) if found else None
