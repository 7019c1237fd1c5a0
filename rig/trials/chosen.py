"""Which recordings of a session are taken: by their names, and by what a label says that they are of."""

from collections.abc import Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path

from rig.errors import DataError, UsageError
from rig.recording.reader import messages
from rig.recording.scan import Scan
from rig.recording.sessions import Session, TrialInfo

LABELS = ("specimen", "site", "cycle", "operator")
RECORDING = "recording"
MOST_NAMED = 3  # where none fits: the first tell how they are called


def labels_of(metadata: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """What the metadata of a recording say that it is of; the labels of its files come before the notes."""
    stated = {**metadata.get("notes", {}), **metadata.get("labels", {})}
    return {key: text for key, text in stated.items() if key in LABELS}


def chosen(session: Session, *patterns: str) -> Session:
    """The session with those recordings that each of ``patterns`` matches: by name, or by label, as ``site=B*``.

    An empty pattern matches all. Raises UsageError where there is none.
    """
    for pattern in filter(None, patterns):
        session = _taken(session, pattern)
    return session


def _taken(session: Session, pattern: str) -> Session:
    label, equals, of_label = pattern.partition("=")
    by_label = bool(equals) and label in (*LABELS, RECORDING)
    asked, wanted = (label, of_label) if by_label else (RECORDING, pattern)
    trials = tuple(trial for trial in session.trials if fnmatchcase(_value(session, trial, asked), wanted))
    if not trials:
        names = dict.fromkeys(_value(session, trial, asked) or "(none)" for trial in session.trials)
        called = f"their {label}s are" if by_label else "they are called like"
        shown = ", ".join(list(names)[:MOST_NAMED])
        raise UsageError(f"{session.place}: no recording matches --only {pattern!r}; {called} {shown}")
    about = (remark for remark in session.remarks if any(trial.name in remark for trial in trials))
    said = f"{len(trials)} of {len(session.trials)} recordings are taken, those matching {pattern!r}"
    return replace(session, info=replace(session.info, trials=trials), remarks=(said, *about))


def parts_of(session: Session, label: str) -> tuple[str, ...]:
    """The values of ``label`` over the recordings, each once, in their order; empty for those that have none.

    ``recording`` is each by itself. Raises DataError where no recording has the label.
    """
    values = tuple(dict.fromkeys(_value(session, trial, label) for trial in session.trials))
    if not any(values):
        raise DataError(
            f"{session.place}: no recording says its {label}, so none are told apart by it; name it in the mapping "
            f'({label} = "{{...}}"), or take each by itself with --by {RECORDING}'
        )
    return values


def _value(session: Session, trial: TrialInfo, label: str) -> str:
    if label == RECORDING:
        return trial.name
    return _labels_in(session.folder / trial.file).get(label, "")


def _labels_in(recording: Path) -> dict[str, str]:
    """Of its first bytes, where they stand; none of what cannot be read, which whoever reads all of it says."""
    found = Scan()
    try:
        next(messages(recording, found), None)
    except DataError:
        return {}
    return labels_of(found.metadata)
