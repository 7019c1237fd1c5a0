"""The quality verdict of what was just recorded, and the end of a command whose trials stayed bad."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from controller.loop.messages import Outcome
from rig.apart import apart
from rig.config.quality import QualityLimits
from rig.errors import BadTrial, DataError
from rig.recording.sessions import SessionInfo, TrialInfo
from rig.trials.quality import TrialQuality, evaluate_file


def with_surface(trial: TrialInfo, outcome: Outcome) -> TrialInfo:
    """The entry with the surface that was found, where one was."""
    touch = outcome.touch
    if touch is None:
        return trial
    return replace(trial, surface_mm=touch.surface_mm, surface_low_mm=touch.low_mm, surface_high_mm=touch.high_mm)


def with_quality(trial: TrialInfo, folder: Path, limits: QualityLimits, before: Sequence[TrialInfo] = ()) -> TrialInfo:
    """The entry with the verdict on its recording, which is closed; one that cannot be read is bad.

    ``before`` are the session's trials so far; those that reached the same depth and are not bad are compared with.
    """
    alike = [one for one in before if one.depth_mm == trial.depth_mm and one.outcome == "complete"]
    peaks_N = [one.peak_force_N for one in alike if one.quality in ("good", "usable") and one.peak_force_N > 0]
    file = folder / trial.file
    try:
        found = apart(file, evaluate_file, file, limits, peaks_N)
    except DataError as error:
        found = TrialQuality("bad", (str(error),))
    return replace(trial, quality=found.verdict, reasons=found.reasons, measured=dict(found.measured))


def sentences(trial: TrialInfo) -> tuple[str, ...]:
    """A line on the trial, and one a reason of its verdict."""
    samples, dropped = sum(trial.samples.values()), sum(trial.dropped.values())
    line = (
        f"{trial.name}  {trial.speed_mm_s:5g} mm/s  {_surface(trial)}  peak {trial.peak_force_N:6.2f} N"
        f"  {samples:7d} samples  {dropped} dropped  {trial.outcome}  {trial.quality}"
    )
    return (line, *(f"    {reason}" for reason in trial.reasons))


def _surface(trial: TrialInfo) -> str:
    """Where the surface was found, and how far its 95 % interval reaches."""
    within_mm = max(trial.surface_high_mm - trial.surface_mm, trial.surface_mm - trial.surface_low_mm)
    return "no surface" if math.isnan(trial.surface_mm) else f"surface {trial.surface_mm:6.2f} +-{within_mm:.2f} mm"


def remaining_bad(info: SessionInfo) -> tuple[TrialInfo, ...]:
    """Trials whose last repeat, or they themselves where there is none, are bad."""
    last = {trial.repeats or trial.name: trial for trial in info.trials}
    return tuple(trial for trial in last.values() if trial.quality == "bad")


def refuse_bad(info: SessionInfo) -> None:
    """Raises BadTrial where a trial stayed bad."""
    bad = remaining_bad(info)
    if bad:
        raise BadTrial(
            f"{len(bad)} of {len({trial.repeats or trial.name for trial in info.trials})} trials stayed bad"
            f" ({', '.join(trial.name for trial in bad)}); {bad[0].name}: {'; '.join(bad[0].reasons)};"
            " mend that and capture again: a fit leaves them out"
        )
