"""The quality verdict of what was just recorded, and the end of a command whose trials stayed bad."""

from dataclasses import replace
from pathlib import Path

from rig.config.quality import QualityLimits
from rig.errors import BadTrial, DataError
from rig.recording.reader import read_recording
from rig.recording.sessions import SessionInfo, TrialInfo
from rig.trials.quality import TrialQuality, evaluate_trial


def with_quality(trial: TrialInfo, folder: Path, limits: QualityLimits) -> TrialInfo:
    """The entry with the verdict on its recording, which is closed; one that cannot be read is bad."""
    try:
        found = evaluate_trial(read_recording(folder / trial.file), limits)
    except DataError as error:
        found = TrialQuality("bad", (str(error),))
    return replace(trial, quality=found.verdict, reasons=found.reasons, measured=dict(found.measured))


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
