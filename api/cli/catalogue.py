"""`rig catalogue` and `rig subject`: what the folder of sessions holds, by query, and whose it is."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer

from api.catalogue.catalogue import Catalogue
from api.catalogue.pages import Page
from api.catalogue.queries import Asked
from api.catalogue.settings import ENVIRONMENT, USUAL
from api.catalogue.subjects import erase_subject, export_subject
from api.cli.options import JsonOption
from api.cli.output import show, write_json
from api.http.jobs.kept import erase_kept
from rig.errors import UsageError
from rig.results.base import Result, SavedResult
from rig.results.catalogue import ErasureResult, SubjectHistory
from rig.results.tables import UNKNOWN, TextTable

What = Literal[
    "sessions", "trials", "models", "diagnoses", "causes", "operations", "sites", "rebuild", "backup", "restore"
]
Whose = Literal["list", "show", "name", "export", "erase"]
SessionsOption = Annotated[Path, typer.Option("--sessions", help="Folder of the sessions.")]
CatalogueOption = Annotated[
    str, typer.Option("--catalogue", help=f"File or postgresql:// URL; else ${ENVIRONMENT}, else beside the folder.")
]
SESSIONS = Path("sessions")
# Header and field of the columns that a person looks for first; --json has all.
COLUMNS: Mapping[str, Mapping[str, str]] = {
    "sessions": {
        "session": "session", "date (UTC)": "at", "subject": "subject", "site": "site", "kind": "kind",
        "quality": "quality", "trials": "trials", "samples": "samples", "dropped": "dropped",
    },
    "trials": {
        "session": "session", "trial": "name", "quality": "quality", "outcome": "outcome",
        "speed (mm/s)": "speed_mm_s", "depth (mm)": "depth_mm", "peak (N)": "peak_force_N",
    },
    "models": {
        "session": "session", "subject": "subject", "site": "site", "law": "law", "causes": "causes",
        "rms error (N)": "rmse_N", "left out (%)": "held_out_max_error_percent", "to (N)": "force_N",
    },
    "diagnoses": {
        "session": "session", "subject": "subject", "verdict": "verdict", "causes": "causes",
        "explained": "explained_share",
    },
    "causes": {"session": "session", "subject": "subject", "cause": "name", "statement": "statement",
               "confidence": "confidence"},
    "operations": {"session": "session", "date (UTC)": "at", "kind": "kind", "file": "file"},
    "thresholds": {"session": "session", "date (UTC)": "at", "site": "site", "force (N)": "force_N",
                   "up to (N)": "up_to_N"},
    "sites": {"subject": "subject", "site": "site", "first (UTC)": "first", "last (UTC)": "last",
              "sessions": "sessions"},
    "subjects": {"subject": "subject", "name": "name", "sites": "sites", "last (UTC)": "last", "sessions": "sessions"},
}  # fmt: skip
# To the minute.
DATE_CHARACTERS = len("2026-11-23T10:00")


def catalogue(
    what: Annotated[What, typer.Argument(help="What to list or do.")],
    file: Annotated[Path | None, typer.Argument(help="Of backup (new) and restore: the file of names.")] = None,
    sessions: SessionsOption = SESSIONS,
    given: CatalogueOption = "",
    subject: Annotated[str, typer.Option("--subject", help="Only of this subject's code.")] = "",
    site: Annotated[str, typer.Option("--site", help="Only of this site.")] = "",
    session: Annotated[str, typer.Option("--session", help="Only of this session's folder.")] = "",
    kind: Annotated[str, typer.Option("--kind", help="capture, import or track; of operations also others.")] = "",
    quality: Annotated[str, typer.Option("--quality", help="good, usable or bad.")] = "",
    law: Annotated[str, typer.Option("--law", help="Of models: the law.")] = "",
    verdict: Annotated[str, typer.Option("--verdict", help="Of diagnoses: adequate, explained, unexplained.")] = "",
    cause: Annotated[str, typer.Option("--cause", help="Only where a diagnosis named this cause.")] = "",
    since: Annotated[str, typer.Option("--since", help="Date or time, UTC where it has no zone.")] = "",
    until: Annotated[str, typer.Option("--until", help="Date or time; a date includes its day.")] = "",
    limit: Annotated[int, typer.Option("--limit", help="Lines of one page.")] = USUAL,
    cursor: Annotated[str, typer.Option("--cursor", help="Goes on after the page that said it.")] = "",
    json_file: JsonOption = None,
) -> None:
    """Lists sessions, trials, models, diagnoses, causes, operations and sites; rebuilds that from the folders.

    What is listed follows the folders by itself. Names of people are only in the catalogue: backup writes them to a
    file, restore brings them back.

    Example: rig catalogue sessions --subject S01 --quality good
    """
    lists = Catalogue(_there(sessions), given)
    asked = Asked(subject, site, session, kind, quality, law, verdict, cause, since=since, until=until)
    if what in ("backup", "restore"):
        _names(lists, what == "backup", file, json_file)
    elif file is not None:
        raise UsageError(f"{file}: says nothing to `rig catalogue {what}`; leave it out")
    elif what == "rebuild":
        made = lists.rebuild()
        show(f"{made.catalogue}: {made.sessions} sessions of {made.subjects} subjects, {made.names} names")
        show(*made.remarks)
        write_json(json_file, made)
    else:
        find: Callable[[Asked, Page], SavedResult] = getattr(lists, what)
        _list(what, find(asked, Page(limit, cursor)), json_file)


def _there(sessions: Path) -> Path:
    if not sessions.is_dir():
        raise UsageError(f"{sessions}: no such folder of sessions; give it with --sessions")
    return sessions


def _names(lists: Catalogue, backup: bool, file: Path | None, json_file: Path | None) -> None:
    if file is None:
        raise UsageError(f"give the file of names, as in: rig catalogue {'backup' if backup else 'restore'} names.json")
    done = lists.backup(file) if backup else lists.restore(file)
    kept = f"{done.file}: {done.names} names kept; only this account may read it"
    show(kept if backup else f"{done.file}: {done.names} names brought back; newer ones stayed")
    write_json(json_file, done)


def _list(what: str, found: SavedResult, json_file: Path | None) -> None:
    facts = vars(found)
    show(_table(what, facts["items"]), *facts.get("remarks", ()), *_remarks(what, facts["items"]))
    if facts["next"]:
        show(f"there are more: --cursor {facts['next']}")
    write_json(json_file, found)


def _remarks(what: str, items: Sequence[Result]) -> list[str]:
    """What is too long for a column: remarks on sessions, and why a trial is not good."""
    field, whose = {"sessions": ("remarks", "session"), "trials": ("reasons", "key")}.get(what, ("", ""))
    facts = [vars(item) for item in items if field]
    return [f"{each[whose]}: {sentence}" for each in facts for sentence in each[field]]


def _table(what: str, items: Sequence[Result]) -> TextTable:
    columns = COLUMNS[what]
    rows = [[_cell(vars(item)[name]) for name in columns.values()] for item in items]
    words = next((place for place, name in enumerate(columns) if "(N)" in name or "(mm" in name), len(columns))
    return TextTable("", list(columns), rows, words=words)


def _cell(value: object) -> str:
    match value:
        case None | "":
            return UNKNOWN
        case float():
            return f"{value:.3g}"
        case tuple():
            return ", ".join(map(str, value)) or UNKNOWN
        case str() if value.endswith("Z") and "T" in value:
            return value[:DATE_CHARACTERS].replace("T", " ")
    return str(value)


def subject(
    what: Annotated[Whose, typer.Argument(help="What to do.")],
    code: Annotated[str, typer.Argument(help="The subject's code, as its sessions carry it.")] = "",
    name: Annotated[str | None, typer.Argument(help="The person's name; empty: it is forgotten.")] = None,
    sessions: SessionsOption = SESSIONS,
    given: CatalogueOption = "",
    out: Annotated[Path | None, typer.Option("--out", help="Of export: the new zip file.")] = None,
    confirm: Annotated[str, typer.Option("--confirm", help="Of erase: what its first step printed.")] = "",
    json_file: JsonOption = None,
) -> None:
    """Lists subjects, shows one's history, keeps a name for a code, exports all data of a subject, erases them.

    The first step of erase says what goes and prints what the second needs. Sessions carry a code only; names are kept
    beside them.

    Example: rig subject show S01
    """
    lists = Catalogue(_there(sessions), given)
    if what == "list":
        _list("subjects", lists.subjects(), json_file)
        return
    if not code:
        raise UsageError(
            f"give the subject's code, as in: rig subject {what} S01; `rig subject list` says who there is"
        )
    match what:
        case "show":
            _history(lists.history(code), json_file)
        case "name":
            _rename(lists, code, name)
        case "export":
            _export(lists, code, out, json_file)
        case "erase":
            _erased(erase_subject(lists, code, confirm, also=partial(erase_kept, lists.root)), json_file)


def _history(found: SubjectHistory, json_file: Path | None) -> None:
    show(f"{found.subject.subject}: {found.subject.name or 'no name is kept'}; {found.subject.sessions} sessions")
    for what in ("sessions", "thresholds", "models", "diagnoses"):
        if items := getattr(found, what):
            show(what, _table(what, items))
    write_json(json_file, found)


def _rename(lists: Catalogue, code: str, name: str | None) -> None:
    if name is None:
        raise UsageError(f'give the name, as in: rig subject name {code} "Ann Example"; "" forgets it')
    lists.rename(code, name)
    show(f"{code}: {f'is {name}' if name.strip() else 'the name is forgotten'}")


def _export(lists: Catalogue, code: str, out: Path | None, json_file: Path | None) -> None:
    if out is None:
        raise UsageError(f"give the new archive, as in: rig subject export {code} --out {code}.zip")
    done = export_subject(lists, code, out)
    show(f"{done.archive}: {done.sessions} sessions, {done.files} files, {done.bytes / 1e6:.1f} MB", *done.left_out)
    write_json(json_file, done)


def _erased(done: ErasureResult, json_file: Path | None) -> None:
    size = f"{len(done.sessions)} sessions, {done.files} files, {done.bytes / 1e6:.1f} MB"
    if done.done:
        show(f"{done.subject}: erased: {size}")
    else:
        show(f"{done.subject}: {size}: {', '.join(done.sessions)}", done.statement)
        show(f"nothing is erased yet; to erase it: rig subject erase {done.subject} --confirm {done.confirm}")
    write_json(json_file, done)
