"""One folder of a session, read into entries. Links are not followed: they may lead to what nobody meant to list."""

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from rig.errors import RigError
from rig.recording.sessions import SESSION_FILE, SessionInfo, open_session, read_listing
from rig.results.catalogue import (
    CatalogueEntry,
    CauseEntry,
    DiagnosisEntry,
    ModelEntry,
    SessionEntry,
    ThresholdEntry,
    TrialEntry,
    WorkEntry,
)
from rig.results.diagnosis import DiagnosisResult
from rig.results.tracking import THRESHOLD, Threshold
from rig.tissue.model import load_model
from rig.trials.opening import RECORDING, is_session

# Both databases count in 64 bits.
MOST = 2**63 - 1
# PostgreSQL indexes texts of up to 2,700 bytes, which are 675 characters of any kind.
LONGEST = 500
WORST_FIRST = ("bad", "usable", "good")
MODELS = ("fit/model.json", "diagnosis/model.json")
DIAGNOSIS = "diagnosis/diagnosis.json"
WORK = {"fit": "fit/fit.json", "diagnose": DIAGNOSIS, "track": "track.json", "report": "report.html"}
READ = (SESSION_FILE, *MODELS, *WORK.values())


def utc(seconds: float) -> str:
    """A time since 1970 as UTC in the one form of all entries; empty where no calendar has it."""
    try:
        return _text(datetime.fromtimestamp(seconds, UTC))
    except (OverflowError, ValueError, OSError):
        return ""


def utc_of(stated: str) -> str:
    """A stated ISO time in the same form, one without zone taken as UTC; empty where it is none."""
    try:
        found = datetime.fromisoformat(stated)
        return _text(found.astimezone(UTC) if found.tzinfo else found.replace(tzinfo=UTC))
    except (OverflowError, ValueError):
        return ""


def _text(time: datetime) -> str:
    return time.isoformat(timespec="microseconds").replace("+00:00", "Z")


def short(text: str) -> str:
    """``text``, or of one too long to be looked up its beginning and a hash of the whole."""
    if len(text) <= LONGEST:
        return text
    return f"{text[: LONGEST - 20]}...{hashlib.sha256(text.encode(errors='replace')).hexdigest()[:16]}"


def stamp(folder: Path) -> str:
    """A text that changes with every file of ``folder`` that is read here; raises OSError where the folder is gone.

    Sizes, dates and file numbers are compared for equality, never for order: a clock may go back. No file is opened:
    every question asks this of every folder. Beside a list a recording is its name: one that grows, while all look on,
    is read when the list says more of it.
    """
    with os.scandir(folder) as found:
        names = {item.name for item in found}
    recordings = {name for name in names if name.endswith(RECORDING)}
    own = [name for name in names - recordings if name.endswith(".json") or name in READ]
    named, looked = (recordings, own) if SESSION_FILE in names else ((), [*recordings, *own])
    inner = [name for name in READ if name.partition("/")[0] in names and "/" in name]
    looks = repr([*sorted(named), *(_looks(folder, name) for name in sorted((*looked, *inner)))])
    return hashlib.sha256(looks.encode("utf-8", "surrogateescape")).hexdigest()


def _looks(folder: Path, name: str) -> tuple[str | int, ...]:
    try:
        now = os.lstat(f"{folder}/{name}")
    except (FileNotFoundError, NotADirectoryError):
        return (name,)
    return name, now.st_size, now.st_mtime_ns, now.st_ctime_ns, now.st_ino, now.st_mode


def read_folder(folder: Path) -> list[CatalogueEntry]:
    """All entries of the session in ``folder``: one of itself first; empty where it holds none."""
    if not is_session(folder):
        return []
    info, remarks = _info_of(folder)
    reader = _Reader(folder, info, _common(folder, info))
    found = [*reader.trials(), *reader.results()]
    return [reader.session((*remarks, *reader.remarks)), *found]


@dataclass(frozen=True)
class _Common:
    """What all entries of a session share."""

    session: str
    at: str
    subject: str
    site: str


def _common(folder: Path, info: SessionInfo | None) -> _Common:
    at = utc_of(info.created) if info else ""
    subject = info.subject if info else {}
    return _Common(folder.name, at or _date(folder), *(short(_stated(subject.get(key))) for key in ("id", "site")))


def _stated(value: object) -> str:
    """A code or site as text; a number keeps the form it was written in."""
    if value is None or isinstance(value, str):
        return (value or "").strip()
    return json.dumps(value)


def _date(path: Path) -> str:
    return utc(path.lstat().st_mtime)


def _info_of(folder: Path) -> tuple[SessionInfo | None, tuple[str, ...]]:
    """The session's list, or what its recordings say where that is missing, broken or a link."""
    if (folder / SESSION_FILE).is_symlink():
        return None, (f"{SESSION_FILE} is a link, which is not followed; put the file itself there",)
    info, remarks = read_listing(folder)
    if info is not None:
        return info, remarks
    if any(path.is_symlink() for path in folder.glob(f"*{RECORDING}")):
        return None, (*remarks, "recordings are links, which are not followed; put the files themselves there")
    try:
        session = open_session(folder)
    except RigError as error:
        return None, (*remarks, str(error))
    return session.info, session.remarks


