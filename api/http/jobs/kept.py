"""What jobs keep of sessions, beside their folder: it goes when those are erased."""

import contextlib
import json
import shutil
import time
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from api.catalogue.erasing import put_aside
from api.http.answers import ANSWERS, forget
from api.operations.cohort import kept

RECORD, EXPORTS = "job.json", "exports"
# Exports and pictures of jobs are made again when they are wanted.
KEPT_S = 7 * 24 * 3600.0
Facts = Mapping[str, Any]


def beside(sessions: Path, what: str) -> Path:
    """The folder of ``what`` of the folder of sessions."""
    whole = sessions.absolute()
    return whole.with_name(f"{whole.name}.{what}")


def erase_kept(sessions: Path, names: Collection[str]) -> None:
    """Removes jobs on these sessions, uploads they came from, answers about either, and all that is made again."""
    jobs = {record.parent: _facts(record) for record in beside(sessions, "jobs").glob(f"*/{RECORD}")}
    sent = {str(job["params"]["upload"]) for job in jobs.values() if _imported(job, names)}
    made = [folder for folder, job in jobs.items() if works_on(job, names) or job["params"].get("upload") in sent]
    uploads = [beside(sessions, "uploads") / name for name in sent]
    forget(beside(sessions, "jobs") / ANSWERS, {*names, *sent, *(folder.name for folder in made)})
    for folder in (*made, *uploads, beside(sessions, "jobs") / EXPORTS):
        if folder.exists():
            with put_aside(folder.parent, [folder.name]):  # whoever still writes into it no longer finds it
                pass
    kept.forget_oldest(0)


def forget_old(exports: Path) -> None:
    """Removes exports older than a week, of a session as it is or was, and what a service that was killed began."""
    for path in exports.glob("*"):
        with contextlib.suppress(OSError):  # another removes it too
            if time.time() - path.stat().st_mtime > KEPT_S:
                shutil.rmtree(path) if path.is_dir() else path.unlink()


def works_on(job: Facts, names: Collection[str]) -> bool:
    """Whether it needs one of these sessions: as its own, as one of several, or for a model."""
    asked = job["params"]
    models = (value.get("session") for value in asked.values() if isinstance(value, dict))
    several = asked.get("sessions")
    return any(one in names for one in (job["session"], *models, *(several if isinstance(several, list) else ())))


def _imported(job: Facts, names: Collection[str]) -> bool:
    return job["kind"] == "import" and job["session"] in names


def _facts(record: Path) -> Facts:
    """What was asked for; of a record that was not written by this program nothing."""
    nothing: Facts = {"kind": "", "session": None, "params": {}}
    try:
        found = json.loads(record.read_bytes())
        return {name: found[name] for name in nothing} if isinstance(found["params"], dict) else nothing
    except (ValueError, KeyError, TypeError):
        return nothing
