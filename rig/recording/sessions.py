"""A session: a folder of recordings, with ``session.json`` as its list of contents.

The recordings are the truth. ``session.json`` is rewritten in one step after each trial; where it is missing, broken or
behind (a crash), the recordings in the folder stand in for it. ``parquet/`` is derived and can always be rebuilt.
"""

import json
import math
import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BeforeValidator, JsonValue, TypeAdapter, ValidationError

from rig.errors import DataError, UsageError
from rig.recording.files import write_text
from rig.recording.manifest import Listed, file_sha256, find_mismatches, seal
from rig.recording.reader import Recording, read_recording
from rig.recording.tables import write_parquet

SESSION_FILE = "session.json"
PARQUET_FOLDER = "parquet"
JsonTable = dict[str, JsonValue]
# JSON has no NaN: an unknown number is null in the file and NaN here.
Number = Annotated[float, BeforeValidator(lambda value: math.nan if value is None else value)]
# Files are called by a trial's name, also where somebody else wrote the list: it leads nowhere.
TRIAL_NAME = re.compile(r"[^/\0.][^/\0]*")


@dataclass(frozen=True)
class TrialInfo:
    """One trial. ``file`` stands in the session's folder, ``sha256`` is its hash; unknown numbers are NaN.

    ``quality`` is good, usable or bad, empty where nobody judged, with ``reasons`` in words and what was ``measured``
    (see `rig.trials.quality`). ``repeats`` names the trial that was bad and is made again here.
    """

    name: str
    file: str
    speed_mm_s: Number
    depth_mm: Number
    outcome: str
    peak_force_N: Number = math.nan
    samples: dict[str, int] = field(default_factory=dict)
    dropped: dict[str, int] = field(default_factory=dict)
    surface_mm: Number = math.nan
    surface_low_mm: Number = math.nan
    surface_high_mm: Number = math.nan
    sha256: str = ""
    quality: Literal["", "good", "usable", "bad"] = ""
    reasons: tuple[str, ...] = ()
    measured: dict[str, Number] = field(default_factory=dict)
    repeats: str = ""

    def sealed(self, folder: Path) -> "TrialInfo":
        """The same with the hash of its recording in ``folder``, which is closed and there."""
        return replace(self, sha256=file_sha256(folder / self.file))


@dataclass(frozen=True)
class SessionInfo:
    """What ``session.json`` holds. ``created`` is ISO 8601 wall-clock time, ``axis_files`` a drive axis' folder."""

    id: str
    kind: Literal["capture", "import", "track"]
    created: str
    software: str
    protocol: JsonTable = field(default_factory=dict)
    wiring: JsonTable = field(default_factory=dict)
    subject: JsonTable = field(default_factory=dict)
    notes: JsonTable = field(default_factory=dict)
    axis_files: str = ""
    trials: tuple[TrialInfo, ...] = ()


@dataclass(frozen=True)
class Session:
    """An opened session. ``remarks`` are sentences on what was not as it should be, empty if all was.

    ``origin`` is the place somebody named where that is not its own ``folder``.
    """

    folder: Path
    info: SessionInfo
    remarks: tuple[str, ...] = ()
    origin: Path | None = None

    @property
    def place(self) -> Path:
        """What to call it by: the place it was opened from."""
        return self.origin or self.folder

    def refuse_axis(self) -> None:
        """Raises UsageError where it is of a drive axis."""
        if self.info.axis_files:
            raise UsageError(
                f"{self.place}: is a drive axis, as [axis] in its mapping says, and has no tissue; `rig diagnose` of "
                f"{self.info.axis_files} with that mapping fits its mass and friction"
            )

    @property
    def trials(self) -> tuple[TrialInfo, ...]:
        """Trials whose recording is there, in order."""
        return self.info.trials

    def trial(self, name: str) -> TrialInfo:
        """The trial called ``name``; raises UsageError with the names there are."""
        for trial in self.trials:
            if trial.name == name:
                return trial
        raise UsageError(f"{self.place}: no trial {name}; there are {', '.join(item.name for item in self.trials)}")

    @property
    def mismatches(self) -> tuple[str, ...]:
        """Sentences on files that were swapped, copied or changed since the list was written; reads every byte."""
        listed = [Listed(trial.name, trial.file, trial.sha256) for trial in self.trials]
        return find_mismatches(self.folder, SESSION_FILE, self.info.id, listed)

    def path(self, name: str) -> Path:
        """The recording of a trial."""
        return self.folder / self.trial(name).file

    def recording(self, name: str) -> Recording:
        """Reads the recording of a trial."""
        return read_recording(self.path(name))


_INFO = TypeAdapter(SessionInfo)


def write_session(folder: Path, info: SessionInfo) -> None:
    """Replaces ``session.json``, sealed, in one step."""
    write_text(folder / SESSION_FILE, json.dumps(seal(_plain_table(info)), indent=2, ensure_ascii=False) + "\n")


def _plain_table(info: SessionInfo) -> JsonTable:
    return {name: plain(value) for name, value in asdict(info).items()}