class _Reader:
    """Reads one folder; ``remarks`` grow by what could not be read."""

    def __init__(self, folder: Path, info: SessionInfo | None, common: _Common) -> None:
        self._folder, self._info, self._common = folder, info, common
        self.remarks: list[str] = []

    def _key(self, name: str) -> str:
        return short(f"{self._common.session}/{name}")

    def session(self, remarks: Iterable[str]) -> SessionEntry:
        """The session itself."""
        info, own = self._info, vars(self._common)
        if info is None:
            return SessionEntry(key=self._common.session, **own, remarks=tuple(dict.fromkeys(remarks)))
        return SessionEntry(
            key=self._common.session,
            **own,
            id=info.id,
            kind=info.kind,
            created=info.created,
            software=info.software,
            protocol=_stated(info.protocol.get("name")),
            trials=len(info.trials),
            samples=min(MOST, sum(sum(trial.samples.values()) for trial in info.trials)),
            dropped=min(MOST, sum(sum(trial.dropped.values()) for trial in info.trials)),
            quality=_quality(info),
            remarks=tuple(dict.fromkeys(remarks)),
        )

    def trials(self) -> Iterator[TrialEntry]:
        """Each trial, by the first that has its name."""
        listed = {trial.name: trial for trial in reversed(self._info.trials if self._info else ())}
        for trial in listed.values():
            yield TrialEntry.model_validate({**vars(trial), **vars(self._common), "key": self._key(trial.name)})

    def results(self) -> Iterator[CatalogueEntry]:
        """What was made of the session."""
        if self._info is not None:
            yield self._work(self._info.kind, SESSION_FILE)
        yield from (self._work(kind, name) for kind, name in WORK.items() if self._is_file(name))
        for name in MODELS:
            yield from self._read(name, self._model)
        yield from self._read(DIAGNOSIS, self._diagnosis)
        for path in sorted(self._folder.glob(f"*.{THRESHOLD}")):
            yield from self._read(path.name, self._threshold)

    def _is_file(self, name: str) -> bool:
        """Whether it is there as a file, in a folder that is no link."""
        path = self._folder / name
        links = [place for place in (path, path.parent) if place.is_symlink()]
        self.remarks += [f"{name}: {place.name} is a link, which is not followed" for place in links]
        return path.is_file() and not links

    def _read(self, name: str, read: Callable[[str], Iterable[CatalogueEntry]]) -> Iterator[CatalogueEntry]:
        """What ``read`` finds in the file; what is wrong with it is a remark."""
        if not self._is_file(name):
            return
        try:
            yield from list(read(name))
        except (RigError, OSError, ValueError) as error:
            self.remarks.append(f"{name} cannot be listed: {str(error).removeprefix(f'{self._folder / name}: ')}")

    def _about(self, name: str) -> dict[str, str]:
        return {**vars(self._common), "key": self._key(name), "at": _date(self._folder / name)}

    def _work(self, kind: str, name: str) -> WorkEntry:
        own = {**vars(self._common), "key": self._key(f"{kind}:{name}")}
        at = self._common.at if name == SESSION_FILE else _date(self._folder / name)
        return WorkEntry(**{**own, "at": at}, kind=kind, file=name)

    def _model(self, name: str) -> Iterator[ModelEntry]:
        model = load_model(self._folder / name)
        yield ModelEntry(
            **self._about(name),
            file=name,
            law=model.law.name,
            parameters={each.name: each.value for each in model.law.parameters},
            rmse_N=model.quality.rmse_N,
            held_out_max_error_percent=model.quality.held_out_max_error_percent,
            depth_mm=model.valid.depth_mm,
            force_N=model.valid.force_N,
            causes=tuple(effect.name for effect in model.effects),
        )

    def _diagnosis(self, name: str) -> Iterator[CatalogueEntry]:
        found = DiagnosisResult.read(self._folder / name)
        share = found.explained_share
        yield DiagnosisEntry(
            **self._about(name),
            file=name,
            verdict=found.verdict,
            statement=found.statement,
            explained_share=share.value if share else None,
            causes=tuple(cause.effects[0] for cause in found.findings),
        )
        for number, cause in enumerate(found.findings, 1):
            for effect in cause.effects:
                yield CauseEntry(
                    **{**self._about(name), "key": self._key(f"cause {number} {effect}")},
                    name=effect,
                    statement=cause.statement,
                    confidence=cause.confidence,
                )

    def _threshold(self, name: str) -> Iterator[CatalogueEntry]:
        found = Threshold.read(self._folder / name)
        about = self._about(name)
        about["site"] = found.site or about["site"]
        yield ThresholdEntry(**about, recording=found.recording, force_N=found.force_N, up_to_N=found.up_to_N)
        yield self._work("threshold", name)


def _quality(info: SessionInfo) -> str:
    """The worst of the trials that were not made again."""
    last = {trial.repeats or trial.name: trial.quality for trial in info.trials}
    return next((quality for quality in WORST_FIRST if quality in last.values()), "")