def plain(value: object) -> JsonValue:
    """``value`` as JSON can hold it: NaN and infinities as null, tuples as lists, other objects as text."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value if value is None or isinstance(value, str | int) else str(value)


def open_session(folder: Path) -> Session:
    """The session in ``folder``; raises DataError where there is none."""
    if not folder.exists():
        raise DataError(f"{folder}: no such session folder; `rig capture` and `rig import` make one")
    if not folder.is_dir():
        raise DataError(f"{folder}: a file; give the session folder that holds it")
    files = sorted(path.name for path in folder.glob("*.mcap") if not path.name.startswith("."))
    info, remarks = _read_info(folder)
    listed = {trial.file for trial in info.trials} if info else set()
    found, unreadable = _read_all(folder, [name for name in files if name not in listed])
    if info is None and not found:
        raise DataError(f"{folder}: no session here: neither {SESSION_FILE} nor a recording (*.mcap) that opens")
    info = info or _info_from(found[0])
    kept = [_safely_named(trial) for trial in info.trials if trial.file in files]
    remarks += [
        f"trial {trial.name}: its recording {trial.file} is missing" for trial in info.trials if trial.file not in files
    ]
    remarks += [f"{item.path.name}: not listed in {SESSION_FILE}, taken from the file itself" for item in found]
    return Session(folder, replace(info, trials=(*kept, *map(_trial_from, found))), (*remarks, *unreadable))


def read_listing(folder: Path) -> tuple[SessionInfo | None, tuple[str, ...]]:
    """What ``session.json`` says, None where it is missing or broken, and sentences on that.

    No recording is opened: a listing takes as long beside a session of an hour as beside an empty one.
    """
    info, remarks = _read_info(folder)
    listed = {trial.file for trial in info.trials} if info else set()
    unlisted = sorted(path.name for path in folder.glob("*.mcap") if path.name not in listed)
    return info, (*remarks, *(f"{name}: not listed in {SESSION_FILE}" for name in unlisted))


def derive(folder: Path, names: Collection[str] | None = None) -> list[Path]:
    """Rebuilds ``parquet/NAME.STREAM.parquet`` of all trials, or of those in ``names``; the paths written."""
    session = open_session(folder)
    target = folder / PARQUET_FOLDER
    target.mkdir(exist_ok=True)
    chosen = [trial for trial in session.trials if names is None or trial.name in names]
    return [path for trial in chosen for path in write_parquet(session.recording(trial.name), target, trial.name)]


def _read_info(folder: Path) -> tuple[SessionInfo | None, list[str]]:
    path = folder / SESSION_FILE
    try:
        return _INFO.validate_json(path.read_bytes()), []
    except FileNotFoundError:
        return None, [f"{SESSION_FILE} is missing: the session is taken from its recordings"]
    except (OSError, ValidationError):
        return None, [f"{SESSION_FILE} cannot be read: the session is taken from its recordings"]


def _read_all(folder: Path, files: Iterable[str]) -> tuple[list[Recording], list[str]]:
    """The recordings that open, and a sentence for each that does not."""
    found, unreadable = [], []
    for name in files:
        try:
            found.append(read_recording(folder / name))
        except DataError as error:
            unreadable.append(str(error))
    return found, unreadable


def _info_from(first: Recording) -> SessionInfo:
    recording = first.metadata.get("recording", {})
    tables = {name: _nested(first.metadata.get(name, {})) for name in ("protocol", "wiring", "subject", "notes")}
    return SessionInfo(
        id=recording.get("session", first.path.parent.name),
        kind="import" if recording.get("kind") == "import" else "capture",
        created=recording.get("wall_start_iso", ""),
        software=recording.get("software", ""),
        protocol=tables["protocol"],
        wiring=tables["wiring"],
        subject=tables["subject"],
        notes=tables["notes"],
        axis_files=recording.get("axis_files", ""),
    )


def _nested(values: Mapping[str, str]) -> JsonTable:
    """A metadata record with its JSON texts as values; a lone key ``json`` is the whole table."""
    found = {name: _value(text) for name, text in values.items()}
    whole = found.get("json")
    return {str(key): item for key, item in whole.items()} if isinstance(whole, dict) and len(found) == 1 else found


def _value(text: str) -> JsonValue:
    # Only tables and lists are JSON; a subject called 7 stays a text.
    if not text.startswith(("{", "[")):
        return text
    try:
        found: JsonValue = json.loads(text)
    except ValueError:
        return text
    return found


def _safely_named(trial: TrialInfo) -> TrialInfo:
    return trial if TRIAL_NAME.fullmatch(trial.name) else replace(trial, name=Path(trial.file).stem)


def _trial_from(recording: Recording) -> TrialInfo:
    trial, summary = recording.metadata.get("trial", {}), recording.metadata.get("summary", {})
    samples = {name: len(table) for name, table in recording.tables.items() if len(table)}
    return TrialInfo(
        recording.path.stem,
        recording.path.name,
        _number(trial.get("speed_mm_s", "")),
        _number(trial.get("depth_mm", "")),
        summary.get("outcome", "recording not finished"),
        samples=samples,
    )


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
